"""Close encounters: three masses of 3, 4 and 5 fall from rest and pass each other within a thousandth."""

import numpy as np
from side_by_side import Comparison, settings

import integrators
import problems
from hbvm_bench.reference.solutions import find


def compare() -> Comparison:
    """Integrate them with ours, with REBOUND's adaptive method and with heyoka."""
    problem = problems.load("pythagorean")
    reference = find(problem)  # comes with the package, from numbers of 128 bits
    made = Comparison("Close encounters: the Pythagorean problem", "positions at the end", 1e-2)

    def run(method) -> integrators.Solution:
        return integrators.integrate(problem, method, reference.t)

    for library, methods in (
        ("HBVM", [integrators.HBVM(tol=tol) for tol in (3e-16, 1e-14, 1e-13, 1e-12)]),
        ("heyoka", [integrators.Taylor(tol=tol, fast_math=True) for tol in (1e-16, 1e-15, 1e-14, 1e-13)]),
        ("REBOUND's IAS15", [integrators.IAS15(epsilon=epsilon) for epsilon in (1e-9, 1e-8, 1e-7, 1e-6)]),
    ):
        made.add(
            library, settings(run, *methods),
            lambda solution: np.abs(solution.q[-1] - reference.high[-1, :6]).max(),
            lambda solution: solution.errors()["energy"].max(),
        )  # fmt: skip
    return made


if __name__ == "__main__":
    print(compare())
