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
    "not affine": (lambda t, par, m: m.where(m.sin(t) > 0.3, 1, 0) + m.where(t * t > par.c, 1, 0), []),
    "never": (lambda t, par, m: m.where(0 * t > par.c, 1, 0), []),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_switches_are_solved_for(case):
    formula, expected = CASES[case]

    def field(t, y, par, m):
        given = {"t": t, "y": y, "par": par, "m": m}
        return [formula(*(given[name] for name in formula.__code__.co_varnames))]

    system = VectorField(field, dim=1, parameters=C)
    assert Switches(system).times(system.pack()) == pytest.approx(np.array(expected), rel=1e-15)


def test_they_follow_the_parameters():
    system = VectorField(lambda t, par, m: [m.where(t > par.c, 1, -1)], dim=1, parameters={"c": 1.0})
    switches = Switches(system)
    assert switches.any
    for c in (-3.0, 0.1, 17.25):
        assert switches.times(system.pack({"c": c})).tolist() == [c]
