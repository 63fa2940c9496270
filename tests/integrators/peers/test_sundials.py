"""CVODE: its library alone, stiff systems, sparse Jacobians."""

from typing import Any

import numpy as np
import pytest

import problems
from integrators import CVODE, HBVM, Status, integrate, start
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


def diffusion(n: int) -> problems.Problem:
    def field(y):
        row = [0.0, *(y[i] for i in range(n)), 0.0]
        return [row[i - 1] - 2 * row[i] + row[i + 1] for i in range(1, n + 1)]

    return problems.Problem(problems.VectorField(field, dim=n), y0=[1.0] + [0.0] * (n - 1), t_end=3.0)


@pytest.mark.parametrize(
    ("problem", "kind"),
    [(STIFF, "Dense"), (diffusion(30), "Band"), (problems.load("fput", n=60, t_end=3.0), "Sparse")],
)
def test_compiled_callbacks_take_the_steps_that_python_s_take(problem, kind):
    program = CVODE(rtol=1e-7, atol=1e-9).compile(problem.system)
    assert program.compiled.matrix.kind == kind
    whole = program.start(problem.y0, problem.par)
    y = whole.advance(np.array([problem.t_end]), sample="stop").y[-1]
    python = program.solver(problem.par)
    python.init_step(0.0, problem.y0)
    result = python.step(problem.t_end, "normal", problem.t_end)
    assert (whole.stats.evaluations, whole.stats.extra["jacobians"]) == (result.nfev, result.njev)
    # The same bits, where the linear solver is the same; rounding differs in a banded one. Measured 0.
    assert np.abs(y - result.y).max() <= (1e-14 if kind == "Band" else 0.0)


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


def test_steps_that_do_not_change_the_time_do_not_change_the_state():
    cvode = pytest.importorskip("sksundae.cvode")
    # y' = y^2: CVODE's solution grows beyond 1e14 before 1, as errors of 1e-8 move its pole by 8e-7.
    field = problems.VectorField(lambda y: [y[0] ** 2], dim=1)
    run: Any = start(problems.Problem(field, y0=[1.0], t_end=2.0), CVODE(rtol=1e-8, atol=1e-8))
    run.until(2.0)
    assert run.status is Status.STEP_UNDERFLOW

    def square(t, y, slope):
        slope[:] = y * y

    alone = cvode.CVODE(square, rtol=1e-8, atol=1e-8)
    alone.init_step(0.0, np.array([1.0]))
    t, y = [0.0], [1.0]
    while len(t) < 2 or t[-1] > t[-2]:
        result = alone.step(t[-1] + 1.0, "onestep")
        t.append(float(result.t))
        y.append(float(result.y[0]))
    assert run.t == pytest.approx(t[-2], rel=1e-12)  # measured 2e-15
    assert run.y[0] == pytest.approx(y[-2], rel=1e-6)  # measured 5e-11
    assert y[-1] > 1.01 * y[-2]  # the step that did not change t; measured 1.02
