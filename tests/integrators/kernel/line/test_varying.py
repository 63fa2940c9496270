"""Steps of varying length: the invariants do not mind, and the error follows the tolerance."""

from itertools import pairwise

import numpy as np
import pytest

import integrators
import problems
from integrators import Gauss, LineIntegral
from integrators.protocol import Status

NAMES = ["energy", "angular_momentum"]


def run(problem, tol, times=None, *, k=12, s=4, names=NAMES, sample=None):
    solution = integrators.integrate(
        problem, LineIntegral(k=k, s=s, tol=tol, invariants=names), times, sample
    )
    assert solution.status == "finished", solution.reason
    return solution


def test_both_laws_hold_at_a_loose_tolerance_over_200_revolutions():
    problem = problems.load("kepler", e=0.6, t_end=400 * np.pi)
    solution = run(problem, 1e-6, sample="steps", k=20)
    errors = solution.errors()
    assert errors["energy"].max() <= 1e-13  # measured 1.1e-15
    assert errors["angular_momentum"].max() <= 1e-14  # measured 2.6e-16
    lengths = np.diff(solution.t)
    assert lengths.max() > 3 * lengths.min()
    # At the mean of these steps Gauss does not keep the energy.
    gauss = integrators.integrate(problem, Gauss(s=4, h=float(lengths.mean())), solution.t[:500:7])
    assert gauss.errors()["energy"].max() > 1e-5  # measured 3.5e-5


def test_the_error_follows_the_tolerance():
    problem = problems.load("kepler", e=0.6, t_end=20.0)
    exact = problems.catalogue.kepler.solution(problem, [20.0])[0]
    errors = [np.abs(run(problem, tol, [20.0]).y[-1] - exact).max() for tol in (1e-6, 1e-8, 1e-10, 1e-12)]
    assert errors[0] < 1e-4  # measured 2.2e-6
    for loose, tight in pairwise(errors):
        assert tight < loose / 10  # measured 42, 61, 59


def test_sitnikov_at_full_precision():
    problem = problems.load("sitnikov")
    solution = run(problem, 1e-15, np.arange(0.0, 300.5, 0.5), k=24, s=6)
    errors = solution.errors()
    assert errors["energy"].max() <= 1e-14  # measured 1.1e-15
    assert errors["angular_momentum"].max() <= 1e-14  # measured 2.3e-16
    assert solution.guards()["off_axis"].max() == 0.0
    other = run(problem, 1e-13, np.arange(0.0, 300.5, 0.5), k=24, s=6)
    assert np.abs(solution.y - other.y).max() <= 1e-9  # measured 9.5e-12


def test_adaptive_steps_do_not_depend_on_the_times_asked_for():
    problem = problems.load("kepler", e=0.6, t_end=20.0)
    program = LineIntegral(k=12, s=4, tol=1e-8, invariants=NAMES).compile(problem.system)
    ends = []
    for times, sample in (([20.0], None), (np.linspace(0, 20, 333), None), (np.linspace(0, 20, 77), "dense")):
        stepper = program.start(problem.y0, problem.par)
        stepper.advance(times, sample=sample)
        ends.append((stepper.t, *stepper.y))
    assert ends[0] == ends[1] == ends[2]


def test_steps_asked_for_are_the_steps_taken():
    problem = problems.load("kepler", e=0.6, t_end=20.0)
    program = LineIntegral(k=12, s=4, tol=1e-8, invariants=NAMES).compile(problem.system)
    one, other = (program.start(problem.y0, problem.par) for _ in range(2))
    samples = one.advance([0.0, 20.0], sample="steps")
    for t, y in zip(samples.t[1:], samples.y[1:], strict=True):
        assert other.step() is Status.RUNNING
        assert other.t == t
        assert np.array_equal(other.y, y)
    assert samples.t[-1] <= 20.0
    assert one.t == samples.t[-1]


def test_backwards_with_varying_steps():
    problem = problems.load("kepler", e=0.6, t_end=20.0)
    stepper = (
        LineIntegral(k=12, s=4, tol=1e-10, invariants=NAMES)
        .compile(problem.system)
        .start(problem.y0, problem.par)
    )
    stepper.advance([10.0])
    back = stepper.advance([5.0, 0.0, -3.0])
    exact = problems.catalogue.kepler.solution(problem, back.t)
    assert np.abs(back.y - exact).max() <= 1e-8  # measured 4.1e-10
    assert problem.errors(back.y)["energy"].max() <= 1e-14


def test_a_first_step_may_be_given():
    problem = problems.load("kepler", e=0.6)
    method = LineIntegral(k=12, s=4, h=1e-3, tol=1e-8, invariants=NAMES)
    stepper = method.compile(problem.system).start(problem.y0, problem.par)
    stepper.step()
    assert stepper.t == 1e-3


def test_a_step_too_long_for_the_iteration_is_shortened():
    problem = problems.load("kepler", e=0.6)
    method = LineIntegral(k=12, s=4, h=50.0, tol=1e-8, invariants=NAMES)
    stepper = method.compile(problem.system).start(problem.y0, problem.par)
    assert stepper.step() is Status.RUNNING
    assert 0.0 < stepper.t < 1.0
    assert stepper.stats.rejections > 0


@pytest.mark.parametrize("name", ["henon_heiles", "fput", "cr3bp"])
def test_other_problems_run_with_their_energy(name):
    problem = problems.load(name)
    invariant = next(iter(problem.system.invariants))
    t_end = min(problem.t_end, 50.0)
    solution = run(problem, 1e-9, np.linspace(0, t_end, 51), names=[invariant])
    assert solution.errors()[invariant].max() <= 1e-13  # measured 3.2e-15


def test_steps_do_not_outgrow_the_iteration_where_fast_modes_are_at_rest():
    # The lowest mode of a chain alone: its error would allow steps that the fastest modes do not.
    problem = problems.load("fput")
    solution = run(problem, 1e-9, [200.0], names=["energy"])
    assert solution.stats.iterations / solution.stats.steps <= 50  # measured 35; 232 without a bound
    assert solution.stats.rejections <= 10  # measured 4


@pytest.mark.parametrize("sample", ["partial", "steps"])
def test_steps_that_have_collapsed_are_a_status_with_time_and_reason(monkeypatch, sample):
    monkeypatch.setattr("integrators.running.watchdog.STALL_STEPS", 8000)

    def f(t, y, m):
        return [1.0 + 0.5 * m.sin(1e9 * t), 0.0 * y[0]]

    system = problems.VectorField(f, dim=2, invariants={"second": lambda y, m: y[1]})
    problem = problems.Problem(system, y0=[0.0, 1.0], t_end=1e6)
    method = LineIntegral(k=4, s=2, tol=1e-10, invariants=["second"])
    found = integrators.integrate(problem, method, [0.0, 1e6], sample=sample)
    assert found.status is Status.STALLED
    assert "the steps have collapsed" in found.reason
    assert 0.0 < found.t_stop < 1e-3
