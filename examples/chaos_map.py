"""MEGNO with forces that REBOUND's variational equations do not have, and a map of Jupiter's resonances.

``python examples/chaos_map.py 100 map.png`` draws a map of 100 x 100 asteroids; by default it has 12 x 12.
"""

import sys
from time import perf_counter

import numpy as np
import rebound

from integrators import HBVM, Gauss, integrate
from integrators.dynamics import megno_map
from problems import nbody
from problems.bodies import J2, Orbit, bodies_of, starts

UNIT, SUN, JUPITER, YEARS = "au, yr, Msun", 1.0, 9.546e-4, 500.0
METHOD = Gauss(s=6, h=0.4)


def drag(x, v):
    """Return what a thin gas at rest does to the asteroid: -v/tau with tau = 1e5 years."""
    return [[0.0] * 3, [0.0] * 3, [-1e-5 * (v[2][c] - v[0][c]) for c in range(3)]]


def belt(forces=()):
    """Return the Sun, Jupiter and an asteroid."""
    orbits = [Orbit(a=5.2044, e=0.0489), Orbit(a=3.0)]
    return nbody([SUN, JUPITER], orbits=orbits, massless=1, forces=forces, unit=UNIT, t_end=YEARS)


def by_rebound(problem, row):
    """Return MEGNO by REBOUND's WHFast, which knows gravity only."""
    masses, x, v = bodies_of(problem, row)
    simulation = rebound.Simulation()
    simulation.units = ("au", "yr", "Msun")
    simulation.G = float(problem.system.unpack(problem.par)["G"])
    for mass, place, speed in zip([*masses, 0.0], x.tolist(), v.tolist(), strict=True):
        simulation.add(m=mass, **dict(zip(("x", "y", "z", "vx", "vy", "vz"), place + speed, strict=True)))
    simulation.N_active = 2
    simulation.integrator, simulation.dt = "whfast", 0.1
    simulation.init_megno(seed=1)
    simulation.integrate(YEARS)
    return simulation.megno()


def main() -> None:
    """Compare single values, and draw a map."""
    alone = belt()
    orbits = Orbit(a=[2.6, 3.0, 4.5], e=[0.05, 0.1, 0.1])
    rows = starts(alone, -1, orbits)
    ours, theirs = megno_map(alone, METHOD, starts=rows).values, [by_rebound(alone, row) for row in rows]
    print("gravity only, here and by REBOUND:", ours.round(1).tolist(), np.round(theirs, 1).tolist())
    print("regular and chaotic alike:", bool(((ours > 3.0) == (np.array(theirs) > 3.0)).all()))

    forced = belt([J2(J2=1e-3, R=0.00465), drag])
    print("with J2 and drag:", megno_map(forced, METHOD, starts=rows).values.round(1).tolist())
    start = forced.replace(y0=rows[0])
    vectors = np.zeros((18, 1))
    vectors[6] = 1.0
    vector = integrate(start, HBVM(), [20.0], variations=vectors).variations[-1, :, 0]
    beside = [start.replace(y0=start.y0 + side * 1e-6 * vectors[:, 0]) for side in (1.0, -1.0)]
    ends = [integrate(one, HBVM(), [20.0]).y[-1] for one in beside]
    away = np.abs((ends[0] - ends[1]) / 2e-6 - vector).max() / np.abs(vector).max()
    print("the vector is the difference of two orbits:", bool(away < 1e-7))

    n = int(sys.argv[1]) if len(sys.argv) > 1 else 12
    a, e = np.linspace(3.5, 4.6, n), np.linspace(0.0, 0.3, n)
    began = perf_counter()
    grid = starts(forced, -1, Orbit(a=a[:, np.newaxis], e=e))
    found = megno_map(forced, METHOD, starts=grid, threads=2, progress=True)
    chaotic, lost = np.sum(found.values > 3.0), np.sum(np.isnan(found.values))
    print(f"a map of {n} x {n} in {perf_counter() - began:.0f} s")
    print(f"{chaotic} chaotic, {lost} too near to Jupiter for a fixed step size")
    if len(sys.argv) > 2:
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(figsize=(6.6, 3.6), layout="constrained")
        mesh = found.draw(a, e, axes, vmin=1.0, vmax=8.0, cmap="magma")
        figure.colorbar(mesh, label=f"MEGNO after {YEARS:.0f} years", extend="both")
        for k, m in ((5, 3), (3, 2), (4, 3), (5, 4)):
            place = 5.2044 * (m / k) ** (2 / 3)
            axes.text(place, 0.306, f"{k}:{m}", ha="center", va="bottom", fontsize=8)
        axes.set(xlabel="semi-major axis in au", ylabel="eccentricity")
        figure.savefig(sys.argv[2], dpi=110)


if __name__ == "__main__":
    main()
