"""A cluster of 64 stars with softened gravity over 3 crossing times, beside REBOUND."""

import numpy as np
from side_by_side import Comparison, settings

import integrators
import problems

END = 2.0


def compare() -> Comparison:
    """Integrate it with ours, with REBOUND's methods and with heyoka."""
    cluster = problems.load("cluster", n=64, t_end=END)
    exact = integrators.integrate(cluster, integrators.Gauss(s=8, h=0.01), [END]).q
    made = Comparison("A cluster of 64 stars", "positions, of a radius of 1", 1e-9)

    def run(method) -> integrators.Solution:
        return integrators.integrate(cluster, method, [0.0, END])

    for library, methods in (
        ("HBVM", [integrators.HBVM(tol=tol) for tol in (3e-16, 1e-13, 1e-11, 1e-9)]),
        ("Gauss", [integrators.Gauss(s=8, h=h) for h in (0.02, 0.03, 0.04, 0.05)]),
        ("REBOUND's IAS15", [integrators.IAS15(epsilon=epsilon) for epsilon in (1e-9, 1e-6, 1e-3, 0.1)]),
        ("REBOUND's leapfrog", [integrators.Leapfrog(order=8, h=h) for h in (5e-3, 0.01, 0.02, 0.04)]),
        ("heyoka", [integrators.Taylor(tol=tol, compact_mode=True) for tol in (1e-14, 1e-12, 1e-10, 1e-8)]),
    ):
        made.add(
            library, settings(run, *methods),
            lambda solution: np.abs(solution.q[-1] - exact[-1]).max(),
            lambda solution: solution.errors()["energy"].max(),
        )  # fmt: skip
    return made


if __name__ == "__main__":
    print(compare())
