"""Units in which numbers are extreme: amplitudes from 1e-300 to 1e250, times from 1e-12 to 1e12."""

import math
from types import SimpleNamespace

import numpy as np

from problems import Hamiltonian, VectorField

from .pulsed import gauss
from .references import exact, forced_oscillator, piecewise_oscillator
from .shape import Shape
from .smooth import _duffing, kepler

GROUP = "extreme units"


def _span(rng):
    return 0.0, 10.0 ** rng.uniform(-12.0, 12.0) * rng.uniform(5.0, 30.0)


def _unit(t_end):
    return t_end / 15.0


def _shape(name, f, dim, parameters, member, solution, draws=8, span=_span):
    system = VectorField(f, dim=dim, parameters=parameters, name=name)
    return Shape(GROUP, name, system, span, member, exact(solution), draws)


def _amplitude(rng, low=-300.0, high=250.0):
    return 10.0 ** rng.uniform(low, high)


def _turning(rng, t0, t_end):
    size = _amplitude(rng)
    return [size * rng.uniform(0.5, 1.0), size * rng.uniform(-1.0, 1.0)], {"w": 1.0 / _unit(t_end)}


def _turned(times, case):
    angle = case.par.w * (times - case.t0)
    x, v = case.y0
    return x * np.cos(angle) + v * np.sin(angle), v * np.cos(angle) - x * np.sin(angle)


def _second_order(rng, t0, t_end):
    size, w = _amplitude(rng, -280.0, 230.0), 1.0 / _unit(t_end)
    return [size, 0.0], {"k": w * w}


def _mixed(times, case):
    par, s = case.par, times - case.t0
    x, v, y, u = case.y0
    c, d = np.cos(par.w * s), np.sin(par.w * s)
    e, f = np.cos(par.w * s / 3.0), np.sin(par.w * s / 3.0)
    return (
        x * c + v * par.ratio * d, v * c - x / par.ratio * d,
        y * e + u * f, u * e - y * f,
    )  # fmt: skip


def _of_mixed(rng, t0, t_end):
    ratio = 10.0 ** rng.uniform(-150.0, 150.0)
    first, second = 10.0 ** rng.uniform(-140.0, 90.0), _amplitude(rng)
    return [first, first / ratio, second, 0.0], {"w": 1.0 / _unit(t_end), "ratio": ratio}


def _struck(rng, t0, t_end):
    unit, size = _unit(t_end), _amplitude(rng, -250.0, 200.0)
    return [size * rng.choice([0.0, 1.0]), 0.0], {
        "k": 1.0 / unit**2, "c": rng.uniform(0.2, 0.8) * t_end, "width": rng.uniform(0.2, 2.0) * unit,
        "force": size * rng.uniform(0.1, 2.0) / unit**2,
    }  # fmt: skip


def _struck_exact(times, case):
    par = case.par
    return forced_oscillator(
        times, case.t0, case.y0, math.sqrt(par.k),
        lambda t: par.force * gauss((t - par.c) / par.width, np), [par.c], par.width,
    )  # fmt: skip


def _contact(rng, t0, t_end):
    size = _amplitude(rng, -250.0, 200.0)
    return [size, 0.0], {"k": 1.0 / _unit(t_end) ** 2, "gap": size * rng.uniform(-0.5, 0.5), "n": 30.0}


def _contact_exact(times, case):
    """Return the state, from the same motion in units of the amplitude and of the frequency."""
    par, size = case.par, case.y0[0]
    w, gap = math.sqrt(par.k), par.gap / size
    x, v = piecewise_oscillator(
        w * (times - case.t0), 0.0, np.array([1.0, 0.0]), [gap], [1.0, 1.0 + par.n], [0.0, par.n * gap]
    )
    return x * size, v * size * w


def _long_growth(rng, t0, t_end):
    return [_amplitude(rng, -290.0, -250.0)], {"r": rng.uniform(600.0, 1100.0) / t_end}


def _duffing_scaled(times, case):
    return _duffing(times, SimpleNamespace(par=case.par, y0=case.y0, t0=case.t0))


def _late(rng):
    start = rng.choice([1e6, 1e9, -1e9])
    return start, start + rng.uniform(10.0, 40.0)


SHAPES = [
    _shape("turning", lambda y, par: [par.w * y[1], -par.w * y[0]], 2, {"w": 1.0}, _turning, _turned, 16),
    _shape(
        "late",
        lambda y, par: [par.w * y[1], -par.w * y[0]],
        2,
        {"w": 1.0},
        lambda rng, *_: (rng.uniform(-1.0, 1.0, 2), {"w": rng.uniform(0.5, 3.0)}),
        _turned,
        6,
        _late,
    ),
    Shape(
        GROUP,
        "oscillator",
        Hamiltonian(
            lambda q, p, par: p[0] ** 2 / 2 + par.k * q[0] ** 2 / 2,
            dof=1,
            parameters={"k": 1.0},
            name="oscillator",
        ),
        lambda rng: (0.0, 10.0 ** rng.uniform(-12.0, 12.0) * rng.uniform(5.0, 30.0)),
        _second_order,
        exact(
            lambda times, case: (
                case.y0[0] * np.cos(math.sqrt(case.par.k) * times),
                -case.y0[0] * math.sqrt(case.par.k) * np.sin(math.sqrt(case.par.k) * times),
            )
        ),
        10,
    ),
    Shape(
        GROUP,
        "cubic force",
        Hamiltonian(
            lambda q, p, par: p[0] ** 2 / 2 + par.a * q[0] ** 2 / 2 + par.b * q[0] ** 4 / 4,
            dof=1,
            parameters={"a": 1.0, "b": 1.0},
            name="cubic force",
        ),
        _span,
        lambda rng, t0, t_end: (
            [(size := _amplitude(rng, -70.0, 70.0)), 0.0],
            {"a": 1.0 / _unit(t_end) ** 2, "b": rng.uniform(0.1, 2.0) / (size * _unit(t_end)) ** 2},
        ),
        exact(_duffing_scaled),
    ),
    Shape(
        GROUP,
        "two bodies",
        Hamiltonian(
            lambda q, p, par, m: (p[0] ** 2 + p[1] ** 2) / 2 - par.mu / m.sqrt(q[0] ** 2 + q[1] ** 2),
            dof=2,
            parameters={"mu": 1.0, "a": 1.0},
            name="two bodies",
        ),
        _span,
        lambda rng, t0, t_end: (
            [
                (a := _amplitude(rng, -80.0, 80.0)) * (1.0 - (e := rng.uniform(0.0, 0.8))),
                0.0,
                0.0,
                a / _unit(t_end) * math.sqrt((1.0 + e) / (1.0 - e)),
            ],
            {"mu": a * (a / _unit(t_end)) ** 2, "a": a},
        ),
        exact(
            lambda times, case: kepler(times, case.t0, case.par.mu, case.par.a, 1.0 - case.y0[0] / case.par.a)
        ),
        10,
    ),
    _shape(
        "mixed",
        lambda y, par: [
            par.w * par.ratio * y[1],
            -par.w / par.ratio * y[0],
            par.w / 3 * y[3],
            -par.w / 3 * y[2],
        ],
        4,
        {"w": 1.0, "ratio": 1.0},
        _of_mixed,
        _mixed,
        10,
    ),
    _shape(
        "struck",
        lambda t, y, par, m: [y[1], -par.k * y[0] + par.force * gauss((t - par.c) / par.width, m)],
        2,
        {"k": 1.0, "c": 5.0, "width": 1.0, "force": 1.0},
        _struck,
        _struck_exact,
        12,
    ),
    _shape(
        "contact in other units",
        lambda y, par, m: [
            y[1],
            -par.k * y[0] - m.where(y[0] > par.gap, par.n * par.k * (y[0] - par.gap), 0),
        ],
        2,
        {"k": 1.0, "gap": 0.0, "n": 30.0},
        _contact,
        _contact_exact,
    ),
    _shape(
        "long growth",
        lambda y, par: [par.r * y[0]],
        1,
        {"r": 1.0},
        _long_growth,
        # exp(r t) alone overflows
        lambda times, case: (np.exp(math.log(case.y0[0]) + case.par.r * times),),
        6,
    ),
    _shape(
        "long decay",
        lambda y, par: [-par.r * y[0]],
        1,
        {"r": 1.0},
        lambda rng, t0, t_end: ([_amplitude(rng)], {"r": rng.uniform(20.0, 200.0) / t_end}),
        lambda times, case: (case.y0[0] * np.exp(-case.par.r * times),),
        6,
    ),
]
