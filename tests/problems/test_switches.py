"""The times at which formulas switch, solved for with parameters."""

import numpy as np
import pytest

from problems import VectorField
from problems.analysis.switches import Switches

C = {"c": 2.7, "w": 0.25, "many": [3.0, 0.5, 1.5]}
CASES = {
    "a literal": (lambda t, m: m.where(t > 2.5, 1, -1), [2.5]),
    "a parameter": (lambda t, par, m: m.where(t > par.c, 1, -1), [2.7]),
    "scaled": (lambda t, par, m: m.where(2 * t > 2 * par.c, 1, -1), [2.7]),
    "backwards": (lambda t, par, m: m.where(par.c - t < 0, 1, -1), [2.7]),
    "a function of parameters": (lambda t, par, m: m.where(t * m.sqrt(par.w) > par.w**2, 1, 0), [0.125]),
    "two": (lambda t, par, m: m.where((t > par.w) & (t < par.c), 1, 0), [0.25, 2.7]),
    "a pulse": (lambda t, par, m: m.where(m.abs(t - par.c) < par.w, 1, 0), [2.45, 2.7, 2.95]),
    "a chosen time": (lambda t, par, m: m.where(m.where(par.c > 1, t, 2 * t) > par.c, 1, 0), [2.7]),
    "an absolute value": (lambda t, par, m: m.abs(4 * t - par.c), [0.675]),
    "a table": (lambda t, par, m: m.table(t / par.w - 1, [0, 1, 3], [0, 1, 0]), [0.25, 0.5, 1.0]),
    "a sum": (lambda t, par, m: m.sum(lambda i: m.where(t > par.many[i], 1, 0), range(3)), [0.5, 1.5, 3.0]),
    "no time": (lambda y, par, m: m.where(y[0] > par.c, 1, 0), []),
    "time and state": (lambda t, y, m: m.where(t > y[0], 1, 0), []),
    "not affine": (lambda t, par, m: m.where(m.sin(t) > 0.3, 1, 0) + m.where(t * t > par.c, 1, 0),
                   [np.arcsin(0.3), 2.7**0.5, np.pi - np.arcsin(0.3)]),
    "never": (lambda t, par, m: m.where(0 * t > par.c, 1, 0), []),
}  # fmt: skip


PERIODIC = {
    "a cosine": (lambda t, f: f.cos(6.5 * t) > 0.99),
    "a rest": (lambda t, f: t / 1.3 - f.round(t / 1.3) > 0.49),
    "a chirp": (lambda t, f: f.sin(t * t) * f.exp(-t / 10) > 0.3),
    "poles": (lambda t, f: f.tan(t) > 1),
    "one narrow bump": (lambda t, f: f.exp(-(((t - 5) / 1e-3) ** 2)) > 0.5),
    "a rounded wave": (lambda t, f: f.floor(3 * f.sin(t)) > 0.5),
    "two of them": (lambda t, f: (f.sin(t) > 0.9) | (f.cos(7 * t) > 0.95)),
}


def times_of(system, par):
    return Switches(system).times(par, 0.05, 4.95)[0]


@pytest.mark.parametrize("name", PERIODIC)
def test_no_switch_of_a_periodic_condition_is_missed(name):
    condition = PERIODIC[name]
    system = VectorField(lambda t, m: [m.where(condition(t, m), 1.0, 0.0)], dim=1)
    times, _, near, far = Switches(system).times(system.pack(), 0.1, 30.0)
    assert (near, far) == (0.1, 30.0)
    ends = np.concatenate([[0.1], times, [30.0]])
    parts = np.linspace(0.01, 0.99, 50)[:, None]
    sides = condition(ends[:-1] + np.diff(ends) * parts, np)
    assert (sides == sides[0]).all()  # nothing happens between two of them
    assert times.size >= 2


def test_many_switches_come_in_parts():
    system = VectorField(lambda t, m: [m.where(m.cos(2 * np.pi * t) > 0.5, 1.0, 0.0)], dim=1)
    times, _, near, far = Switches(system).times(system.pack(), 0.0, 1e7)
    assert near == 0.0
    assert far == 1e7 / 2.0**12
    assert times.size == pytest.approx(2 * far, abs=2)


@pytest.mark.parametrize("case", CASES)
def test_switches_are_solved_for(case):
    formula, expected = CASES[case]

    def field(t, y, par, m):
        given = {"t": t, "y": y, "par": par, "m": m}
        return [formula(*(given[name] for name in formula.__code__.co_varnames))]

    system = VectorField(field, dim=1, parameters=C)
    assert times_of(system, system.pack()) == pytest.approx(np.array(expected), rel=1e-15)


def test_they_follow_the_parameters():
    system = VectorField(lambda t, par, m: [m.where(t > par.c, 1, -1)], dim=1, parameters={"c": 1.0})
    switches = Switches(system)
    assert switches.any
    for c in (-3.0, 0.1, 17.25):
        assert switches.times(system.pack({"c": c}), -20.0, 20.0)[0].tolist() == [c]
