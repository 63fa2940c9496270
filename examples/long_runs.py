"""A long run: the outer planets for 6,000 years, some 500 revolutions of Jupiter, beside REBOUND.

long_run.py shows progress, an interruption and how such a run goes on.
"""

import numpy as np
from side_by_side import Comparison

import integrators
import problems

YEARS = 6_000.0


def compare() -> Comparison:
    """Integrate them with ours, with REBOUND's two methods for planets, and with heyoka."""
    planets = problems.load("outer_solar_system", t_end=YEARS)
    times = np.linspace(0.0, YEARS, 201)

    def run(method) -> integrators.Solution:
        return integrators.integrate(planets, method, times)

    exact = run(integrators.HBVM())
    made = Comparison("A long run: the outer planets for 6,000 years", "positions at the end, au", 1e-7)
    for name, method in (
        ("Gauss(s=8, h=1.5)", integrators.Gauss(s=8, h=1.5)),
        ("REBOUND's IAS15", integrators.IAS15()),
        ("REBOUND's WHFast", integrators.WHFast(h=0.02)),
        ("heyoka", integrators.Taylor()),
    ):
        made.add(
            name, lambda method=method: run(method),
            lambda solution: np.abs(solution.q[-1] - exact.q[-1]).max(),
            lambda solution: solution.errors()["energy"].max(),
        )  # fmt: skip
    return made


if __name__ == "__main__":
    print(compare())
