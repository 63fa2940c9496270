"""Smooth systems without an energy: growth, damping, driving, limit cycles."""

import math

import numpy as np

from problems import VectorField

from .references import exact, heyoka
from .shape import Shape
from .smooth import span

GROUP = "smooth general"


def _shape(name, f, dim, parameters, span, member, reference=heyoka):
    return Shape(
        GROUP, name, VectorField(f, dim=dim, parameters=parameters, name=name), span, member, reference, 7
    )


def _driven(times, case):
    par, s = case.par, times - case.t0
    # The particular solution X exp(i v t), and what is left of the start: damped oscillations.
    x = par.force / (par.w**2 - par.v**2 + 2j * par.g * par.v)
    now = x * np.exp(1j * par.v * times)
    first = x * np.exp(1j * par.v * case.t0)
    a, b = case.y0[0] - first.real, case.y0[1] - (1j * par.v * first).real
    w = math.sqrt(par.w**2 - par.g**2)
    fall, c, d = np.exp(-par.g * s), np.cos(w * s), np.sin(w * s)
    free = fall * (a * c + (b + par.g * a) / w * d)
    speed = fall * (b * c - (par.w**2 * a + par.g * b) / w * d)
    return now.real + free, (1j * par.v * now).real + speed


def _rotor(times, case):
    par, s = case.par, times - case.t0
    r0, angle = np.hypot(*case.y0), math.atan2(case.y0[1], case.y0[0])
    r = 1.0 / np.sqrt(1.0 + (1.0 / r0**2 - 1.0) * np.exp(-2.0 * s))
    turn = angle + par.w * s + par.c / par.v * (np.sin(par.v * times) - math.sin(par.v * case.t0))
    return r * np.cos(turn), r * np.sin(turn)


def _logistic(times, case):
    par, y0 = case.par, case.y0[0]
    return (par.size / (1.0 + (par.size / y0 - 1.0) * np.exp(-par.r * (times - case.t0))),)


def _numbers(**ranges):
    def drawn(rng):
        return {name: float(rng.uniform(*ends)) for name, ends in ranges.items()}

    return drawn


_OF_DRIVEN = _numbers(w=(0.8, 3.0), g=(0.0, 0.3), force=(-2.0, 2.0), v=(0.1, 5.0))
_OF_ROTOR = _numbers(w=(0.0, 3.0), c=(-2.0, 2.0), v=(0.2, 3.0))
_OF_LOTKA = _numbers(a=(0.5, 1.5), b=(0.5, 1.5))
_OF_EULER = _numbers(a=(-1.0, -0.2), b=(0.1, 0.6))


def _forward(shortest, longest):
    return lambda rng: (0.0, rng.uniform(shortest, longest))


SHAPES = [
    _shape(
        "logistic",
        lambda y, par: [par.r * y[0] * (1 - y[0] / par.size)],
        1,
        {"r": 1.0, "size": 1.0},
        _forward(5.0, 40.0),
        lambda rng, *_: ([10.0 ** rng.uniform(-8.0, 0.5)], {"r": rng.uniform(0.5, 2.0), "size": 1.0}),
        exact(_logistic),
    ),
    _shape(
        "driven",
        lambda t, y, par, m: [y[1], -(par.w**2) * y[0] - 2 * par.g * y[1] + par.force * m.cos(par.v * t)],
        2,
        {"w": 1.0, "g": 0.1, "force": 1.0, "v": 2.0},
        span(10.0, 40.0),
        lambda rng, *_: (rng.uniform(-1.0, 1.0, 2), _OF_DRIVEN(rng)),
        exact(_driven),
    ),
    _shape(
        "rotor",
        lambda t, y, par, m: [
            y[0] * (r := 1 - y[0] ** 2 - y[1] ** 2) - y[1] * (w := par.w + par.c * m.cos(par.v * t)),
            y[1] * r + y[0] * w,
        ],
        2,
        {"w": 1.0, "c": 1.0, "v": 1.0},
        _forward(5.0, 40.0),
        lambda rng, *_: (rng.uniform(0.2, 1.5, 2), _OF_ROTOR(rng)),
        exact(_rotor),
    ),
    _shape(
        "swell",
        lambda t, y, par, m: [par.a * y[0] * m.cos(par.b * t)],
        1,
        {"a": 1.0, "b": 1.0},
        span(5.0, 40.0),
        lambda rng, *_: ([rng.uniform(0.5, 2.0)], {"a": rng.uniform(-3.0, 3.0), "b": rng.uniform(0.3, 3.0)}),
        exact(
            lambda times, case: (
                case.y0[0]
                * np.exp(
                    case.par.a / case.par.b * (np.sin(case.par.b * times) - math.sin(case.par.b * case.t0))
                ),
            )
        ),
    ),
    _shape(
        "pole",
        lambda y, par: [par.a * (1 + y[0] ** 2)],
        1,
        {"a": 1.0},
        lambda rng: (0.0, rng.uniform(1.0, 1.4)),
        lambda rng, *_: ([0.0], {"a": rng.uniform(0.7, 1.05)}),
        exact(lambda times, case: (np.tan(case.par.a * times),)),
    ),
    _shape(
        "lotka_volterra",
        lambda y, par: [y[0] * (par.a - y[1]), y[1] * (y[0] - par.b)],
        2,
        {"a": 1.0, "b": 1.0},
        _forward(5.0, 30.0),
        lambda rng, *_: (rng.uniform(0.3, 2.0, 2), _OF_LOTKA(rng)),
    ),
    _shape(
        "van_der_pol",
        lambda y, par: [y[1], par.mu * (1 - y[0] ** 2) * y[1] - y[0]],
        2,
        {"mu": 1.0},
        _forward(5.0, 20.0),
        lambda rng, *_: (rng.uniform(-2.0, 2.0, 2), {"mu": rng.uniform(0.1, 5.0)}),
    ),
    _shape(
        "rigid_body",
        lambda y, par: [y[1] * y[2], par.a * y[0] * y[2], -par.b * y[0] * y[1]],
        3,
        {"a": -1.0, "b": 0.5},
        span(5.0, 40.0),
        lambda rng, *_: (rng.uniform(0.2, 1.5, 3), _OF_EULER(rng)),
    ),
    _shape(
        "lorenz",
        lambda y, par: [10 * (y[1] - y[0]), y[0] * (par.r - y[2]) - y[1], y[0] * y[1] - 8 * y[2] / 3],
        3,
        {"r": 28.0},
        _forward(1.0, 8.0),
        lambda rng, *_: (rng.uniform(-5.0, 5.0, 3) + 1.0, {"r": rng.uniform(5.0, 30.0)}),
    ),
    _shape(
        "mathieu",
        lambda t, y, par, m: [y[1], -(par.a + par.b * m.cos(2 * t)) * y[0]],
        2,
        {"a": 1.0, "b": 0.5},
        span(10.0, 30.0),
        lambda rng, *_: (rng.uniform(-1.0, 1.0, 2), {"a": rng.uniform(0.5, 9.0), "b": rng.uniform(0.0, 1.0)}),
    ),
]
