"""Linkages in Cartesian coordinates: energy and constraints at round-off, with no option of the method.

A spherical pendulum, a four-bar linkage (closed), a chain of ten links, a rigid molecule of water that
moves and turns, a slider-crank, and a heavy top whose attitude is a quaternion. Beside each: DOP853 on the
same equations, whose constraints drift.
"""

import numpy as np

from integrators import DOP853, HBVM, integrate
from problems import Constrained, Lagrangian, Problem


def linkage(places, rods, masses, fixed=(), gravity=1.0):
    """Return the system of point masses, some of them fixed, and rods between pairs of them.

    places : (n, space); rods : pairs of indices; a rod is as long as it is at the start.
    """
    places, space = np.asarray(places, dtype=float), len(places[0])
    free = [i for i in range(len(places)) if i not in fixed]

    def coordinate(q, i, c):
        return float(places[i, c]) if i in fixed else q[space * free.index(i) + c]

    def length(i, j):
        squared = float(((places[i] - places[j]) ** 2).sum())
        return lambda q: sum((coordinate(q, i, c) - coordinate(q, j, c)) ** 2 for c in range(space)) - squared

    def H(q, p):
        kinetic = sum(p[i] ** 2 / (2 * masses[i // space]) for i in range(space * len(free)))
        return kinetic + gravity * sum(masses[i] * q[space * i + space - 1] for i in range(len(free)))

    system = Constrained(H, constraints=[length(*rod) for rod in rods], dof=space * len(free))
    return system, places[free].ravel()


def slider_crank():
    """Return a crank and a rod, homogeneous bars, and a slider: two angles, and the slider's place.

    Lengths .15 and .3, masses 1, 2 and 1; nothing pulls, and the crank turns about once in a unit of time.
    """

    def L(q, v, m):
        # the middle of the rod: its masses' velocity, and its turning about it
        x = -0.15 * (m.sin(q[0]) * v[0] + m.sin(q[1]) * v[1])
        y = 0.15 * (m.cos(q[0]) * v[0] + m.cos(q[1]) * v[1])
        return 0.15**2 * v[0] ** 2 / 6 + x**2 + y**2 + 0.3**2 * v[1] ** 2 / 12 + v[2] ** 2 / 2

    def closed(q, m):
        along = 0.15 * m.cos(q[0]) + 0.3 * m.cos(q[1]) - q[2]
        return [along, 0.15 * m.sin(q[0]) + 0.3 * m.sin(q[1])]

    system = Constrained(Lagrangian(L, dof=3), constraints=[closed])
    return Problem(system, q0=[0.0, 0.0, 0.45], v0=[6.0, -3.0, 0.0], t_end=20.0)


def top():
    """Return a heavy top with one point fixed, moments of inertia 1, 1.2 and .5, by its quaternion.

    Twice the angular momenta about its axes are bilinear in q and p; that of the length of q has any mass.
    """

    def rows(q):
        w, x, y, z = (q[i] for i in range(4))
        return [[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]

    def H(q, p):
        momenta = [sum(row[i] * p[i] for i in range(4)) for row in rows(q)]
        turning = sum(s**2 / (8 * J) for s, J in zip(momenta, (1.0, 1.0, 1.2, 0.5), strict=True))
        return turning + q[0] ** 2 - q[1] ** 2 - q[2] ** 2 + q[3] ** 2

    system = Constrained(H, constraints=[lambda q: sum(q[i] ** 2 for i in range(4)) - 1], dof=4)
    q0 = np.array([np.cos(0.25), np.sin(0.25), 0.0, 0.0])
    p0 = 2 * np.array([0.0, 0.1, 0.24, 2.5]) @ rows(q0)
    return Problem(system, q0=q0, p0=p0, t_end=20.0)


def cases():
    """Yield names and problems."""
    system, q = linkage([[0, 0, 0], [0.8, 0, -0.6]], [(0, 1)], [1.0], fixed=[0])
    yield "spherical pendulum", Problem(system, q0=q, v0=[0, 0.7, 0], t_end=100.0)
    bars = [[0, 0], [0, 1], [2, 1.5], [2, 0]]
    system, q = linkage(bars, [(0, 1), (1, 2), (2, 3)], [1.0, 2.0], fixed=[0, 3])
    yield "four-bar linkage", Problem(system, q0=q, v0=[-0.5, 0, -0.4, 0], t_end=100.0, project=True)
    links = [[np.sin(0.3) * i, -np.cos(0.3) * i] for i in range(11)]
    system, q = linkage(links, [(i, i + 1) for i in range(10)], [1.0] * 10, fixed=[0])
    yield "chain of ten links", Problem(system, q0=q, v0=np.zeros(20), t_end=20.0)
    water = [[0, 0, 0], [0.9572, 0, 0], [-0.24, 0.9266, 0]]
    system, q = linkage(water, [(0, 1), (0, 2), (1, 2)], [15.999, 1.008, 1.008], gravity=0.0)
    spin = [0, 0, 0, 0, 0.3, 1.0, 0.2, 0, -0.5]
    yield "rigid water", Problem(system, q0=q, v0=spin, t_end=20.0, project=True)
    yield "slider-crank", slider_crank()
    yield "heavy top", top()


def main() -> None:
    """Print the errors of both."""
    print(f"{'':20} {'steps':>6} {'energy':>9} {'rods':>9} {'rates':>9}   DOP853: energy and rods")
    worst = 0.0
    for name, problem in cases():
        times = np.linspace(0.0, problem.t_end, 101)[1:]
        solution = integrate(problem, HBVM(), times)
        ours = [error.max() for error in solution.errors().values()]
        theirs = [
            e.max() for e in integrate(problem, DOP853(rtol=1e-10, atol=1e-10), times).errors().values()
        ]
        worst = max(worst, *ours[:2])
        print(
            f"{name:20} {solution.stats.steps:6} {ours[0]:9.0e} {ours[1]:9.0e} {ours[2]:9.0e}   "
            f"{theirs[0]:.0e} and {theirs[1]:.0e}"
        )
    print("energy and rods at round-off:", worst < 1e-14)


if __name__ == "__main__":
    main()
