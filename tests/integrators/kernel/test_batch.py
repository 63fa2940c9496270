"""A batch is, bit for bit, its trajectories one by one."""

from threading import current_thread
from time import perf_counter

import numpy as np
import pytest

import problems
from integrators.kernel.batch import _Work
from integrators.kernel.program import HBVMProgram
from integrators.protocol import Status
from problems import Hamiltonian, Problem
from problems.errors import InputError

rng = np.random.default_rng(7)


def singles(program, starts, parameters, times, **options):
    samples = [
        program.start(y, par).advance(times, **options) for y, par in zip(starts, parameters, strict=True)
    ]
    return np.array([sample.y for sample in samples])


@pytest.mark.parametrize("sample", ["side", "land", "dense"])
@pytest.mark.parametrize(("k", "s", "form"), [(8, 8, None), (6, 2, "first"), (16, 9, None), (18, 2, None)])
def test_a_batch_is_its_trajectories_bit_for_bit(k, s, form, sample):
    problem = problems.load("kepler", e=0.5)
    program = HBVMProgram(problem.system, k=k, s=s, h=0.125, form=form)
    starts = problem.y0 * (1 + 0.05 * rng.normal(size=(5, 4)))
    times = np.array([0.0, 0.5, 1.3, 2.0, 7.77])
    batch = program.batch(starts, times=times, sample=sample)
    assert batch.status == [Status.FINISHED] * 5
    expected = singles(program, starts, [problem.par] * 5, times, sample=sample)
    assert np.array_equal(batch.y, expected)


def test_parameters_may_differ_and_time_may_run_backwards():
    problem = problems.load("outer_solar_system")
    program = HBVMProgram(problem.system, k=8, s=8, h=1.0)
    starts = np.tile(problem.y0, (4, 1))
    parameters = np.tile(problem.par, (4, 1))
    parameters[:, 1] *= [1.0, 1.5, 0.5, 2.0]  # Jupiter's mass, and with it its velocity
    times = np.array([-10.0, -37.5])
    batch = program.batch(starts, parameters, times=times)
    expected = singles(program, starts, parameters, times)
    assert np.array_equal(batch.y, expected)
    assert len({row[1, 3] for row in batch.y}) == 4


@pytest.mark.parametrize("members", [1, 2, 3, 4])
def test_any_number_goes_together_and_on_any_number_of_threads(monkeypatch, members):
    from integrators.kernel import batch as module

    problem = problems.load("henon_heiles")
    program = HBVMProgram(problem.system, k=8, s=4, h=0.5)
    starts = problem.y0 * (1 + 0.01 * rng.normal(size=(7, 4)))
    times = np.array([10.0, 40.25])
    expected = singles(program, starts, [problem.par] * 7, times)
    monkeypatch.setattr(module, "members_for", lambda rows, route: members)
    for threads in (1, 2, 3):
        batch = program.batch(starts, times=times, threads=threads)
        assert np.array_equal(batch.y, expected)
    assert batch.steps.tolist() == [80] * 7
    single = program.start(starts[3])
    single.advance(times)
    assert batch.iterations[3] == single.stats.iterations
    assert batch.evaluations[3] == single.stats.evaluations


def test_one_failure_leaves_the_others_alone():
    def H(q, p, m):
        return p[0] * p[0] / 2 - q[0] * m.sqrt(q[0])

    problem = Problem(Hamiltonian(H, dof=1, name="root"), q0=[1.0], p0=[0.0], t_end=4.0)
    program = HBVMProgram(problem.system, k=4, s=4, h=0.25)
    starts = [[1.0, 0.0], [1.0, -2.0], [2.0, 0.5]]  # the second crosses q = 0
    times = np.arange(0.5, 4.1, 0.5)
    batch = program.batch(starts, times=times)
    assert batch.status[0] is batch.status[2] is Status.FINISHED
    assert batch.status[1].failed
    assert "t = " in batch.reason[1]
    assert 0.25 <= batch.t_stop[1] < 1.5
    alone = program.start(starts[1]).advance(times)
    assert np.array_equal(batch.y[1, : alone.t.size], alone.y)
    assert np.isnan(batch.y[1, alone.t.size :]).all()
    assert np.array_equal(batch.y[2], program.start(starts[2]).advance(times).y)


def test_starts_and_parameters_of_the_wrong_shape_are_refused():
    problem = problems.load("kepler", e=0.5)
    program = HBVMProgram(problem.system, k=4, s=4, h=0.1)
    for starts in ([[1.0, 2.0]], [], np.zeros((2, 2, 4)), [[1.0, 0.0, np.nan, 0.0]]):
        with pytest.raises(InputError):
            program.batch(starts, times=[1.0])
    with pytest.raises(InputError, match="par must have shape"):
        program.batch([problem.y0] * 2, np.ones((3, 1)), times=[1.0])
    with pytest.raises(InputError, match="sampling"):
        program.batch([problem.y0], times=[1.0], sample="steps")


@pytest.mark.parametrize("solver", ["auto", "newton"])
def test_what_needs_the_implicit_solver_is_in_a_batch_as_it_is_alone(solver):
    problem = problems.load("stiff_chain")
    program = HBVMProgram(problem.system, k=4, s=2, h=0.5, solver=solver)
    starts = [problem.y0, 0.5 * problem.y0]
    times = np.array([2.3, 10.0])
    batch = program.batch(starts, times=times)
    steppers = [program.start(y) for y in starts]
    expected = [stepper.advance(times).y for stepper in steppers]
    assert all("implicit" in stepper.stats.extra for stepper in steppers)
    assert batch.status == [Status.FINISHED] * 2
    assert np.array_equal(batch.y, expected)
    assert batch.iterations.tolist() == [stepper.stats.iterations for stepper in steppers]


def test_a_batch_whose_members_have_all_failed_is_at_its_end():
    program = HBVMProgram(problems.load("kepler").system, k=8, s=4, h=0.1)
    started = perf_counter()
    batch = program.batch([[1.0, 0.0, 0.0, 0.0]] * 2, times=[0.5, 1e10])
    assert perf_counter() - started < 10.0  # measured 0.06 s; 22 minutes if every step is counted
    assert [status.failed for status in batch.status] == [True, True]
    assert np.isfinite(batch.y[:, 0]).all()


@pytest.mark.parametrize("solver", ["newton", "blended"])
def test_threads_share_the_work_of_an_implicit_solver_too(monkeypatch, solver):
    problem = problems.load("kepler", e=0.5)
    program = HBVMProgram(problem.system, k=8, s=4, h=0.1, solver=solver)
    starts = problem.y0 * (1 + 0.05 * rng.normal(size=(6, 4)))
    alone, inner, names = program.batch(starts, times=[1.0]).y, _Work.alone, set()

    def watched(self, i):
        names.add(current_thread().name)
        return inner(self, i)

    monkeypatch.setattr(_Work, "alone", watched)
    assert np.array_equal(program.batch(starts, times=[1.0], threads=2).y, alone)
    assert names
    assert current_thread().name not in names
