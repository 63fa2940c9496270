"""Fields that are infinite, or have infinite derivatives, at the start."""

import numpy as np

from problems import VectorField

from .general import _forward
from .references import exact
from .shape import Shape

GROUP = "singular at the start"


def _shape(name, f, parameters, member, solution, draws=7, dim=1):
    system = VectorField(f, dim=dim, parameters=parameters, name=name)
    return Shape(GROUP, name, system, _forward(0.5, 4.0), member, exact(solution), draws)


def _log(t):
    return np.log(np.where(t > 0.0, t, 1.0))


def _start(rng, *_):
    return [rng.choice([0.0, 1.0])], {"a": rng.uniform(-2.0, 2.0)}


def _one(rng, *_):
    return [1.0], {"a": rng.uniform(-1.0, 1.0)}


SHAPES = [
    _shape(
        "log t",
        lambda t, par, m: [par.a * m.log(t)],
        {"a": 1.0},
        _start,
        lambda times, case: (case.y0[0] + case.par.a * times * (_log(times) - 1.0),),
    ),
    _shape(
        "1 / sqrt(t)",
        lambda t, par, m: [par.a * 0.5 / m.sqrt(t)],
        {"a": 1.0},
        _start,
        lambda times, case: (case.y0[0] + case.par.a * np.sqrt(times),),
    ),
    _shape(
        "t log t",
        lambda t, par, m: [par.a * t * m.log(t)],
        {"a": 1.0},
        _start,
        lambda times, case: (case.y0[0] + case.par.a * times**2 * (_log(times) / 2.0 - 0.25),),
    ),
    _shape(
        "t^(-1/3)",
        lambda t, par, m: [par.a * m.exp(-m.log(t) / 3)],
        {"a": 1.0},
        _start,
        lambda times, case: (case.y0[0] + 1.5 * case.par.a * times ** (2.0 / 3.0),),
    ),
    _shape(
        "sqrt(t)",
        lambda t, par, m: [par.a * m.sqrt(t)],
        {"a": 1.0},
        _start,
        lambda times, case: (case.y0[0] + case.par.a * times**1.5 / 1.5,),
    ),
    _shape(
        "y log t",
        lambda t, y, par, m: [par.a * y[0] * m.log(t)],
        {"a": 1.0},
        _one,
        lambda times, case: (np.exp(case.par.a * times * (_log(times) - 1.0)),),
    ),
    _shape(
        "turns by 1 / sqrt(t)",
        lambda t, y, par, m: [par.a * y[1] / m.sqrt(t), -par.a * y[0] / m.sqrt(t)],
        {"a": 1.0},
        lambda rng, *_: ([1.0, 0.0], {"a": rng.uniform(-3.0, 3.0)}),
        lambda times, case: (
            np.cos(2.0 * case.par.a * np.sqrt(times)),
            -np.sin(2.0 * case.par.a * np.sqrt(times)),
        ),
        dim=2,
    ),
]
