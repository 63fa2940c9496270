"""Smooth Hamiltonian systems: polynomial, trigonometric, exponential, bodies that attract each other."""

import math

import numpy as np
from scipy.special import ellipj

from problems import Hamiltonian

from .references import exact, heyoka
from .shape import Shape

GROUP = "smooth Hamiltonian"


def span(shortest, longest, t0=True):
    """Return what draws a span, half of them backwards, from a time that need not be 0."""

    def drawn(rng):
        start = float(rng.choice([0.0, -3.0, 1000.0])) if t0 else 0.0
        length = rng.uniform(shortest, longest)
        return start, start + length * (1.0 if rng.uniform() < 0.7 else -1.0)

    return drawn


def _shape(name, H, dof, parameters, span, member, reference=heyoka):
    return Shape(
        GROUP, name, Hamiltonian(H, dof=dof, parameters=parameters, name=name), span, member, reference
    )


def _duffing(times, case):
    par, a0 = case.par, case.y0[0]
    w = math.sqrt(par.a + par.b * a0 * a0)
    sn, cn, dn, _ = ellipj(w * (times - case.t0), par.b * a0 * a0 / (2.0 * w * w))
    return a0 * cn, -a0 * w * sn * dn


def _pendulum(times, case):
    g, k = math.sqrt(case.par.g), case.y0[1] / (2.0 * math.sqrt(case.par.g))
    s = times - case.t0
    if k < 1.0:
        sn, cn, _, _ = ellipj(g * s, k * k)
        return 2.0 * np.arcsin(k * sn), 2.0 * k * g * cn
    _, _, dn, am = ellipj(g * k * s, 1.0 / (k * k))
    return 2.0 * am, 2.0 * k * g * dn


def kepler(times, t0, mu, a, e):
    """Return x, y, vx, vy from the pericentre at t0 on."""
    n = math.sqrt(mu / a) / a
    mean = n * (times - t0)
    anomaly = mean + e * np.sin(mean)
    for _ in range(60):
        anomaly = anomaly - (anomaly - e * np.sin(anomaly) - mean) / (1.0 - e * np.cos(anomaly))
    c, s, b = np.cos(anomaly), np.sin(anomaly), math.sqrt(1.0 - e * e)
    rate = n / (1.0 - e * c)
    return a * (c - e), a * b * s, -a * s * rate, a * b * c * rate


def _morse(times, case):
    par, p = case.par, case.y0[1]  # from q = 0 outwards
    part = p * p / 2.0 / par.depth
    root, w = math.sqrt(part), par.a * math.sqrt(2.0 * par.depth * (1.0 - part))
    angle = w * (times - case.t0) + math.acos(root)
    inside = 1.0 - root * np.cos(angle)
    return np.log(inside / (1.0 - part)) / par.a, root * w * np.sin(angle) / inside / par.a


def _well(times, case):
    par, p = case.par, case.y0[1]
    energy = par.depth - p * p / 2.0  # below the rim
    w, top = par.a * math.sqrt(2.0 * energy), math.sqrt((par.depth - energy) / energy)
    s = w * (times - case.t0)
    u = top * np.sin(s)
    return np.arcsinh(u) / par.a, top * w * np.cos(s) / np.sqrt(1.0 + u * u) / par.a


def _three_bodies(q, p, par, m):
    masses = (1.0, par.b, par.c)
    kinetic = sum((p[2 * i] ** 2 + p[2 * i + 1] ** 2) / (2 * masses[i]) for i in range(3))
    potential = 0
    for i in range(3):
        for j in range(i):
            x, y = q[2 * i] - q[2 * j], q[2 * i + 1] - q[2 * j + 1]
            potential = potential + masses[i] * masses[j] / m.sqrt(x * x + y * y)
    return kinetic - potential


def _bodies(rng, t0, t_end):
    b, c = rng.uniform(0.001, 0.05, 2)
    inner, outer = rng.uniform(0.8, 1.2), rng.uniform(2.5, 4.0)
    u, w = rng.uniform(0.0, 2.0 * math.pi, 2)
    v, z = rng.uniform(0.85, 1.1) / math.sqrt(inner), rng.uniform(0.85, 1.1) / math.sqrt(outer)
    place = [0.0, 0.0, inner * math.cos(u), inner * math.sin(u), outer * math.cos(w), outer * math.sin(w)]
    second = [-b * v * math.sin(u), b * v * math.cos(u)]
    third = [-c * z * math.sin(w), c * z * math.cos(w)]
    first = [-second[0] - third[0], -second[1] - third[1]]
    return [*place, *first, *second, *third], {"b": b, "c": c}


SHAPES = [
    _shape(
        "henon_heiles",
        lambda q, p, par: (
            (p[0] ** 2 + p[1] ** 2 + q[0] ** 2 + q[1] ** 2) / 2 + par.c * (q[0] ** 2 * q[1] - q[1] ** 3 / 3)
        ),
        2,
        {"c": 1.0},
        span(10.0, 60.0),
        lambda rng, *_: (rng.uniform(-0.25, 0.25, 4), {"c": rng.uniform(0.3, 1.0)}),
    ),
    _shape(
        "quartic",
        lambda q, p, par: (
            (p[0] ** 2 + p[1] ** 2) / 2
            + par.a * (q[0] ** 4 + q[1] ** 4) / 4
            + par.b * q[0] ** 2 * q[1] ** 2 / 2
        ),
        2,
        {"a": 1.0, "b": 0.3},
        span(5.0, 25.0),
        lambda rng, *_: (rng.uniform(-1.0, 1.0, 4), {"a": rng.uniform(0.5, 2.0), "b": rng.uniform(0.0, 0.6)}),
    ),
    _shape(
        "duffing",
        lambda q, p, par: p[0] ** 2 / 2 + par.a * q[0] ** 2 / 2 + par.b * q[0] ** 4 / 4,
        1,
        {"a": 1.0, "b": 1.0},
        span(10.0, 60.0),
        lambda rng, *_: (
            [rng.uniform(0.1, 3.0), 0.0],
            {"a": rng.uniform(0.0, 2.0), "b": rng.uniform(0.1, 2.0)},
        ),
        exact(_duffing),
    ),
    _shape(
        "pendulum",
        lambda q, p, par, m: p[0] ** 2 / 2 - par.g * m.cos(q[0]),
        1,
        {"g": 1.0},
        span(5.0, 40.0),
        lambda rng, *_: ([0.0, 2.0 * rng.choice([0.02, 0.6, 0.99, 1.02, 1.5])], {"g": 1.0}),
        exact(_pendulum),
    ),
    _shape(
        "rotors",
        lambda q, p, par, m: (
            (p[0] ** 2 + p[1] ** 2 + p[2] ** 2) / 2
            - par.a * (m.cos(q[0] - q[1]) + m.cos(q[1] - q[2]))
            - m.sin(q[0])
        ),
        3,
        {"a": 1.0},
        span(5.0, 15.0),
        lambda rng, *_: (rng.uniform(-1.0, 1.0, 6), {"a": rng.uniform(0.1, 1.5)}),
    ),
    _shape(
        "kepler",
        lambda q, p, par, m: (p[0] ** 2 + p[1] ** 2) / 2 - par.mu / m.sqrt(q[0] ** 2 + q[1] ** 2),
        2,
        {"mu": 1.0},
        span(5.0, 60.0),
        lambda rng, t0, *_: (
            [(1.0 - (e := rng.uniform(0.0, 0.95))), 0.0, 0.0, math.sqrt((1.0 + e) / (1.0 - e))],
            {"mu": 1.0},
        ),
        exact(lambda times, case: kepler(times, case.t0, 1.0, 1.0, 1.0 - case.y0[0])),
    ),
    _shape("three_bodies", _three_bodies, 6, {"b": 0.01, "c": 0.01}, span(10.0, 40.0), _bodies),
    _shape(
        "morse",
        lambda q, p, par, m: p[0] ** 2 / 2 + par.depth * (1 - m.exp(-par.a * q[0])) ** 2,
        1,
        {"depth": 1.0, "a": 1.0},
        span(10.0, 60.0),
        lambda rng, *_: (
            [0.0, math.sqrt(2.0 * (depth := rng.uniform(0.5, 3.0)) * rng.uniform(0.01, 0.9))],
            {"depth": depth, "a": rng.uniform(0.5, 2.0)},
        ),
        exact(_morse),
    ),
    _shape(
        "well",
        lambda q, p, par, m: p[0] ** 2 / 2 - par.depth / m.cosh(par.a * q[0]) ** 2,
        1,
        {"depth": 1.0, "a": 1.0},
        span(10.0, 60.0),
        lambda rng, *_: (
            [0.0, math.sqrt(2.0 * (depth := rng.uniform(0.5, 3.0)) * rng.uniform(0.01, 0.9))],
            {"depth": depth, "a": rng.uniform(0.5, 2.0)},
        ),
        exact(_well),
    ),
    _shape(
        "toda",
        lambda q, p, m: (
            (p[0] ** 2 + p[1] ** 2 + p[2] ** 2) / 2
            + m.exp(q[0] - q[1])
            + m.exp(q[1] - q[2])
            + m.exp(q[2] - q[0])
        ),
        3,
        {},
        span(5.0, 30.0),
        lambda rng, *_: (rng.uniform(-1.0, 1.0, 6), {}),
    ),
]
