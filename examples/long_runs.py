"""A long run: the outer planets for 6,000 years, some 500 revolutions of Jupiter, beside REBOUND.

long_run.py shows progress, an interruption and how such a run goes on.
"""

from functools import partial

import numpy as np
from heyoka_bodies import by_heyoka
from side_by_side import Comparison, settings

import integrators
import problems

YEARS = 6_000.0
WHFAST = partial(integrators.WHFast, corrector=17, kernel="lazy")


def compare() -> Comparison:
    """Integrate them with ours, with REBOUND's methods for planets, and with heyoka's model of bodies."""
    planets = problems.load("outer_solar_system", t_end=YEARS)
    times = np.linspace(0.0, YEARS, 201)

    def run(method) -> integrators.Solution:
        return integrators.integrate(planets, method, times)

    exact = run(integrators.HBVM(k=20, s=10, h=0.5))
    made = Comparison("A long run: the outer planets for 6,000 years", "positions at the end, au", 1e-7)
    half = planets.y0.size // 2
    for library, methods in (
        ("HBVM", [integrators.HBVM(tol=tol) for tol in (3e-16, 1e-13, 1e-11, 1e-10)]),
        ("Gauss", [integrators.Gauss(s=8, h=h) for h in (1.2, 1.5, 1.8, 2.2)]),
        ("REBOUND's IAS15", [integrators.IAS15(epsilon=epsilon) for epsilon in (1e-7, 1e-6, 1e-5, 1e-4)]),
        ("REBOUND's WHFast", [WHFAST(h=h) for h in (0.2, 0.3, 0.4, 0.5)]),
        ("REBOUND's SABA", [integrators.SABA(h=h) for h in (0.75, 1.0, 1.25, 1.5)]),
    ):
        made.add(
            library, settings(run, *methods),
            lambda solution: np.abs(solution.q[-1] - exact.q[-1]).max(),
            lambda solution: solution.errors()["energy"].max(),
        )  # fmt: skip
    made.add(
        "heyoka", {f"tol={tol:g}": by_heyoka(planets, times, tol) for tol in (1e-15, 1e-13, 1e-12, 1e-11)},
        lambda y: np.abs(y[-1] - exact.y[-1])[:half].max(),
        lambda y: planets.errors(y)["energy"].max(),
    )  # fmt: skip
    return made


if __name__ == "__main__":
    print(compare())
