"""The clock runs for the library's own work only: the sampling it recommends, and nothing of setting up."""

import gc
import time
from itertools import chain, repeat
from types import SimpleNamespace

import numpy as np
import pytest

import integrators
import problems
from hbvm_bench.campaign.file import Case, Ensemble, Limits, TimingPlan
from hbvm_bench.campaign.identity import make_method
from hbvm_bench.measure import ensemble, machine, timing
from hbvm_bench.run import task, worker
from hbvm_bench.store.records import Record
from integrators.protocol import MethodBase, Samples, Stats, Status
from problems.errors import InputError


class Noting:
    """A program that notes how it is asked to advance; a start takes 1000 s of its clock, advancing 1 s."""

    compile_seconds, from_cache = 0.0, None
    stats = Stats(steps=1, evaluations=1)

    def __init__(self):
        self.asked, self.now = [], 0.0

    def start(self, y0, par=None, t0=0.0):
        self.now += 1000.0
        return self

    def advance(self, times, *, sample=None):
        self.now += 1.0
        self.asked.append(sample)
        return Samples(times, np.zeros((1, 2)), Status.FINISHED)


class Landing(MethodBase):
    """A method that is at its best between steps, and whose library goes to an end by landing on it."""

    to_end = "stop"
    order = 1

    def accepts(self, problem):
        return None

    def compile(self, system):
        return Noting()


def test_a_run_goes_to_its_end_as_the_library_does():
    problem = problems.load("pendulum", t_end=1.0)
    run = timing.SingleRun.compiled(problem, Landing())
    run.until(0.5).seconds()
    run.seconds(2)
    assert run.program.asked == ["stop"] * 3
    assert (run.t_end, run.until(0.5).t_end) == (1.0, 0.5)
    assert timing.SingleRun.compiled(problem, integrators.Gauss(s=2, h=0.1)).sample is None


def test_making_a_stepper_is_outside_every_clock():
    problem, program = problems.load("pendulum", t_end=1.0), Noting()
    assert timing.SingleRun.compiled(problem, Landing(), program).seconds(3, lambda: program.now)[0] == 1.0
    starts = np.tile(problem.y0, (4, 1))
    assert ensemble.EnsembleRun(program, starts, problem, "stop").seconds(2, lambda: program.now)[0] == 4.0
    assert set(program.asked) == {"stop"}


class Batching(Noting):
    """A program whose batch takes 1000 s to prepare, and 1 s."""

    def prepare_batch(self, Y0, par=None, *, times, t0=0.0):
        self.now += 1000.0
        return lambda: self.went(len(Y0))

    def went(self, n):
        self.now += 1.0
        return SimpleNamespace(
            y=np.zeros((n, 1, 2)), status=[Status.FINISHED] * n, reason=[""], steps=np.ones(n)
        )


def test_preparing_a_batch_is_outside_the_clock():
    problem, program = problems.load("pendulum", t_end=1.0), Batching()
    starts = np.tile(problem.y0, (4, 1))
    assert ensemble.EnsembleRun(program, starts, problem, None).seconds(3, lambda: program.now)[0] == 1.0


@pytest.mark.parametrize("method", ["Gauss(s=4, h=0.1)", "Taylor(tol=1e-12)"])
def test_a_batch_is_prepared_before_it_runs(method):
    pytest.importorskip("heyoka")
    problem = problems.load("kepler", e=0.3, t_end=3.0)
    starts = problem.y0 * (1 + 1e-3 * np.arange(11))[:, None]
    program = make_method(method).compile(problem.system)
    go = program.prepare_batch(starts, problem.par, times=[1.0, 3.0])
    there, made = program.batch(starts, problem.par, times=[1.0, 3.0]), go()
    assert np.array_equal(made.y, there.y)
    assert np.array_equal(made.steps, there.steps)
    with pytest.raises(InputError, match="Y0 must have shape"):
        program.prepare_batch(np.empty((0, 4)), times=[1.0])


def test_a_case_s_clock_begins_when_all_is_compiled(monkeypatch):
    said = []

    class Late(Batching):
        def prepare_batch(self, Y0, par=None, *, times, t0=0.0):
            assert not said
            return super().prepare_batch(Y0, par, times=times, t0=t0)

    class Method(Landing):
        def compile(self, system):
            return Late()

    asked = Case(problem="pendulum()", method="", ensemble=Ensemble(count=3, spread=0.1))
    problem = problems.load("pendulum", t_end=1.0)
    resolved = SimpleNamespace(case=asked, id="1", method=Method(), problem=problem)
    monkeypatch.setattr(worker, "resolve", lambda case, known: resolved)
    monkeypatch.setattr(timing, "time_together", lambda runs, *_: [runs[0].program.now])
    row = Record(id="1", case=asked, role="ours", library="", order=1, result=task.NO_RESULT)
    request = task.Request(rows=[row], limits=Limits(), plan=TimingPlan())
    assert worker._answered(request, lambda: said.append(True), set(), machine.cores()).timings == b"[1000.0]"
    assert said


@pytest.mark.parametrize(("asked", "order"), [("alternating", "abbaab"), ("as given", "ababab")])
def test_no_sample_is_always_the_first_of_its_round(asked, order):
    taken = []

    def sample(name):
        taken.append(name)
        return float(len(taken))

    seconds = timing.interleaved([lambda: sample("a"), lambda: sample("b")], rounds=3, order=asked)
    assert "".join(taken) == order
    assert seconds == [[i + 1.0 for i, name in enumerate(order) if name == one] for one in "ab"]


def test_one_sample_has_no_quartiles():
    found = timing.Spread.from_samples([3.0, 3.0])
    assert found == timing.Spread(3.0, 3.0, 3.0)
    assert timing.Spread.from_samples([2.0]) == timing.Spread(2.0, None, None)


def test_timing_takes_the_integration_alone_and_restores_garbage_collection():
    run = timing.SingleRun.compiled(problems.load("kepler", e=0.6, t_end=3.0), integrators.Gauss(s=4, h=0.1))
    seconds, samples = run.seconds(3)
    assert seconds > 0
    assert samples.t.tolist() == [3.0]
    assert gc.isenabled()
    assert run.until(0.1).t_end == pytest.approx(0.3)


@pytest.mark.parametrize(("seconds", "repeats"), [(1.0, 1), (0.02, 1), (0.01, 3), (1e-3, 24)])
def test_short_runs_are_repeated_until_a_sample_is_long_enough(seconds, repeats):
    assert timing.repeats_for(seconds, 0.02) == repeats


def test_a_setting_too_slow_for_all_rounds_takes_part_in_some_of_them():
    assert timing.spread_evenly(3, range(9)) == [0, 3, 6]
    assert timing.spread_evenly(0, range(9)) == [0, 1]  # one chooses, the other compares
    assert timing.spread_evenly(0, range(1)) == [0]
    for rounds in range(2, 30):
        for count in range(40):
            chosen = timing.spread_evenly(count, range(rounds))
            assert sorted(set(chosen)) == chosen
            assert {*map(timing.chooses, chosen)} == {False, True}
            assert max(chosen) < rounds
    taken = timing.interleaved(
        [lambda: 1.0, lambda: 2.0], 3, takes_part=lambda i, number: i == 0 or number == 1
    )
    assert taken == [[1.0, 1.0, 1.0], [2.0]]


@pytest.mark.parametrize("compilations", [1, 2, 3, 5])
def test_the_rounds_of_a_plan_are_shared_so_that_no_compilation_both_chooses_and_compares(compilations):
    parts = timing.shared(20, compilations)
    assert len(parts) == compilations
    assert sorted(one for part in parts for one in part) == list(range(20))
    kinds = [{*map(timing.chooses, part)} for part in parts]
    assert kinds == [{True, False}] if compilations == 1 else all(len(kind) == 1 for kind in kinds)
    assert {kind for found in kinds for kind in found} == {True, False}
    assert timing.spread_evenly(0, parts[-1])[0] in parts[-1]


def test_shuffled_rounds_are_in_another_order_each_and_the_same_every_time():
    def order():
        seen = []
        samples = [lambda name=name: seen.append(name) or 1.0 for name in "abcdefgh"]
        timing.interleaved(samples, 2, order="shuffled", begin=seen.append)
        return seen

    first = order()
    assert first == order()
    assert (first[0], first[9]) == (0, 1)
    assert sorted(first[1:9]) == sorted(first[10:]) == list("abcdefgh")
    assert first[1:9] != first[10:]


def test_the_calibration_of_thread_times_is_by_the_same_clock(monkeypatch):
    asked = []
    monkeypatch.setattr(timing, "calibrate", lambda clock: asked.append(clock) or 0.01)
    plan = TimingPlan(rounds=2, clock="thread", shortest=1e-6)
    timing.time_together(
        [timing.SingleRun.compiled(problems.load("pendulum", t_end=1.0), Landing())], plan, [0, 1]
    )
    assert asked == 2 * [time.thread_time]


def test_a_calibration_by_the_clock_of_the_thread_leaves_out_what_others_do():
    timing.calibrate()  # compiled
    ticks = iter((3.0, 5.0))
    assert timing.calibrate(lambda: next(ticks)) == 2.0


@pytest.mark.parametrize(("lasts", "runs", "repeats"), [(1.0, [1, 1, 1], 1), (0.01, [1, 1, 3, 3, 3], 3)])
def test_the_first_run_of_a_long_integration_is_its_first_sample(monkeypatch, lasts, runs, repeats):
    ran = []
    monkeypatch.setattr(timing, "calibrate", lambda clock: 0.01)

    class Counted(timing.SingleRun):
        def seconds(self, repeats=1, clock=time.perf_counter):
            if self.t_end == 1.0:
                ran.append(repeats)
            return lasts, super().seconds(repeats, clock)[1]

    run = Counted.compiled(problems.load("pendulum", t_end=1.0), Landing())
    (taken,) = timing.time_together([run], TimingPlan(rounds=3, shortest=0.02, budget=100.0), [0, 1, 2])
    assert ran == runs
    assert [round_.repeats for round_ in taken.rounds] == [repeats] * 3


def test_what_is_loaded_at_a_first_close_encounter_is_in_no_sample(monkeypatch):
    monkeypatch.setattr(timing, "calibrate", lambda clock: 0.01)
    whole = chain([0.04], repeat(0.001))

    class Loading(timing.SingleRun):
        def seconds(self, repeats=1, clock=time.perf_counter):
            spent, samples = super().seconds(repeats, clock)
            return (next(whole) if self.t_end == 1.0 else spent), samples

    run = Loading.compiled(problems.load("pendulum", t_end=1.0), Landing())
    (taken,) = timing.time_together([run], TimingPlan(rounds=3), [0, 1, 2])
    assert taken.samples == [0.001] * 3
