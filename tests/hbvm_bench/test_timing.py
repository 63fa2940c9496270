"""The clock runs for the library's own work only: the sampling it recommends, and nothing of setting up."""

import numpy as np

import integrators
import problems
from hbvm_bench import ensemble, timing
from hbvm_bench.campaign import TimingPlan
from integrators.protocol import MethodBase, Samples, Stats, Status


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

    to_end = "land"
    order = 1

    def accepts(self, problem):
        return None

    def compile(self, system):
        return Noting()


def test_a_run_goes_to_its_end_as_the_library_does():
    problem = problems.load("pendulum", t_end=1.0)
    run = timing.Run.of(problem, Landing())
    run.until(0.5).seconds()
    run.seconds(2)
    assert run.program.asked == ["land"] * 3
    assert (run.t_end, run.until(0.5).t_end) == (1.0, 0.5)
    assert timing.Run.of(problem, integrators.Gauss(s=2, h=0.1)).sample is None


def test_making_a_stepper_is_outside_every_clock():
    problem, program = problems.load("pendulum", t_end=1.0), Noting()
    assert timing.Run.of(problem, Landing(), program).seconds(3, lambda: program.now)[0] == 1.0
    starts = np.tile(problem.y0, (4, 1))
    assert ensemble.EnsembleRun(program, starts, problem, "land").seconds(2, lambda: program.now)[0] == 4.0
    assert set(program.asked) == {"land"}


def test_a_campaign_s_round_is_of_such_runs(monkeypatch):
    seen = []
    monkeypatch.setattr(timing, "sampled", lambda run, program, plan: seen.append(run) or "not timed")
    timing.time_round(problems.load("pendulum", t_end=1.0), Landing(), TimingPlan())
    assert [run.sample for run in seen] == ["land"]
