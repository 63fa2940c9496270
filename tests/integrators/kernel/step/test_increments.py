"""How exactly a step adds up what the field is: its values are exact and the same at all stages."""

from fractions import Fraction

import numpy as np
import pytest

from integrators.kernel.plan import Plan
from integrators.kernel.program import HBVMProgram
from problems import Hamiltonian, VectorField

SLOPES = np.random.default_rng(0).uniform(0.1, 1.0, 24).tolist()
CONSTANT = VectorField(lambda y: [slope + 0.0 * y[0] for slope in SLOPES], dim=24)
FALLING = Hamiltonian(
    lambda q, p: sum(x * x for x in p) / 2 - sum(slope * x for slope, x in zip(SLOPES, q, strict=True)),
    dof=24,
)
H, STEPS = 0.3, 10


@pytest.mark.parametrize("system", [CONSTANT, FALLING], ids=["first order", "second order"])
@pytest.mark.parametrize(
    ("k", "s", "most"),
    # Measured, and where the last sums are rounded; with one stage there is nothing to add up.
    [
        (1, 1, 1e-28),  # 4e-31; 4.4e-17
        (4, 4, 4.5e-17),  # 3.0e-17; 6.2e-17
        (8, 8, 6.5e-17),  # 4.4e-17; 8.5e-17
        (16, 8, 4.5e-17),  # 2.6e-17; 7.4e-17
        (18, 2, 4e-17),  # 2.2e-17; 8.1e-17
        (24, 8, 4e-17),  # 2.4e-17; 7.8e-17
    ],
)
def test_increments_are_right_to_a_part_of_their_last_bit(system, k, s, most):
    start = np.linspace(10.0, 20.0, system.dim)
    stepper = HBVMProgram(system, Plan(k=k, s=s, h=H)).start(start)
    stepper.advance([STEPS * H])
    context = stepper._context
    assert context.counters.steps == STEPS
    errors = []
    for i, slope in enumerate(SLOPES):
        place, first = (8 * (i // 4) + i % 4, start[24 + i]) if system is FALLING else (i, start[i])
        found = Fraction(float(context.state[place])) + Fraction(float(context.error[place]))
        increment = Fraction(H) * Fraction(slope)
        errors.append(float((found - Fraction(float(first))) / (STEPS * increment) - 1))
    assert np.sqrt(np.mean(np.square(errors))) < most
