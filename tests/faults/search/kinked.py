"""Fields that are continuous and not smooth, or jump in the state: in the state, in time, tables."""

import math

import numpy as np
from scipy.interpolate import CubicSpline

from problems import Hamiltonian, VectorField

from .general import _forward
from .references import dop853, exact, forced_oscillator, piecewise_oscillator, primitive
from .shape import Shape

GROUP = "kinked"
GRAZING = "kinked, a contact between two nodes"


def _shape(name, f, dim, parameters, span, member, reference, draws=8, group=GROUP):
    return Shape(
        group, name, VectorField(f, dim=dim, parameters=parameters, name=name), span, member, reference, draws
    )


def _valley(times, case):
    """Return q and p of H = p^2/2 + g |q| from rest: parabolas, four to a period."""
    g, height = case.par.g, case.y0[0]
    quarter = math.sqrt(2.0 * height / g)
    s = (times - case.t0) % (4.0 * quarter)
    below = np.abs(s - 2.0 * quarter) < quarter
    up = np.where(below, s - 2.0 * quarter, np.where(s < 2.0 * quarter, s, s - 4.0 * quarter))
    sign = np.where(below, -1.0, 1.0)
    return sign * (height - g * up * up / 2.0), -sign * g * up


def _bilinear(times, case):
    c = case.par.c
    return piecewise_oscillator(times, case.t0, case.y0, [0.0], [1.0 + c, 1.0 - c], [0.0, 0.0])


def _contact(times, case):
    par = case.par
    return piecewise_oscillator(
        times, case.t0, case.y0, [par.gap], [1.0, 1.0 + par.k], [0.0, par.k * par.gap]
    )


def _relay(times, case):
    par = case.par
    return piecewise_oscillator(times, case.t0, case.y0, [par.c], [1.0, 1.0], [-par.force, par.force])


def _overlap(power):
    def f(t, y, par, m):
        over = m.where(y[0] > par.gap, y[0] - par.gap, 0)
        return [y[1], -y[0] - par.k * over**power]

    return f


def _soft(rng, *_):
    return [rng.uniform(0.5, 1.5), 0.0], {"gap": rng.uniform(-0.4, 0.4), "k": rng.uniform(0.5, 20.0)}


def _in_time(t, y, par, m):
    since = t - par.c
    size = m.abs(since)
    return [y[1], -(par.w**2) * y[0] + par.a * size + par.b * size * since + par.d * size**3]


def _in_time_exact(times, case):
    par = case.par

    def force(t):
        since = t - par.c
        size = np.abs(since)
        return par.a * size + par.b * size * since + par.d * size**3

    return forced_oscillator(times, case.t0, case.y0, par.w, force, [par.c])


def _weak(rng, t0, t_end):
    strength = np.zeros(3)
    strength[rng.integers(3)] = rng.uniform(-1.0, 1.0)
    a, b, d = strength
    return rng.uniform(-1.0, 1.0, 2), {
        "a": a, "b": b, "d": d, "w": rng.uniform(0.5, 2.0), "c": t0 + (t_end - t0) * rng.uniform(0.05, 0.95),
    }  # fmt: skip


def _sawtooth(times, case):
    def until(t):
        turns, phase = np.divmod(case.par.w * t, math.pi)
        return (2.0 * turns + 1.0 - np.cos(phase)) / case.par.w

    return (case.y0[0] + until(times) - until(case.t0),)


RNG = np.random.default_rng(20)
KNOTS = np.concatenate([[0.0], np.cumsum(RNG.uniform(0.3, 3.0, 14))])
LOADS = RNG.normal(size=15)
SPRING_AT = np.array([-4.0, -2.2, -1.5, -0.8, 0.1, 0.6, 1.7, 2.5, 4.0])
SPRING = SPRING_AT**2 / 2.0 + RNG.uniform(-0.2, 0.2, SPRING_AT.size)
LOAD = CubicSpline(KNOTS, LOADS)
FORCE = CubicSpline(SPRING_AT, SPRING).derivative()


def _measured(times, case):
    par = case.par
    knots = (KNOTS - par.b) / par.a
    return forced_oscillator(
        times, case.t0, case.y0, 1.0, lambda t: LOAD(par.a * t + par.b), [float(t) for t in knots]
    )


def _measured_rate(times, case):
    par = case.par
    rate = primitive(lambda t: LOAD(t), case.t0, times, [float(t) for t in KNOTS])
    return (case.y0[0] * np.exp(par.a * rate),)


SHAPES = [
    Shape(
        GROUP,
        "valley",
        Hamiltonian(
            lambda q, p, par, m: p[0] ** 2 / 2 + par.g * m.abs(q[0]),
            dof=1,
            parameters={"g": 1.0},
            name="valley",
        ),
        _forward(4.0, 20.0),
        lambda rng, *_: ([rng.uniform(0.3, 3.0), 0.0], {"g": rng.uniform(0.3, 3.0)}),
        exact(_valley),
    ),
    _shape(
        "bilinear",
        lambda y, par, m: [y[1], -y[0] + par.c * m.abs(y[0])],
        2,
        {"c": 0.5},
        _forward(5.0, 30.0),
        lambda rng, *_: (rng.uniform(-1.0, 1.0, 2), {"c": rng.choice([0.9, 0.5, 0.1, 0.01])}),
        exact(_bilinear),
    ),
    _shape(
        "contact",
        lambda y, par, m: [y[1], -y[0] - m.where(y[0] > par.gap, par.k * (y[0] - par.gap), 0)],
        2,
        {"gap": 0.0, "k": 1.0},
        _forward(5.0, 30.0),
        lambda rng, *_: (
            [rng.uniform(0.5, 1.5), 0.0],
            {"gap": rng.uniform(-0.4, 0.4), "k": 10.0 ** rng.uniform(-1.0, 3.0)},
        ),
        exact(_contact),
        12,
    ),
    _shape(
        "graze",
        lambda y, par, m: [y[1], -y[0] - m.where(y[0] > par.gap, par.k * (y[0] - par.gap), 0)],
        2,
        {"gap": 0.0, "k": 1.0},
        _forward(5.0, 30.0),
        lambda rng, *_: (
            [-1.0, 0.0],
            {"gap": 1.0 - 10.0 ** rng.uniform(-4.0, -1.0), "k": 10.0 ** rng.uniform(0.0, 4.0)},
        ),
        exact(_contact),
        10,
        GRAZING,
    ),
    _shape(
        "relay",
        lambda y, par, m: [y[1], -y[0] + m.where(y[0] > par.c, par.force, -par.force)],
        2,
        {"c": 0.0, "force": 0.5},
        _forward(4.0, 15.0),
        lambda rng, *_: (
            [rng.uniform(0.8, 2.0), 0.0],
            {"c": rng.uniform(-0.5, 0.5), "force": rng.uniform(-0.3, -0.01)},
        ),
        exact(_relay),
    ),
    _shape(
        "soft_contact_2",
        _overlap(2),
        2,
        {"gap": 0.0, "k": 1.0},
        _forward(5.0, 20.0),
        _soft,
        dop853(_overlap(2)),
    ),
    _shape(
        "soft_contact_3",
        _overlap(3),
        2,
        {"gap": 0.0, "k": 1.0},
        _forward(5.0, 20.0),
        _soft,
        dop853(_overlap(3)),
    ),
    _shape(
        "kink_in_time",
        _in_time,
        2,
        {"a": 1.0, "b": 0.0, "d": 0.0, "w": 1.0, "c": 3.0},
        _forward(5.0, 20.0),
        _weak,
        exact(_in_time_exact),
        15,
    ),
    _shape(
        "sawtooth",
        lambda t, par, m: [m.abs(m.sin(par.w * t))],
        1,
        {"w": 1.0},
        _forward(5.0, 30.0),
        lambda rng, *_: ([rng.uniform(0.0, 1.0)], {"w": rng.uniform(0.3, 3.0)}),
        exact(_sawtooth),
    ),
    _shape(
        "table_of_time",
        lambda t, y, par, m: [y[1], -y[0] + m.table(par.a * t + par.b, KNOTS, LOADS)],
        2,
        {"a": 1.0, "b": 0.0},
        lambda rng: (0.0, rng.uniform(5.0, 20.0)),
        lambda rng, *_: (rng.uniform(-1.0, 1.0, 2), {"a": rng.uniform(0.3, 1.0), "b": rng.uniform(0.0, 2.0)}),
        exact(_measured),
    ),
    _shape(
        "table_as_rate",
        lambda t, y, par, m: [par.a * y[0] * m.table(t, KNOTS, LOADS)],
        1,
        {"a": 1.0},
        lambda rng: (0.0, rng.uniform(5.0, 20.0)),
        lambda rng, *_: ([1.0], {"a": rng.uniform(-1.0, 1.0)}),
        exact(_measured_rate),
    ),
    Shape(
        GROUP,
        "table_of_position",
        Hamiltonian(
            lambda q, p, m: p[0] ** 2 / 2 + m.table(q[0], SPRING_AT, SPRING), dof=1, name="table_of_position"
        ),
        _forward(5.0, 20.0),
        lambda rng, *_: ([rng.uniform(1.0, 3.0), 0.0], {}),
        dop853(lambda t, y, par, m: [y[1], -float(FORCE(y[0]))]),
        5,
    ),
]
