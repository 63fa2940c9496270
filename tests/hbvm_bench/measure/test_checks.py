import msgspec
import numpy as np
import pytest

import problems
from hbvm_bench.campaign.file import Checks, Ensemble, TimingPlan
from hbvm_bench.campaign.grid import Grid
from hbvm_bench.measure import raw
from hbvm_bench.measure.ensemble import EnsembleRun
from hbvm_bench.measure.measured import measure, with_growth
from hbvm_bench.measure.metrics import evaluate
from hbvm_bench.measure.raw import solve
from hbvm_bench.measure.starts import PERTURBATION, members, scaled
from hbvm_bench.measure.timing import time_together
from hbvm_bench.reference.solutions import find
from integrators import Gauss, Leapfrog
from problems.errors import InputError


def measured_with(problem, method, checks, grid=None):
    program = method.compile(problem.system)
    times = (grid or Grid(count=200, spacing="log")).times(problem)
    solution = solve(problem, method, program, times)
    result, series = raw.of_solution(solution)
    reversal, more = raw.beside(solution, program, checks)
    result = msgspec.structs.replace(result, reversal=reversal)
    measured = measure(problem, result, series | more, find(problem))
    return measured, with_growth(measured, checks)


def of_ensemble(problem, program, asked):
    result, series = raw.ensemble(problem, program, asked)
    return measure(problem, result, series, ensemble=asked), result


def test_scaled_starts_keep_a_symmetric_start_symmetric():
    problem = problems.load("sitnikov")
    starts = scaled(problem, 5)
    assert np.array_equal(starts[0], problem.y0)
    assert len({row.tobytes() for row in starts}) == 5
    assert np.max(np.abs(starts / np.where(problem.y0 == 0, 1, problem.y0) - (problem.y0 != 0))) <= (
        1.0001 * PERTURBATION
    )
    assert np.array_equal(starts[:, 0:2], -starts[:, 3:5])  # the primaries opposite to each other
    assert not starts[:, 6:8].any()  # the planetoid on the axis


def test_a_cloud_begins_with_the_problem_and_fills_its_box():
    problem = problems.load("henon_heiles", q1=0.1)
    starts, _ = members(problem, Ensemble(count=4000, spread=0.01))
    assert np.array_equal(starts[0], problem.y0)
    x = (starts / problem.y0 - 1) / 0.01
    assert np.abs(x).max() <= 1 + 1e-12
    counts, _ = np.histogramdd(x, bins=(2, 2, 2, 2), range=[(-1, 1)] * 4)
    assert counts.min() > 200  # 250 each on average, 236 measured at least


def test_the_error_of_a_symplectic_method_is_bounded_and_its_phase_drifts():
    problem = problems.load("pendulum", t_end=500.0)
    measured, checked = measured_with(problem, Leapfrog(h=0.1, order=4), Checks(starts=3, reversal=0.2))
    growth = checked.growth["energy"]
    assert growth.kind == "bounded"
    assert growth.starts == 3
    assert checked.drift["energy"].shape == (3, checked.drift["t"].size)
    assert (checked.drift["energy"] < 0).any() != (checked.drift["energy"] > 0).all()
    assert checked.reversal < 1e-10  # 6.6e-13 measured
    metrics = evaluate(measured)
    assert 1e-6 < metrics["phase_max"].value < 1e-2  # 1.9e-3 measured


def test_the_phase_error_is_the_time_by_which_a_run_is_ahead():
    problem = problems.load("kepler")
    known = find(problem)
    program = Gauss(s=8, h=0.05).compile(problem.system)
    solution = solve(problem, Gauss(s=8, h=0.05), program, known.t)
    shifted = program.start(problem.y0).advance(np.append(known.t[1:] + 1e-5, problem.t_end + 1.0)).y[:-1]
    solution.y[1:] = shifted
    measured = measure(problem, *raw.of_solution(solution), known)
    # 1e-5 is the shift; within 9.2e-13 of it measured
    assert np.abs(measured.phase[1:] - 1e-5).max() < 1e-10


def test_a_run_that_fails_has_no_error_growth_and_says_why():
    problem = problems.load("henon_heiles", energy=2.0, t_end=200.0)  # escapes
    measured, checked = measured_with(problem, Gauss(s=2, h=0.5), Checks(starts=3))
    assert not measured.complete
    assert checked.growth["energy"].kind is None
    assert "ends at t = " in checked.growth["energy"].why


def test_an_ensemble_is_measured_against_the_ends_of_its_reference_subset():
    pytest.importorskip("heyoka")
    problem = problems.load("henon_heiles", energy=0.1, t_end=20.0)
    asked = Ensemble(count=40, spread=0.01)
    program = Gauss(s=8, h=0.5).compile(problem.system)
    measured, result = of_ensemble(problem, program, asked)
    assert measured.complete
    assert result.reason == ""
    assert measured.y.shape == (40, 4)
    assert measured.position.size == raw.WITNESSES == 32
    metrics = evaluate(measured)
    assert metrics["position_end"].value < 1e-14  # 1.6e-16 measured
    assert metrics["energy_max"].value < 1e-14  # 3.4e-16 measured
    assert metrics["throughput"].why == "not timed"
    run = EnsembleRun.compiled(problem, Gauss(s=8, h=0.5), program, asked)
    (timed,) = time_together([run], TimingPlan(rounds=2, budget=1), [0, 1])
    assert len(timed.samples) == 2
    # a method without a batch path takes one after the other, to the same end
    other, _ = of_ensemble(problem, Leapfrog(h=0.01, order=8).compile(problem.system), asked)
    assert np.abs(other.y - measured.y).max() < 1e-12  # 1.2e-14 measured


def test_parameters_of_an_ensemble_vary_by_their_names():
    pytest.importorskip("heyoka")
    problem = problems.load("morse", t_end=10.0)
    asked = Ensemble(count=9, spread=0.1, vary=(("D", 0.1), ("a", 0.2)))
    starts, par = members(problem, asked)
    assert np.array_equal(starts[0], problem.y0)
    assert np.array_equal(par[0], problem.par)
    assert np.ptp(par, axis=0).tolist() == pytest.approx([0.2, 0.4, 0.0], rel=0.3)
    measured, _ = of_ensemble(problem, Gauss(s=12, h=0.25).compile(problem.system), asked)
    assert measured.complete
    metrics = evaluate(measured)
    assert metrics["position_end"].value < 1e-14  # 5.7e-16 measured: the subset has its parameters
    assert metrics["energy_max"].value < 1e-14  # 3.4e-16 measured
    with pytest.raises(InputError, match="unknown parameter of morse"):
        members(problem, Ensemble(count=2, vary=(("depth", 0.1),)))
