"""Systems that start later: powers of the time, switches, pulses; all components at rest, or some."""

import math

import numpy as np
from scipy.special import erf

from problems import VectorField

from .general import _forward
from .pulsed import PARAMETERS, STAIRCASE, gauss, long_span, pulse
from .references import exact, forced_oscillator, primitive
from .shape import Shape

GROUP = "at rest"


def _shape(name, f, dim, parameters, span, member, reference, draws=8, group=GROUP):
    return Shape(
        group, name, VectorField(f, dim=dim, parameters=parameters, name=name), span, member, reference, draws
    )


def _power(n):
    return _shape(
        f"power {n}", lambda t, par: [par.a * n * t ** (n - 1)], 1, {"a": 1.0}, _forward(0.5, 3.0),
        lambda rng, *_: ([0.0], {"a": rng.uniform(-2.0, 2.0)}),
        exact(lambda times, case: (case.par.a * times**n,)), 6,
    )  # fmt: skip


def _switched(times, case):
    """Return y of y' = -k y + force (tanh(s (t - c)) + 1)."""
    par = case.par

    def rate(t):
        return np.exp(par.k * (t - case.t0)) * par.force * (np.tanh(par.s * (t - par.c)) + 1.0)

    inside = primitive(rate, case.t0, times, [par.c], 1.0 / par.s)
    return (np.exp(-par.k * (times - case.t0)) * (case.y0[0] + inside),)


def _exponential(times, case):
    par = case.par
    return ((np.exp(par.s * (times - par.c)) - math.exp(par.s * (case.t0 - par.c))) / par.s,)


def _partly(t, y, par, m):
    return [y[1], -y[0], y[3], -par.w * par.w * y[2] + par.force * gauss((t - par.c) / par.width, m)]


def _partly_exact(times, case):
    par, s = case.par, times - case.t0
    a, b = case.y0[:2]
    moved = forced_oscillator(
        times, case.t0, case.y0[2:], par.w,
        lambda t: par.force * gauss((t - par.c) / par.width, np), [par.c], par.width,
    )  # fmt: skip
    return a * np.cos(s) + b * np.sin(s), b * np.cos(s) - a * np.sin(s), *moved


def _collected(times, case):
    """Return y of a decaying y[0] and of y[1]' = y[0] gauss."""
    par, a = case.par, case.y0[0]
    since, start = (times - par.c) / par.width, (case.t0 - par.c) / par.width
    # exp(-k t) gauss is a gauss about another place.
    shift = par.k * par.width / 2.0
    scale = (
        a
        * par.force
        * math.exp(par.k * (case.t0 - par.c) + shift * shift)
        * par.width
        * math.sqrt(math.pi)
        / 2
    )
    return a * np.exp(-par.k * (times - case.t0)), scale * (erf(since + shift) - erf(start + shift))


def _settled(times, case):
    par = case.par
    x, v = forced_oscillator(
        times, case.t0, case.y0 - [par.place, 0.0], 1.0,
        lambda t: par.force * gauss((t - par.c) / par.width, np), [par.c], par.width,
    )  # fmt: skip
    return x + par.place, v


def _switch(rng, t0, t_end):
    return [0.0], {
        "k": rng.uniform(0.2, 1.5), "force": rng.uniform(-2.0, 2.0), "s": 10.0 ** rng.uniform(-0.3, 1.0),
        "c": t0 + (t_end - t0) * rng.uniform(0.2, 0.8),
    }  # fmt: skip


def _place(rng, t0, t_end):
    place = rng.choice([1.0, -1e3, 1e-6])
    drawn = pulse(rng, t0, t_end)
    return [place, 0.0], {**drawn, "force": drawn["force"] * abs(place), "place": place}


SHAPES = [
    *(_power(n) for n in (1.5, 2, 4, 8, 21)),
    _shape(
        "square root of y",
        lambda y, par, m: [par.a * m.sqrt(m.abs(y[0]) + par.b)],
        1,
        {"a": 1.0, "b": 1.0},
        _forward(1.0, 5.0),
        lambda rng, *_: ([0.0], {"a": rng.uniform(0.5, 2.0), "b": 10.0 ** rng.uniform(-3.0, 0.0)}),
        exact(
            lambda times, case: (
                (case.par.a * times / 2.0) ** 2 + case.par.a * math.sqrt(case.par.b) * times,
            )
        ),
    ),
    _shape(
        "tanh switch",
        lambda t, y, par, m: [-par.k * y[0] + par.force * (m.tanh(par.s * (t - par.c)) + 1)],
        1,
        {"k": 1.0, "force": 1.0, "s": 4.0, "c": 5.0},
        long_span,
        _switch,
        exact(_switched),
        12,
        STAIRCASE,
    ),
    _shape(
        "pulse from 0",
        lambda t, par, m: [par.force * gauss((t - par.c) / par.width, m)],
        1,
        PARAMETERS,
        long_span,
        lambda rng, *span: ([0.0], pulse(rng, *span)),
        exact(
            lambda times, case: (
                case.par.force
                * case.par.width
                * math.sqrt(math.pi)
                / 2.0
                * (erf((times - case.par.c) / case.par.width) - erf((case.t0 - case.par.c) / case.par.width)),
            )
        ),
        12,
    ),
    _shape(
        "exponential",
        lambda t, par, m: [m.exp(par.s * (t - par.c))],
        1,
        {"s": 1.0, "c": 20.0},
        _forward(5.0, 30.0),
        lambda rng, t0, t_end: ([0.0], {"s": rng.uniform(0.5, 3.0), "c": rng.uniform(0.0, t_end)}),
        exact(_exponential),
    ),
    _shape(
        "some at rest",
        _partly,
        4,
        {**PARAMETERS, "w": 1.0},
        long_span,
        lambda rng, *span: (
            [*rng.uniform(-1.0, 1.0, 2), 0.0, 0.0],
            {**pulse(rng, *span), "w": rng.uniform(0.3, 2.0)},
        ),
        exact(_partly_exact),
        12,
    ),
    _shape(
        "collected",
        lambda t, y, par, m: [-par.k * y[0], par.force * y[0] * gauss((t - par.c) / par.width, m)],
        2,
        {**PARAMETERS, "k": 0.1},
        long_span,
        lambda rng, *span: ([1.0, 0.0], {**pulse(rng, *span), "k": rng.uniform(0.01, 0.3)}),
        exact(_collected),
    ),
    _shape(
        "at rest elsewhere",
        lambda t, y, par, m: [y[1], -(y[0] - par.place) + par.force * gauss((t - par.c) / par.width, m)],
        2,
        {**PARAMETERS, "place": 1.0},
        long_span,
        _place,
        exact(_settled),
        9,
    ),
]
