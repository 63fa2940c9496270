"""Oscillators and rates that are struck by a pulse, at rest and in motion."""

import math

import numpy as np
from scipy.special import erf

from problems import VectorField

from .references import dop853, exact, forced_oscillator
from .shape import Shape

GROUP = "pulsed"
STAIRCASE = "at rest on a staircase of rounding"  # a difference of tanh is 0, 1.1e-16, 2.2e-16, ...
NARROW = "pulsed, narrower than the nodes"

WIDTH = 0.1, 2.0  # of pulses that the methods are to see
NARROW_WIDTH = 1e-4, 0.02


def gauss(x, m):
    return m.exp(-x * x)


def sech2(x, m):
    return 1 / m.cosh(x) ** 2


def lorentz(x, m):
    return 1 / (1 + x * x) ** 2


def doublet(x, m):
    return x * m.exp(-x * x)


def packet(x, m):
    return m.exp(-x * x / 4) * m.cos(3 * x)


def plateau(x, m):
    return m.tanh(x + 3) - m.tanh(x - 3)


def long_span(rng):
    return 0.0, rng.uniform(12.0, 60.0)


def pulse(rng, t0, t_end, width=WIDTH):
    """Draw where a pulse is, how wide and how strong."""
    w = math.exp(rng.uniform(*np.log(width)))
    return {
        "c": t0 + (t_end - t0) * rng.uniform(0.15, 0.9), "width": w,
        "force": rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-2.0, 1.0) / w,
    }  # fmt: skip


def _struck(profile, rest, width=WIDTH):
    def f(t, y, par, m):
        return [y[1], -(par.w**2) * y[0] + par.force * profile((t - par.c) / par.width, m)]

    def member(rng, t0, t_end):
        y0 = np.zeros(2) if rest else rng.uniform(-1.0, 1.0, 2)
        return y0, {**pulse(rng, t0, t_end, width), "w": rng.uniform(0.3, 2.0)}

    def solution(times, case):
        par = case.par
        return forced_oscillator(
            times, case.t0, case.y0, par.w,
            lambda t: par.force * profile((t - par.c) / par.width, np), [par.c], par.width,
        )  # fmt: skip

    return f, member, exact(solution)


def _oscillator(profile, rest, width=WIDTH, group=GROUP):
    f, member, reference = _struck(profile, rest, width)
    name = f"{profile.__name__}, {'at rest' if rest else 'in motion'}{' narrow' if group == NARROW else ''}"
    system = VectorField(f, dim=2, parameters={"c": 5.0, "width": 1.0, "force": 1.0, "w": 1.0}, name=name)
    return Shape(group, name, system, long_span, member, reference, 6)


def _growth(times, case):
    par = case.par
    since, start = (times - par.c) / par.width, (case.t0 - par.c) / par.width
    return (case.y0[0] * np.exp(par.force * par.width * (np.tanh(since) - math.tanh(start))),)


def _area(times, case):
    par = case.par
    since, start = (times - par.c) / par.width, (case.t0 - par.c) / par.width
    return (case.y0[0] + par.force * par.width * math.sqrt(math.pi) / 2.0 * (erf(since) - erf(start)),)


def _in_motion(rng, t0, t_end):
    drawn = pulse(rng, t0, t_end)
    return [1.0], {**drawn, "force": rng.uniform(-1.0, 1.0) / drawn["width"]}


def _two(t, y, par, m):
    return [y[1], -y[0] + gauss((t - par.c) / par.width, m) + par.force * gauss((t - par.d) / par.width, m)]


def _two_exact(times, case):
    par = case.par
    return forced_oscillator(
        times, case.t0, case.y0, 1.0,
        lambda t: gauss((t - par.c) / par.width, np) + par.force * gauss((t - par.d) / par.width, np),
        [par.c, par.d], par.width,
    )  # fmt: skip


def _hanging(t, y, par, m):
    return [y[1], -m.sin(y[0]) - 0.1 * y[1] + par.force * gauss((t - par.c) / par.width, m)]


PARAMETERS = {"c": 5.0, "width": 1.0, "force": 1.0}


def _field(group, name, f, dim, parameters, member, reference, draws=8):
    system = VectorField(f, dim=dim, parameters=parameters, name=name)
    return Shape(group, name, system, long_span, member, reference, draws)


SHAPES = [
    *(
        _oscillator(profile, rest, group=STAIRCASE if profile is plateau and rest else GROUP)
        for profile in (gauss, sech2, lorentz, doublet, packet, plateau)
        for rest in (True, False)
    ),
    _field(
        GROUP,
        "growth in a pulse",
        lambda t, y, par, m: [par.force * y[0] * sech2((t - par.c) / par.width, m)],
        1,
        PARAMETERS,
        _in_motion,
        exact(_growth),
    ),
    _field(
        GROUP,
        "pulse from 1",
        lambda t, par, m: [par.force * gauss((t - par.c) / par.width, m)],
        1,
        PARAMETERS,
        lambda rng, *span: ([1.0], pulse(rng, *span)),
        exact(_area),
    ),
    _field(
        GROUP,
        "two pulses",
        _two,
        2,
        {**PARAMETERS, "d": 8.0},
        lambda rng, t0, t_end: (
            [0.0, 0.0],
            {**(drawn := pulse(rng, t0, t_end)), "d": drawn["c"] + rng.uniform(5.0, 20.0)},
        ),
        exact(_two_exact),
    ),
    _field(
        GROUP,
        "hanging pendulum",
        _hanging,
        2,
        PARAMETERS,
        lambda rng, t0, t_end: (
            [0.0, 0.0],
            {**(drawn := pulse(rng, t0, t_end)), "force": rng.uniform(-1.0, 1.0) / drawn["width"]},
        ),
        dop853(_hanging, lambda case: [case.par.c + x * case.par.width for x in (-8, -3, 0, 3, 8)]),
        5,
    ),
    *(_oscillator(gauss, rest, NARROW_WIDTH, NARROW) for rest in (True, False)),
]
