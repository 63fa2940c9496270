"""What the iteration leaves when it stops acts in the same direction in each step."""

from fractions import Fraction

import numpy as np
import pytest

from integrators.kernel.program import AdaptiveProgram, HBVMProgram
from problems import Hamiltonian, Problem


def energy(q, p, m):
    return (p[0] * p[0] + q[0] * q[0]) / 2


def change(start, end):
    """Return the relative change of the energy, without rounding."""
    before, after = (sum(Fraction(float(x)) ** 2 for x in state) for state in (start, end))
    return float((after - before) / before)


SYSTEM = Hamiltonian(energy, dof=1, name="oscillator")
STARTS, END = 16, 10000.0


@pytest.mark.parametrize(
    ("program", "most"),
    # Measured, with standard errors; with 1e-18 left of a change; before the rule that is tested:
    [
        (lambda: HBVMProgram(SYSTEM, k=4, s=4, h=0.5), 1.5e-19),  # 0.4 +- 0.2e-19; 0.6e-19; -3.7e-19
        (lambda: HBVMProgram(SYSTEM, k=8, s=4, h=0.5), 1.5e-19),  # 0.4 +- 0.2e-19; -2.1e-19; -3.6e-19
        (lambda: HBVMProgram(SYSTEM, k=8, s=4, h=0.5, form="first"), 1.5e-19),  # 0.2 +- 0.2e-19; 0.6; -12
        (lambda: AdaptiveProgram(SYSTEM, k=8, s=6, tol=1e-12), 4e-19),  # 0.9 +- 0.3e-19; 9e-19
    ],
)
def test_the_mean_change_of_the_energy_per_step_is_nothing(program, most):
    changes = []
    made = program()
    for i in range(STARTS):
        problem = Problem(SYSTEM, q0=[0.7 + 0.01 * i], p0=[0.2], t_end=END)
        stepper = made.start(problem.y0)
        end = stepper.advance([END]).y
        changes.append(change(problem.y0, end[-1]) / stepper.stats.steps)
    assert abs(np.mean(changes)) < most
