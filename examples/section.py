"""A Poincaré section of Hénon and Heiles' problem: twelve orbits, most of which lie on curves.

Beside heyoka's events, and pynamicalsys's section where it is installed: it is no dependency (``pip install
pynamicalsys``).
"""

from functools import cache
from importlib.util import find_spec

import heyoka as hy
import numpy as np
from side_by_side import Comparison, settings, tolerances

import integrators
import problems

ENERGY, STARTS, END = 1 / 12, 12, 2000.0


def starts() -> np.ndarray:
    """Return states on the surface q_0 = 0 with p_0 > 0, all of the same energy: (n, 4)."""
    q1 = np.linspace(-0.35, 0.45, STARTS)
    p0 = np.sqrt(2.0 * ENERGY - q1**2 + 2.0 * q1**3 / 3.0)
    zero = np.zeros(STARTS)
    return np.column_stack([zero, q1, p0, zero])


@cache  # made once, as its users do
def heyokas(tol: float) -> tuple[hy.taylor_adaptive_dbl, list[np.ndarray]]:
    """Return heyoka's integrator, and the list in which its event puts the passages."""
    x, y, u, v = hy.make_vars("x", "y", "u", "v")
    found: list[np.ndarray] = []

    def passed(ta, t: float, sign: int) -> None:
        ta.update_d_output(t)
        found.append(ta.d_output.copy())

    surface = hy.nt_event(x, passed, direction=hy.event_direction.positive)
    equations = [(x, u), (y, v), (u, -x - 2 * x * y), (v, -y - x**2 + y**2)]
    return hy.taylor_adaptive(equations, np.zeros(4), tol=tol, nt_events=[surface]), found


def by_heyoka(tol: float) -> list[np.ndarray]:
    """Return the passages of each orbit by heyoka."""
    ta, found = heyokas(tol)
    made = []
    for start in starts():
        found.clear()
        ta.time, ta.state[:] = 0.0, start
        ta.propagate_until(END)
        made.append(np.array(found))
    return made


@cache
def pynamicalsyss(h: float):
    """Return the system of pynamicalsys, one of its own models; Yoshida's composition is its default."""
    from pynamicalsys import HamiltonianSystem

    system = HamiltonianSystem(model="henon heiles")
    system.integrator("svy4", time_step=h)
    return system


def by_pynamicalsys(counts: list[int], h: float) -> list[np.ndarray]:
    """Return so many passages of each orbit by pynamicalsys, which interpolates linearly between steps."""
    system = pynamicalsyss(h)
    return [
        system.poincare_section(start[:2], start[2:], count + 1)[1:, 1:]  # the first one is the start
        for start, count in zip(starts(), counts, strict=True)
    ]


def compare() -> Comparison:
    """Make the section with ours, with heyoka's events and with pynamicalsys's section."""
    problem = problems.load("henon_heiles", t_end=END)
    surface = integrators.Event(lambda q: q[0], direction=1, name="section")

    def ours(method) -> list[np.ndarray]:
        made = integrators.integrate_many(problem, method, starts=starts(), times=[END], events=surface)
        return [found["section"].y for found in made.events]

    exact = ours(integrators.HBVM(k=16, s=8, h=0.1))

    def error(found: list[np.ndarray]) -> float:
        last = [len(true) for true in exact]  # heyoka may count the start as a passage
        return max(np.abs(y[-n:] - true).max() for y, true, n in zip(found, exact, last, strict=True))

    def energy(found: list[np.ndarray]) -> float:
        return np.abs(problem.invariants(np.concatenate(found))["energy"] / ENERGY - 1.0).max()

    made = Comparison(
        f"A section: {sum(map(len, exact))} passages of 12 orbits", "states at the passages", 1e-6
    )
    methods = [integrators.HBVM(tol=tol) for tol in (3e-16, 1e-13, 1e-11, 1e-9)]
    made.add("HBVM", settings(ours, *methods), error, energy)
    made.add("heyoka", tolerances(by_heyoka, 1e-15, 1e-13, 1e-11, 1e-9), error, energy)
    if find_spec("pynamicalsys"):
        counts = [len(true) for true in exact]
        steps = tolerances(lambda h: by_pynamicalsys(counts, h), 0.1, 0.03, 0.01, 0.003, name="h")
        made.add("pynamicalsys's Yoshida 4", steps, error, energy)
    return made


if __name__ == "__main__":
    print(compare())
