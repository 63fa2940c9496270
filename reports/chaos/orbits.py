"""What must hold of exponents and indicators, on single orbits; planets beside REBOUND's own indicators."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hbvm_bench.measure.timing import busy, interleaved, load_between, no_collection
from integrators.dynamics.indicators import Indicator, megno
from integrators.dynamics.lyapunov import lyapunov
from integrators.methods.gauss import Gauss
from integrators.protocol import Array
from problems import Hamiltonian, Problem, nbody
from problems.catalogue.henon_heiles import henon_heiles

from .systems import SYSTEMS

LORENZ = Gauss(s=6, h=0.02)
LORENZ_END, LORENZ_SKIP = 1000.0, 20.0
PAIRS = Gauss(s=8, h=0.5)
MEGNO = Gauss(s=6, h=0.25)
MEGNO_END = 1e6
DRAWN = 400  # of the values

# Sun, Jupiter and Saturn: years of 2 pi, the Sun's mass, astronomical units
JUPITER = {"m": 0.000954, "a": 5.204, "M": 0.6, "omega": 0.257, "e": 0.048}
SATURN = {"m": 0.000285, "M": 0.871, "omega": 1.616}
PLANETS = {"regular": (7.0, 0.05), "chaotic": (9.5, 0.35)}  # Saturn's axis and eccentricity
PERIOD = 74.6  # of Jupiter
REVOLUTIONS = 2000
OURS = Gauss(s=8, h=8.0)
WHFAST_STEP = PERIOD / 20.123  # no whole part of a period of Jupiter
SAMPLES = 3


@dataclass(frozen=True, eq=False)
class Checks:
    """Exponents of two systems.

    Attributes
    ----------
    interval : ndarray, shape (2,)
        Of Lorenz's largest exponent.
    exponent, sum : float
        That exponent, and the sum of all three.
    pairs : float
        The largest sum of two exponents of the Henon-Heiles problem that are each other's negative.
    largest : float
        Its largest exponent.
    """

    interval: Array
    exponent: float
    sum: float
    pairs: float
    largest: float


def checks(share: float = 1.0) -> Checks:
    """Return exponents of Lorenz's system and of the Henon-Heiles problem, with fixed step sizes."""
    t_end = LORENZ_SKIP + share * (LORENZ_END - LORENZ_SKIP)
    start = SYSTEMS["lorenz"].problem()
    lorenz = lyapunov(start, LORENZ, t_end=t_end, skip=LORENZ_SKIP)
    chaotic = lyapunov(henon_heiles(), PAIRS, t_end=1000.0 * share)
    assert chaotic.pairs is not None
    return Checks(
        lorenz.intervals[0],
        float(lorenz.exponents[0]),
        lorenz.sum,
        chaotic.pairs,
        float(chaotic.exponents[0]),
    )


@dataclass(frozen=True, eq=False)
class Curves:
    """MEGNO along orbits, by their names: the times and the values, shape (2, n)."""

    regular: Array
    chaotic: Array
    linear: Array
    exponent: float  # the largest of the chaotic orbit, over the same time
    interval: Array  # of it, shape (2,)


def curves(share: float = 1.0) -> Curves:
    """Return MEGNO of a quasi-periodic, a chaotic and a linear motion."""
    t_end = share * MEGNO_END
    regular = henon_heiles(energy=1 / 12, q2=0.05, t_end=t_end)
    chaotic = henon_heiles(t_end=t_end)
    linear = Problem(
        Hamiltonian(lambda q, p: (p[0] ** 2 + q[0] ** 2 + p[1] ** 2 + 2 * q[1] ** 2) / 2, dof=2),
        q0=[1.0, 0.5],
        p0=[0.0, 0.3],
        t_end=t_end,
    )
    exponent = lyapunov(chaotic, MEGNO, count=1)
    return Curves(
        regular=_curve(megno(regular, MEGNO)),
        chaotic=_curve(megno(chaotic, MEGNO)),
        linear=_curve(megno(linear, MEGNO)),
        exponent=float(exponent.exponents[0]),
        interval=exponent.intervals[0],
    )


def _curve(indicator: Indicator) -> Array:
    """Return times and values, evenly spaced in the logarithm of time, with the last."""
    places = np.geomspace(1, indicator.t.size, DRAWN).astype(int) - 1
    return np.stack([indicator.t, indicator.values])[:, np.unique(places)]


@dataclass(frozen=True)
class IndicatorRow:
    """One library's MEGNO and largest exponent of a planetary system."""

    method: str
    megno: float
    exponent: float
    low: float | None  # of its interval, where there is one
    high: float | None
    seconds: list[float]


@dataclass(frozen=True)
class Planets:
    """One planetary system, and what else the machine did meanwhile, as shares of one core's time."""

    rows: list[IndicatorRow]
    others: float
    stolen: float


def planets(name: str, share: float = 1.0, samples: int = SAMPLES) -> Planets:
    """Return MEGNO and the largest exponent of Sun, Jupiter and Saturn, by us and by REBOUND."""
    axis, eccentricity = PLANETS[name]
    t_end = share * REVOLUTIONS * PERIOD
    bodies = _simulation(axis, eccentricity).particles
    problem = nbody(
        [body.m for body in bodies],
        [body.xyz for body in bodies],
        [body.vxyz for body in bodies],
        t_end=t_end,
    )
    results: dict[str, Any] = {}
    runs: dict[str, Callable[[], Any]] = {
        repr(OURS): partial(megno, problem, OURS),
        "REBOUND, IAS15": partial(_rebound, axis, eccentricity, t_end, "ias15"),
        "REBOUND, WHFast": partial(_rebound, axis, eccentricity, t_end, "whfast"),
    }

    def sample(key: str) -> float:
        start = time.perf_counter()
        results[key] = runs[key]()
        return time.perf_counter() - start

    with no_collection():
        sample(repr(OURS))  # compiles
        before = busy()
        seconds = interleaved([partial(sample, key) for key in runs], samples)
        load = load_between(before, busy())
    mine = lyapunov(problem, OURS, count=1)
    rows = []
    for (key, result), taken in zip(results.items(), seconds, strict=True):
        if isinstance(result, Indicator):
            low, high = mine.intervals[0].tolist()
            rows.append(IndicatorRow(key, result.value, float(mine.exponents[0]), low, high, taken))
        else:
            indicator, exponent = result
            rows.append(IndicatorRow(key, indicator, exponent, None, None, taken))
    return Planets(rows, load.others if load else 0.0, load.steal if load else 0.0)


def _simulation(axis: float, eccentricity: float) -> Any:
    import rebound

    simulation = rebound.Simulation()
    simulation.add(m=1.0)
    simulation.add(**JUPITER)
    simulation.add(**SATURN, a=axis, e=eccentricity)
    simulation.move_to_com()
    return simulation


def _rebound(axis: float, eccentricity: float, t_end: float, integrator: str) -> tuple[float, float]:
    """Return REBOUND's MEGNO and exponent."""
    simulation = _simulation(axis, eccentricity)
    simulation.integrator = integrator
    if integrator == "whfast":
        simulation.dt = WHFAST_STEP
    simulation.init_megno(seed=1)
    simulation.integrate(t_end)
    return simulation.megno(), simulation.lyapunov()
