"""CVODE: its library alone, stiff systems, sparse Jacobians."""

import numpy as np
import pytest

import problems
from integrators import CVODE, HBVM, integrate
from integrators.peers.sundials import CVODEProgram

STIFF = problems.load("stiff_chain", omega=50.0, t_end=10.0)


def test_the_end_is_that_of_the_library_alone():
    from hbvm_bench.studies.peers.alone import METHODS

    method = {"rtol": 1e-8, "atol": 1e-10}
    mine = CVODE(**method).compile(STIFF.system).start(STIFF.y0, STIFF.par)
    alone = METHODS["CVODE"](**method).compile(STIFF.system).start(STIFF.y0, STIFF.par)
    end = np.array([STIFF.t_end])
    assert np.array_equal(mine.advance(end, sample="stop").y, alone.advance(end).y)
    assert mine.stats.steps == alone.stats.steps > 100


@pytest.mark.parametrize("formulas", ["BDF", "Adams"])
def test_errors_fall_with_the_tolerance(formulas):
    truth = integrate(STIFF, HBVM(tol=1e-13), [10.0]).y[-1]
    errors = [
        np.abs(integrate(STIFF, CVODE(rtol=tol, atol=tol, method=formulas), [10.0]).y[-1] - truth).max()
        for tol in (1e-5, 1e-8)
    ]
    assert errors[1] < 1e-2 * errors[0]  # measured 2e-3 and 5e-4 of it
    assert errors[1] < 1e-3  # measured 2e-4 and 1.3e-5


def test_a_large_system_has_its_jacobian_as_a_sparse_matrix():
    problem = problems.load("fput", n=60)
    program = CVODE(rtol=1e-7, atol=1e-9).compile(problem.system)
    assert isinstance(program, CVODEProgram)
    assert program._jacobian(problem.par)["linsolver"] == "sparse"
    found = integrate(problem, CVODE(rtol=1e-7, atol=1e-9), [10.0])
    truth = integrate(problem, HBVM(), [10.0])
    assert np.abs(found.y[-1] - truth.y[-1]).max() < 1e-6  # measured 1.2e-7
    # Newton's iteration converges: few evaluations a step, none for differences.
    assert found.stats.evaluations < 3 * found.stats.steps  # measured 1.2
