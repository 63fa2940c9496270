"""A cluster of 64 stars with softened gravity over 3 crossing times, beside REBOUND."""

import numpy as np
from side_by_side import Comparison

import integrators
import problems

END = 2.0


def compare() -> Comparison:
    """Integrate it with ours and with REBOUND's methods."""
    cluster = problems.load("cluster", n=64, t_end=END)
    exact = integrators.integrate(cluster, integrators.Gauss(s=8, h=0.01), [END]).q
    made = Comparison("A cluster of 64 stars", "positions, of a radius of 1", 1e-9)
    for name, method in (
        ("HBVM()", integrators.HBVM()),
        ("Gauss(s=8, h=0.05)", integrators.Gauss(s=8, h=0.05)),
        ("REBOUND's IAS15", integrators.IAS15()),
        ("REBOUND's leapfrog", integrators.Leapfrog(h=1e-3)),
    ):
        made.add(
            name, lambda method=method: integrators.integrate(cluster, method, [0.0, END]),
            lambda solution: np.abs(solution.q[-1] - exact[-1]).max(),
            lambda solution: solution.errors()["energy"].max(),
        )  # fmt: skip
    return made


if __name__ == "__main__":
    print(compare())
