"""Batches: trajectories in lanes, and one by one where lanes cannot take them."""

from dataclasses import replace
from threading import current_thread
from time import perf_counter

import numpy as np
import pytest

import problems
from integrators import HBVM, integrate
from integrators.coefficients.legendre import legendre
from integrators.kernel import batch
from integrators.kernel.batch import Work
from integrators.kernel.ensemble import prepared
from integrators.kernel.ensemble.prepared import in_powers
from integrators.kernel.plan import Plan
from integrators.kernel.program import HBVMProgram
from integrators.protocol import Status
from problems import Hamiltonian, Problem, VectorField
from problems.errors import InputError
from tests.hbvm_bench.study_folders import module

lattice = module("costs", "lattice").lattice

rng = np.random.default_rng(7)


def begun(program, y, par=None, *, end):
    stepper = program.start(y, par)
    stepper.destination = end  # no step passes it
    return stepper


def singles(program, starts, parameters, times, **options):
    samples = [
        begun(program, y, par, end=times[-1]).advance(times, **options)
        for y, par in zip(starts, parameters, strict=True)
    ]
    return np.array([sample.y for sample in samples])


def distance(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


@pytest.mark.parametrize(
    ("k", "s", "form", "sample"),
    [(18, 2, None, "partial"), (8, 8, None, "stop"), (16, 9, None, "dense"), (6, 2, "first", "stop")],
)
def test_what_goes_one_by_one_is_its_trajectories_bit_for_bit(k, s, form, sample):
    problem = problems.load("kepler", e=0.5)
    program = HBVMProgram(problem.system, Plan(k=k, s=s, h=0.125, form=form))
    starts = problem.y0 * (1 + 0.05 * rng.normal(size=(5, 4)))
    times = np.array([0.0, 0.5, 1.3, 2.0, 7.77])
    batch = program.batch(starts, times=times, sample=sample)
    assert batch.status == [Status.FINISHED] * 5
    assert np.array_equal(batch.y, singles(program, starts, [problem.par] * 5, times, sample=sample))


@pytest.mark.parametrize(
    ("k", "s", "form"),
    [(1, 1, None), (2, 2, "first"), (8, 8, None), (6, 2, "first"), (12, 12, "first"), (16, 9, None)],
)
def test_trajectories_in_lanes_are_those_of_integrate_up_to_rounding(k, s, form):
    problem = problems.load("kepler", e=0.5)
    program = HBVMProgram(problem.system, Plan(k=k, s=s, h=0.125, form=form))
    assert program.in_lanes() is not None
    starts = problem.y0 * (1 + 0.05 * rng.normal(size=(11, 4)))
    times = np.array([0.0, 0.5, 1.3, 2.0, 7.77])  # ends of steps, and times between them
    batch = program.batch(starts, times=times)
    assert batch.status == [Status.FINISHED] * 11
    expected = singles(program, starts, [problem.par] * 11, times)
    assert distance(batch.y, expected) < 3e-14  # measured 4e-15
    assert batch.steps.tolist() == [62] * 11
    assert (batch.evaluations == k * batch.iterations).all()


SYSTEMS = {
    "planets": ("outer_solar_system", 1.0, [-10.0, -37.5]),  # masses, blocks of three, a loop over stages
    "chain": ("fput", 0.25, [3.3, 10.0]),
    "pendulum": ("double_pendulum", 0.05, [0.73, 2.0]),  # not separable: first-order form
    "rotating": ("cr3bp", 0.001, [0.05]),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_all_kinds_of_systems_run_in_lanes(name):
    problem_name, h, times = SYSTEMS[name]
    problem = problems.load(problem_name)
    program = HBVMProgram(problem.system, Plan(k=8, s=8, h=h))
    starts = problem.y0 * (1 + 1e-3 * rng.normal(size=(3, 1)))
    parameters = np.tile(problem.par, (3, 1))
    parameters[1] *= 1.001
    batch = program.batch(starts, parameters, times=times)
    assert program.in_lanes() is not None
    assert batch.status == [Status.FINISHED] * 3
    expected = singles(program, starts, parameters, times)
    assert distance(batch.y, expected) < 1e-13  # measured: planets 2e-15, chain, pendulum, rotating 6e-15


def test_time_is_each_stages_own():
    def f(t, y, par, m):
        return [y[1], -y[0] + par["a"] * m.sin(par["w"] * t)]

    system = VectorField(f, dim=2, parameters={"a": 0.5, "w": 2.0})
    program = HBVMProgram(system, Plan(k=6, s=6, h=0.25))
    parameters = np.array([[0.5, 2.0], [0.1, 3.0], [0.7, 0.3]])
    starts = np.tile([1.0, 0.0], (3, 1))
    batch = program.batch(starts, parameters, times=[5.1, 20.0], t0=1.0)
    pairs = zip(starts, parameters, strict=True)
    expected = np.array([program.start(y, par, 1.0).advance([5.1, 20.0]).y for y, par in pairs])
    assert distance(batch.y, expected) < 1e-13  # measured 3e-15


@pytest.mark.parametrize("t0", [2.0**36, 1e9, -1e9])
def test_times_far_from_0_are_the_same_in_lanes_and_alone(t0):
    system = VectorField(lambda t, y, m: [y[1] + m.sin(300 * t), -y[0]], dim=2)
    program = HBVMProgram(system, Plan(k=8, s=4, h=0.1))
    times = t0 + np.array([0.337, 0.771, 1.109, 1.26])  # between steps
    batch = program.batch([[1.0, 0.0]] * 3, times=times, t0=t0)
    alone = program.start([1.0, 0.0], None, t0).advance(times)
    # Measured 1e-16. Where partial steps dropped what t0 + n h lacks as a double: 2e-5 and 9e-7.
    assert np.abs(batch.y - alone.y).max() < 1e-15


@pytest.mark.parametrize(("name", "k", "h"), [("kepler", 12, 0.2), ("outer_solar_system", 8, 100.0)])
def test_a_trajectory_is_the_same_bits_alone_in_any_place_and_on_any_threads(name, k, h):
    problem = problems.load(name)
    program = HBVMProgram(problem.system, Plan(k=k, s=8, h=h))
    starts = problem.y0 * (1 + 0.1 * rng.uniform(-1, 1, size=(21, 1)))
    parameters = problem.par * (1 + 0.1 * rng.uniform(-1, 1, size=(21, 1)))
    starts[3] *= 40.0  # one that needs few iterations, one that leaves and does not arrive
    starts[7] *= 1e-4
    times = np.array([3.0, 7.3]) * h
    whole = program.batch(starts, parameters, times=times)
    assert whole.status[7].failed
    for order in (rng.permutation(21), np.arange(21)[::-1], [5], [3, 5], [7, 3, 5, 8, 8, 8, 7, 7, 8, 7]):
        for threads in (1, 2, 3):
            part = program.batch(starts[order], parameters[order], times=times, threads=threads)
            assert np.array_equal(part.y, whole.y[order], equal_nan=True)
            assert part.iterations.tolist() == whole.iterations[order].tolist()


def test_energy_is_conserved_as_by_integrate():
    problem = problems.load("henon_heiles", energy=0.125, q2=0.1)
    program = HBVMProgram(problem.system, Plan(k=8, s=8, h=0.5))
    starts = problem.y0 * (1 + 0.01 * rng.normal(size=(8, 4)))
    batch = program.batch(starts, times=[2000.0])
    for start, end in zip(starts, batch.y[:, 0], strict=True):
        before, after = (problem.invariants(y[np.newaxis])["energy"][0] for y in (start, end))
        assert abs(after / before - 1) < 2e-14  # measured 6e-15: 4000 steps, rounding alone


def test_small_rows_beside_larger_ones_that_move_do_not_keep_a_lane_iterating():
    problem = lattice(50)
    starts = np.zeros((8, 100))
    starts[:, 25] = np.linspace(0.9, 1.1, 8)  # all other places begin at 0
    batch = HBVMProgram(problem.system, Plan(k=8, s=4, h=0.2)).batch(starts, times=[10.0])
    per_step = batch.iterations / batch.steps
    assert per_step.mean() < 16.65  # measured 16.545; without the movement of rows in their sizes 16.765


def test_the_order_is_that_of_the_method():
    problem = problems.load("henon_heiles")
    ends = [
        HBVMProgram(problem.system, Plan(k=4, s=2, h=h)).batch([problem.y0], times=[4.0]).y[0, 0]
        for h in (0.2, 0.1, 0.05)
    ]
    coarse, fine = (np.abs(ends[i] - ends[i + 1]).max() for i in (0, 1))
    assert 14.0 < coarse / fine < 18.0  # order 4: measured 16.0


@pytest.mark.parametrize(
    ("name", "values", "unrolled"),
    [
        ("toda", {}, False),
        ("toda", {"n": 4}, True),
        ("double_pendulum", {}, True),
        ("figure_eight", {}, True),
    ],
)
def test_rows_with_many_functions_are_not_written_out(name, values, unrolled):
    # Eight exponentials of eight rows: 4 times as long to compile and 7 % more time, where they are.
    system = problems.load(name, **values).system
    rows = system.dof if system.separable else system.dim
    assert prepared.unrolled_for(system, system.separable, 8, rows) is unrolled


def test_one_failure_leaves_the_others_alone():
    def H(q, p, m):
        return p[0] * p[0] / 2 - q[0] * m.sqrt(q[0])

    problem = Problem(Hamiltonian(H, dof=1, name="root"), q0=[1.0], p0=[0.0], t_end=4.0)
    program = HBVMProgram(problem.system, Plan(k=4, s=4, h=0.25))
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
    assert distance(batch.y[2], program.start(starts[2]).advance(times).y) < 1e-14  # measured 3e-16


@pytest.mark.parametrize(("k", "least"), [(4, 1.1430584637800507), (8, 1.1603599094588546)])
def test_what_becomes_no_number_in_the_last_sweeps_is_a_failure_of_its_lane(k, least):
    h = 0.1
    # The first component is the time. In the first step the second rises towards the third, which for some
    # trajectories is too small by rounding: there the first has no rate any more in iterations without a
    # test.
    system = VectorField(
        lambda t, y, m: [1.0 + 0.0 * m.sqrt(y[2] - y[1] + (t / h) ** 20), 2.0 * y[1], 0.0 * y[2]], dim=3
    )
    near = least + np.arange(-100, 100) * np.spacing(least)
    starts = np.stack([0.0 * near, 0.0 * near + 1.0, near], axis=1)
    batch = HBVMProgram(system, Plan(k=k, s=4, h=h)).batch(starts, times=[5 * h])
    finished = np.array([status is Status.FINISHED for status in batch.status])
    assert 0 < finished.sum() < 200
    assert np.abs(batch.y[finished, 0, 0] - 5 * h).max() < 1e-15  # measured 0; or else a step


def test_starts_and_parameters_of_the_wrong_shape_are_refused():
    problem = problems.load("kepler", e=0.5)
    program = HBVMProgram(problem.system, Plan(k=4, s=4, h=0.1))
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
    program = HBVMProgram(problem.system, Plan(k=4, s=2, h=0.5, solver=solver))
    starts = [problem.y0, 0.5 * problem.y0]
    times = np.array([2.3, 10.0])
    batch = program.batch(starts, times=times)
    steppers = [program.start(y) for y in starts]
    expected = [stepper.advance(times).y for stepper in steppers]
    assert all("implicit" in stepper.stats.extra for stepper in steppers)
    assert batch.status == [Status.FINISHED] * 2
    assert np.array_equal(batch.y, expected)
    assert batch.iterations.tolist() == [stepper.stats.iterations for stepper in steppers]


def test_a_system_too_large_for_lanes_goes_one_by_one(monkeypatch):
    monkeypatch.setattr(prepared, "ROOM", 10)
    problem = problems.load("kepler", e=0.5)
    program = HBVMProgram(problem.system, Plan(k=8, s=4, h=0.1))
    assert program.in_lanes() is None
    batch = program.batch([problem.y0], times=[1.0])
    assert np.array_equal(batch.y[0], program.start(problem.y0).advance([1.0]).y)


def test_a_batch_whose_members_have_all_failed_is_at_its_end():
    program = HBVMProgram(problems.load("kepler").system, Plan(k=8, s=4, h=0.1))
    program.in_lanes()  # compiled
    started = perf_counter()
    batch = program.batch([[1.0, 0.0, 0.0, 0.0]] * 2, times=[0.5, 1e10])
    assert perf_counter() - started < 10.0  # measured 0.06 s; 22 minutes if every step is counted
    assert [status.failed for status in batch.status] == [True, True]
    assert np.isfinite(batch.y[:, 0]).all()


@pytest.mark.parametrize("solver", ["newton", "blended"])
def test_threads_share_the_work_of_an_implicit_solver_too(monkeypatch, solver):
    problem = problems.load("kepler", e=0.5)
    program = HBVMProgram(problem.system, Plan(k=8, s=4, h=0.1, solver=solver))
    starts = problem.y0 * (1 + 0.05 * rng.normal(size=(6, 4)))
    alone, inner, names = program.batch(starts, times=[1.0]).y, Work.alone, set()

    def watched(self, i):
        names.add(current_thread().name)
        return inner(self, i)

    monkeypatch.setattr(Work, "alone", watched)
    assert np.array_equal(program.batch(starts, times=[1.0], threads=2).y, alone)
    assert names
    assert current_thread().name not in names


OWN = {
    "eccentric": ("kepler", {"e": 0.9}, [3.0, 7.0, 20.0], 1e-12),  # measured 1.2e-13
    "planets": (
        "outer_solar_system",
        {},
        [300.0, 1000.0],
        4e-11,
    ),  # measured 6e-12; each is 6e-12 from the 128-bit solution
    "pendulum": ("double_pendulum", {}, [0.73, 0.74, 10.0], 3e-14),  # first-order form; measured 3e-15
    "oscillator": ("morse", {}, [-1.0, -30.0], 1e-13),  # backwards; measured 1.1e-14
}


@pytest.mark.parametrize("name", OWN)
def test_trajectories_with_adaptive_steps_in_lanes_are_those_of_integrate_up_to_the_tolerance(name):
    problem_name, values, times, close = OWN[name]
    problem = problems.load(problem_name, **values)
    program = HBVMProgram(problem.system, Plan(k=16, s=14, tol=1e-15))
    starts = problem.y0 * (1 + 1e-2 * rng.normal(size=(20, 1)))
    parameters = problem.par * (1 + 1e-2 * rng.normal(size=(20, 1)))
    batch = program.batch(starts, parameters, times=times)
    assert program.in_lanes() is not None
    assert batch.status == [Status.FINISHED] * 20
    expected = singles(program, starts, parameters, times)
    assert distance(batch.y, expected) < close
    alone = program.start(starts[0], parameters[0])
    alone.advance(times[-1:])
    assert batch.steps[0] == pytest.approx(alone.stats.steps, abs=4 + 4 * len(times))  # measured 8
    assert (batch.evaluations == 16 * batch.iterations).all()


@pytest.mark.parametrize("name", ["kepler", "double_pendulum"])
def test_adaptive_steps_in_lanes_are_the_same_bits_in_any_place_and_on_any_threads(name):
    problem = problems.load(name)
    program = HBVMProgram(problem.system, Plan(k=8, s=7, tol=1e-12))
    n = 50  # lanes take up several, one after another
    starts = problem.y0 * (1 + 0.05 * rng.uniform(-1, 1, size=(n, 1)))
    parameters = problem.par * (1 + 0.1 * rng.uniform(-1, 1, size=(n, 1)))
    times = [0.0, 0.3, 0.31, 5.0, 20.0]
    whole = program.batch(starts, parameters, times=times)
    for order in (rng.permutation(n), [5], [3, 5], [7, 3, 5, 8, 8, 8, 7, 7, 8, 7]):
        for threads in (1, 2):
            part = program.batch(starts[order], parameters[order], times=times, threads=threads)
            assert np.array_equal(part.y, whole.y[order])
            assert part.steps.tolist() == whole.steps[order].tolist()
            assert part.iterations.tolist() == whole.iterations[order].tolist()


def test_few_lanes_are_idle_while_trajectories_of_several_jobs_are_left(monkeypatch):
    class Every(batch.Pace):
        """Has every step of all lanes return."""

        @property
        def steps(self):
            return 1

        @steps.setter
        def steps(self, _):
            calls.append(1)

    calls = []
    monkeypatch.setattr(batch, "Pace", Every)
    morse = problems.load("morse", t_end=8.0)
    program = HBVMProgram(morse.system, Plan(k=8, s=7, tol=1e-10))
    n, depths = 1024, np.linspace(0.7, 1.3, 1024)
    par = np.tile(morse.par, (n, 1))
    par[:, 0] *= np.random.default_rng(1).permutation(depths)
    made = program.batch(np.tile(morse.y0, (n, 1)), par, times=[8.0])
    width = program.in_lanes().width
    # .93; .87 where all lanes waited for the last trajectory of each job
    assert made.steps.sum() > 0.9 * width * len(calls)


def test_adaptive_steps_keep_the_energy_of_eccentric_orbits():
    problem = problems.load("kepler", e=0.9)
    program = HBVMProgram(problem.system, Plan(k=16, s=14, tol=1e-15))
    starts = problem.y0 * (1 + 1e-3 * rng.normal(size=(8, 1)))
    batch = program.batch(starts, times=[628.0])
    for start, end in zip(starts, batch.y[:, 0], strict=True):
        before, after = (problem.invariants(y[np.newaxis])["energy"][0] for y in (start, end))
        assert abs(after / before - 1) < 5e-13  # measured 6e-14: 2200 steps


def test_with_adaptive_steps_too_one_failure_leaves_the_others_alone():
    def H(q, p, m):
        return p[0] * p[0] / 2 - q[0] * m.sqrt(q[0])

    problem = Problem(Hamiltonian(H, dof=1, name="root"), q0=[1.0], p0=[0.0], t_end=4.0)
    program = HBVMProgram(problem.system, Plan(k=8, s=7, tol=1e-12))
    starts = [[1.0, 0.0], [1.0, -2.0], [2.0, 0.5]]  # the second crosses q = 0
    times = np.arange(0.5, 4.1, 0.5)
    batch = program.batch(starts, times=times)
    assert batch.status[0] is batch.status[2] is Status.FINISHED
    alone = program.start(starts[1]).advance(times)
    assert batch.status[1] is alone.status
    assert batch.status[1].failed
    assert np.array_equal(batch.y[1, : alone.t.size], alone.y)
    assert np.isnan(batch.y[1, alone.t.size :]).all()


def test_a_kink_and_a_stiff_system_go_one_by_one_from_adaptive_steps():
    def f(t, y, m):
        return [y[1], -y[0] - m.abs(y[0] - 0.3)]

    kinked = HBVMProgram(VectorField(f, dim=2), Plan(k=8, s=6, tol=1e-10))

    def g(t, y, m):
        return [-1e4 * (y[0] - m.cos(t))]

    stiff = HBVMProgram(VectorField(g, dim=1), Plan(k=8, s=4, tol=1e-6))
    for program, starts in ((kinked, np.array([[1.0, 0.0], [0.9, 0.1]])), (stiff, np.array([[1.0], [0.5]]))):
        batch = program.batch(starts, times=[10.0])
        assert (program.in_lanes() is None) == (program is kinked)
        assert batch.status == [Status.FINISHED] * len(starts)
        steppers = [begun(program, y, end=10.0) for y in starts]
        assert np.array_equal(batch.y, [stepper.advance([10.0]).y for stepper in steppers])
        extra = steppers[0].stats.extra
        assert extra["kinks"] if program is kinked else "implicit" in extra


def test_each_of_many_times_costs_a_step_in_a_lane():
    problem = problems.load("kepler", e=0.99)
    program = HBVMProgram(problem.system, Plan(k=16, s=14, tol=1e-15))
    times = np.linspace(0.0, 12.5, 501)[1:]
    stepper = program.start(problem.y0)
    expected = stepper.advance(times).y
    batch = program.batch([problem.y0], times=times)
    assert stepper.stats.steps < 100 < 500 <= batch.steps[0] < 600  # measured 59 and 546
    assert distance(batch.y[0], expected) < 1e-10  # measured 5e-12


def test_what_is_next_to_nothing_leaves_its_lane():
    program = HBVMProgram(VectorField(lambda y: [y[1], -y[0] - y[1]], dim=2), Plan(k=8, s=7, tol=1e-12))
    starts = np.array([[1.0, 0.0], [1.1, 0.0], [0.0, 0.0]])  # the last one stays at rest, in its lane
    batch = program.batch(starts, times=[1350.0])
    assert batch.status == [Status.FINISHED] * 3
    assert 0.0 < np.abs(batch.y[:2]).max() < 1e-285  # e^-675 is 7e-294
    assert np.array_equal(
        batch.y[:2], [begun(program, y, end=1350.0).advance([1350.0]).y for y in starts[:2]]
    )
    assert batch.steps.max() < 2000  # measured 898; in its lane, millions


def test_where_something_else_says_where_steps_end_they_go_one_by_one():
    system = problems.load("kepler").system
    plan = Plan(k=8, s=7, tol=1e-10)
    for more in (replace(plan, max_step=0.1), replace(plan, max_steps=10), replace(plan, breakpoints=[1.0])):
        assert HBVMProgram(system, more).in_lanes() is None


@pytest.mark.parametrize("k", [7, 8, 16])
def test_powers_of_the_next_steps_polynomial_are_those_of_legendre(k):
    x = np.array([1.0, -1.0, -0.4, 1.7, 2.9, 4.0])
    *factors, at_end = in_powers(k)
    rows = (x[:, np.newaxis] ** np.arange(k) @ factors).T
    expected = legendre((x + 1.0) / 2.0, k).T
    scale = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(rows - expected) / scale).max() < 3e-15  # measured 3.1e-16
    assert np.abs(at_end - expected[:, 0]).max() < 1e-14  # measured 4.4e-15


def test_an_odd_number_of_stages_starts_its_steps_as_well_in_lanes():
    problem = problems.load("kepler", e=0.3)
    method = HBVM(k=7, s=5, tol=1e-11)
    starts = np.tile(problem.y0, (8, 1))
    alone = integrate(problem, method, times=[50.0])
    together = method.compile(problem.system).batch(starts, times=np.array([50.0]))
    assert together.iterations[0] < 1.2 * alone.stats.iterations  # 839 and 1,064
