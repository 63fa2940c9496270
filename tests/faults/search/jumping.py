"""Fields that jump at a time: literal, a parameter's, affine, not solvable, in a Python function."""

import math

import numpy as np
from scipy.optimize import brentq

from problems import Opaque, VectorField

from .general import _forward
from .references import dry_friction, exact, forced_oscillator
from .shape import Shape

GROUP = "jumping"
LITERALS = (2.0, math.pi, 4.7123)


def relaxed(times, t0, y0, switches, levels):
    """Return y of y' = -y + levels[i] between switches i - 1 and i."""
    edges = np.concatenate([[t0], [t for t in switches if t > t0], [math.inf]])
    values = np.empty_like(times)
    y = y0
    first = len(levels) - (len(edges) - 1)
    for i in range(len(edges) - 1):
        level = levels[first + i]
        mine = (times >= edges[i]) & (times <= edges[i + 1])
        values[mine] = level + (y - level) * np.exp(-(times[mine] - edges[i]))
        y = level + (y - level) * math.exp(-(edges[i + 1] - edges[i]))
    return (values,)


def _at(c):
    return lambda times, case: relaxed(times, case.t0, case.y0[0], [c(case.par)], [-1.0, 1.0])


def _shape(name, f, dim, parameters, member, reference, draws=10, span=None):
    system = VectorField(f, dim=dim, parameters=parameters, name=name)
    return Shape(GROUP, name, system, span or _forward(5.0, 12.0), member, reference, draws)


def _relaxing(name, condition, parameters, member, c, draws=10):
    def f(t, y, par, m):
        return [-y[0] + m.where(condition(t, par, m), 1, -1)]

    return _shape(name, f, 1, parameters, member, exact(_at(c)), draws)


def _literal(c):
    return _relaxing(
        f"literal {c:.3g}", lambda t, par, m: t > c, {}, lambda rng, *_: ([rng.uniform(-1.0, 2.0)], {}),
        lambda par: c, 5,
    )  # fmt: skip


def _time(rng, t0, t_end):
    return [rng.uniform(-1.0, 2.0)], {"c": rng.uniform(0.02, 0.98) * t_end}


def _affine(rng, t0, t_end):
    a = rng.uniform(0.2, 5.0)
    return [rng.uniform(-1.0, 2.0)], {"a": a, "b": -a * rng.uniform(0.02, 0.98) * t_end}


def _square_wave(times, case):
    par = case.par
    level = math.asin(par.s)
    turns = np.arange(-1, math.ceil(times.max() * par.w / (2.0 * math.pi)) + 1) * 2.0 * math.pi
    switches = np.sort(np.concatenate([level + turns, math.pi - level + turns])) / par.w
    ahead = switches[switches > case.t0]
    up = [1.0, -1.0]  # after a rise comes 1; the first of all switches is one
    levels = [-1.0, *(up[i % 2] for i in range(switches.size))]
    return relaxed(times, case.t0, case.y0[0], ahead, levels[switches.size - ahead.size :])


def _window(times, case):
    par = case.par
    return forced_oscillator(
        times, case.t0, case.y0, 1.0, lambda t: par.force * ((t > par.c) & (t < par.d)), [par.c, par.d]
    )


def _sign(times, case):
    par = case.par
    return forced_oscillator(times, case.t0, case.y0, 1.0, lambda t: par.force * np.sign(t - par.c), [par.c])


def _spring(times, case):
    """Return the state of x'' = -k x whose k jumps at c."""
    par = case.par

    def free(s, state, w):
        x, v = state
        return x * np.cos(w * s) + v / w * np.sin(w * s), v * np.cos(w * s) - w * x * np.sin(w * s)

    before = free(times - case.t0, case.y0, par.a)
    after = free(times - par.c, free(par.c - case.t0, case.y0, par.a), par.b)
    return tuple(np.where(times <= par.c, one, other) for one, other in zip(before, after, strict=True))


def _python(t, y, par):
    return [-y[0] + (1.0 if t > par[0] else -1.0)]


def _python_window(t, y, par):
    return [y[1], -y[0] + (par[2] if par[0] < t < par[1] else 0.0)]


def _of_window(rng, t0, t_end):
    c, d = np.sort(rng.uniform(0.05, 0.95, 2)) * t_end
    return rng.uniform(-1.0, 1.0, 2), {"c": c, "d": max(d, c + 0.5), "force": rng.uniform(-3.0, 3.0)}


def _of_friction(rng, t0, t_end):
    """Return a start from which it takes five turns at least to come to rest."""
    y0 = rng.uniform(-2.0, 2.0, 2)
    return y0, {"mu": rng.uniform(0.001, 0.09) * np.hypot(*y0)}


def _foreign(name, f, dim, parameters, member, reference):
    system = Opaque(f, dim=dim, parameters=parameters, name=name)
    return Shape(GROUP, name, system, _forward(5.0, 12.0), member, reference, 8)


SHAPES = [
    *(_literal(c) for c in LITERALS),
    _relaxing("t > par.c", lambda t, par, m: t > par.c, {"c": 3.0}, _time, lambda par: par.c, 25),
    _relaxing("2 t > 2 par.c", lambda t, par, m: 2 * t > 2 * par.c, {"c": 3.0}, _time, lambda par: par.c),
    _relaxing("c - t < 0", lambda t, par, m: par.c - t < 0, {"c": 3.0}, _time, lambda par: par.c),
    _relaxing(
        "a t + b >= 0",
        lambda t, par, m: par.a * t + par.b >= 0,
        {"a": 1.0, "b": -3.0},
        _affine,
        lambda par: -par.b / par.a,
    ),
    _relaxing("t^2 > c", lambda t, par, m: t * t > par.c * par.c, {"c": 3.0}, _time, lambda par: par.c, 15),
    _relaxing(
        "t - 0.3 sin t > c",
        lambda t, par, m: t - 0.3 * m.sin(t) > par.c,
        {"c": 3.0},
        _time,
        lambda par: brentq(lambda t: t - 0.3 * math.sin(t) - par.c, par.c - 1.0, par.c + 1.0, xtol=1e-15),
        15,
    ),
    _shape(
        "square wave",
        lambda t, y, par, m: [-y[0] + m.where(m.sin(par.w * t) > par.s, 1, -1)],
        1,
        {"w": 1.0, "s": 0.0},
        lambda rng, *_: ([rng.uniform(-1.0, 2.0)], {"w": rng.uniform(0.5, 2.0), "s": rng.uniform(-0.7, 0.7)}),
        exact(_square_wave),
    ),
    _shape(
        "window",
        lambda t, y, par, m: [y[1], -y[0] + m.where((t > par.c) & (t < par.d), par.force, 0)],
        2,
        {"c": 2.0, "d": 3.0, "force": 1.0},
        _of_window,
        exact(_window),
    ),
    _shape(
        "sign by abs",
        lambda t, y, par, m: [y[1], -y[0] + par.force * (t - par.c) / m.abs(t - par.c)],
        2,
        {"c": 2.0, "force": 1.0},
        lambda rng, t0, t_end: (
            rng.uniform(-1.0, 1.0, 2),
            {"c": rng.uniform(0.05, 0.95) * t_end, "force": rng.uniform(-2.0, 2.0)},
        ),
        exact(_sign),
    ),
    _shape(
        "spring that stiffens",
        lambda t, y, par, m: [y[1], -y[0] * m.where(t > par.c, par.b, par.a) ** 2],
        2,
        {"a": 1.0, "b": 2.0, "c": 3.0},
        lambda rng, t0, t_end: (
            rng.uniform(-1.0, 1.0, 2),
            {"a": rng.uniform(0.5, 1.5), "b": rng.uniform(0.5, 3.0), "c": rng.uniform(0.05, 0.95) * t_end},
        ),
        exact(_spring),
    ),
    _shape(
        "dry friction",
        lambda y, par, m: [y[1], -y[0] - par.mu * m.where(y[1] > 0, 1, -1)],
        2,
        {"mu": 0.1},
        _of_friction,
        exact(lambda times, case: dry_friction(times, case.t0, case.y0, case.par.mu)[:2]),
        25,
    ),
    _shape(
        "dry friction by abs",
        lambda y, par, m: [y[1], -y[0] - par.mu * y[1] / m.abs(y[1])],
        2,
        {"mu": 0.1},
        _of_friction,
        exact(lambda times, case: dry_friction(times, case.t0, case.y0, case.par.mu)[:2]),
    ),
    _foreign(
        "Python, t > c",
        _python,
        1,
        {"c": 3.0},
        _time,
        exact(_at(lambda par: par.c)),
    ),
    _foreign(
        "Python, window",
        _python_window,
        2,
        {"c": 2.0, "d": 3.0, "force": 1.0},
        _of_window,
        exact(_window),
    ),
]
