"""A random search over linkages: none is silently wrong."""

import numpy as np
import pytest

from integrators import DOP853, HBVM, integrate
from problems import Problem
from problems.errors import InputError

from .linkages import linkage

TIMES = np.linspace(0.0, 5.0, 11)[1:]
HELD = 38  # its rods hold the first of two masses at rest
FEW = (3, 8, HELD)  # few masses


def checked(number):
    """Compare a linkage with DOP853 and with a start moved by rounding, and return what is wrong."""
    try:
        problem = linkage(number)
    except InputError as error:  # a mass on more pivots than hold it: two of the 200
        return [] if "are dependent at the start" in str(error) else [str(error)]
    solution = integrate(problem, HBVM(max_steps=30_000), TIMES)
    if solution.status != "finished" or solution.warnings:
        return []  # it says so
    most = {"energy": 1e-11, "constraints": 1e-11, "constraint_rates": 1e-9}  # near singular positions
    errors = {name: float(error.max()) for name, error in solution.errors().items()}
    wrong = [f"{name}: {error:.1e}" for name, error in errors.items() if error > most[name]]
    reference = integrate(problem, DOP853(rtol=1e-13, atol=1e-15), TIMES)
    if np.abs(problem.y0[problem.system.dof :]).max() < 1e-12:
        return wrong  # the rods allow no motion
    moved = problem.y0 * (1.0 + 1e-13 * np.where(np.arange(problem.y0.size) % 2, 1.0, -1.0))
    beside = integrate(
        Problem(problem.system, y0=moved, t_end=5.0, project=True), HBVM(max_steps=30_000), TIMES
    )
    if reference.status == "finished" == beside.status:
        sensitive = np.abs(beside.q - solution.q).max(axis=0)
        error = np.abs(reference.q - solution.q).max(axis=0)
        if (error > 1e-8 + 100.0 * sensitive).any():
            wrong.append(f"positions: {error.max():.1e}, sensitive to {sensitive.max():.1e}")
    return wrong


@pytest.mark.parametrize("number", FEW)
def test_a_random_linkage_is_right_or_says_that_it_is_not(number):
    assert checked(number) == []


def test_a_mass_that_its_rods_hold_at_rest_takes_no_steps():
    # its forces cancel, and what is left of them is rounding
    problem = linkage(HELD)
    solution, reference = (integrate(problem, m, TIMES) for m in (HBVM(), DOP853(rtol=1e-13, atol=1e-15)))
    assert np.abs(solution.q[:, :2] - problem.y0[:2]).max() < 1e-13  # measured 1.1e-16
    assert solution.stats.steps < 1.5 * reference.stats.steps  # measured 98 and 115


@pytest.mark.slow
@pytest.mark.parametrize("number", sorted({*range(200)} - {*FEW}))
def test_more_random_linkages_are_right_or_say_that_they_are_not(number):
    assert checked(number) == []
