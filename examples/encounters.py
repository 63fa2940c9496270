"""Close encounters: three masses of 3, 4 and 5 fall from rest and pass each other within a thousandth."""

import numpy as np
from side_by_side import Comparison

import integrators
import problems
from hbvm_bench.reference.solutions import find


def compare() -> Comparison:
    """Integrate them with ours, with REBOUND's adaptive method and with heyoka."""
    problem = problems.load("pythagorean")
    reference = find(problem)  # comes with the package, from numbers of 128 bits
    made = Comparison("Close encounters: the Pythagorean problem", "positions at the end", 1e-2)
    for name, method in (
        ("HBVM()", integrators.HBVM()),
        ("REBOUND's IAS15", integrators.IAS15()),
        ("heyoka", integrators.Taylor()),
    ):
        made.add(
            name, lambda method=method: integrators.integrate(problem, method, reference.t),
            lambda solution: np.abs(solution.q[-1] - reference.high[-1, :6]).max(),
            lambda solution: solution.errors()["energy"].max(),
        )  # fmt: skip
    return made


if __name__ == "__main__":
    print(compare())
