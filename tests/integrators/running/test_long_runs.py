"""Progress, Ctrl-C, checkpoints in files, and going on from them with the same bits."""

import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from time import monotonic, sleep

import numpy as np
import pytest

import problems
from integrators import (
    DOP853,
    HBVM,
    IAS15,
    Dopri8,
    Event,
    Gauss,
    Leapfrog,
    LineIntegral,
    Radau,
    Status,
    Taylor,
    WHFast,
    integrate,
)
from integrators.running import watch
from integrators.stepping import FixedStep
from problems import InputError


@dataclass(frozen=True, kw_only=True, repr=False)
class Euler(FixedStep):
    """Symplectic Euler, as a user writes it."""

    order = 1

    def march(self, system):
        def steps(t, h, first, n, y, par):
            for _ in range(n):
                y[1] -= h * np.sin(y[0])
                y[0] += h * y[1]

        return steps


FIGURE_EIGHT = [
    HBVM(),
    HBVM(k=6, s=3, h=0.02),
    HBVM(k=4, s=2, h=0.02, solver="newton"),
    HBVM(k=4, s=2, tol=1e-9, solver="blended"),
    Gauss(s=3, h=0.02),
    Gauss(s=4, tol=1e-10, breakpoints=[1.0, 2.5]),
    LineIntegral(k=6, s=3, h=0.02, invariants=["energy", "angular_momentum"]),
    LineIntegral(k=8, s=3, tol=1e-9, invariants=["energy"]),
    Taylor(),
    IAS15(mode="global"),
    Leapfrog(h=0.01, order=4),
    Dopri8(rtol=1e-9, atol=1e-9),
    Dopri8(h=0.01),
    DOP853(rtol=1e-9, atol=1e-9),
    Radau(rtol=1e-8, atol=1e-8),
]
CASES = [("figure_eight", method) for method in FIGURE_EIGHT]
CASES += [
    ("rigid_body", HBVM(k=6, s=3, h=0.05)),
    ("rigid_body", HBVM()),
    ("outer_solar_system", WHFast(h=0.02)),
]
CASES += [("pendulum", Euler(h=0.01)), ("charged_particle", HBVM())]


class Breaks:
    """Ctrl-C at the n-th look."""

    def __init__(self, n):
        self.left = n

    def __call__(self, progress):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


def broken_and_resumed(path, *arguments, breaks=(3, 4), **options):
    """Return the solution after some breaks, each gone on from by a new integration."""
    for n in breaks:
        part = integrate(
            *arguments, **options, checkpoint=path, every_seconds=0, resume=path, progress=Breaks(n)
        )
        assert part.status is Status.INTERRUPTED
        assert part.reason.startswith("Ctrl-C was pressed")
    return integrate(*arguments, **options, resume=path)


def assert_same(solution, other):
    assert solution.t.tobytes() == other.t.tobytes()
    assert solution.y.tobytes() == other.y.tobytes()
    assert (solution.status, solution.reason, solution.t_stop) == (other.status, other.reason, other.t_stop)
    assert solution.stats.steps == other.stats.steps
    assert solution.events.keys() == other.events.keys()
    for name, found in solution.events.items():
        for key in ("t", "y", "direction"):
            assert getattr(found, key).tobytes() == getattr(other.events[name], key).tobytes()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.checkpoint"


class TestResume:
    @pytest.mark.parametrize(("name", "method"), CASES, ids=lambda case: repr(case))
    @pytest.mark.parametrize("many", [True, False], ids=["many samples", "only the end"])
    def test_the_same_bits_as_without_a_break(self, name, method, many, path):
        problem = problems.load(name)
        times = np.sort(np.random.default_rng(3).uniform(0.1, 4.0, 60)) if many else [4.0]
        whole = integrate(problem, method, times=times)
        assert whole.status is Status.FINISHED
        lands = getattr(method.compile(problem.system).start(problem.y0), "samplings", [""])[0] == "stop"
        if not many and lands:
            return  # a method that lands on every time is not looked at between
        assert_same(broken_and_resumed(path, problem, method, times=times), whole)

    @pytest.mark.parametrize("sample", ["steps", "stop", "dense", "partial"])
    @pytest.mark.parametrize(
        "method",
        [HBVM(), HBVM(k=6, s=3, h=0.03), LineIntegral(k=6, s=3, h=0.03, invariants=["energy"])],
        ids=repr,
    )
    def test_each_sampling(self, sample, method, path):
        problem = problems.load("kepler")
        times = np.append(problem.t0, np.sort(np.random.default_rng(3).uniform(0.1, 4.0, 60)))
        whole = integrate(problem, method, times=times, sample=sample)
        assert_same(broken_and_resumed(path, problem, method, times=times, sample=sample), whole)

    @pytest.mark.parametrize("method", [HBVM(), HBVM(k=6, s=3, h=0.05), Gauss(s=4, tol=1e-11)], ids=repr)
    @pytest.mark.parametrize("breaks", [(1, 1), (2, 3), (5,)], ids=str)
    def test_events(self, method, breaks, path):
        problem = problems.load("henon_heiles")
        events = [Event(lambda q: q[0], name="section"), Event(lambda p: p[1], terminal=50, name="turn")]
        options = {"times": np.linspace(0.0, 1000.0, 101), "events": events}
        whole = integrate(problem, method, **options)
        assert whole.status is Status.EVENT
        assert_same(broken_and_resumed(path, problem, method, breaks=breaks, **options), whole)
        again = integrate(problem, method, **options, resume=path)
        assert again.stats.extra["event_search"] == whole.stats.extra["event_search"]

    def test_backwards(self, path):
        problem = problems.load("kepler")
        times = -np.linspace(0.0, 5.0, 40)
        whole = integrate(problem, HBVM(), times=times)
        assert_same(broken_and_resumed(path, problem, HBVM(), times=times), whole)

    def test_a_failure_stays_one(self, path):
        problem = problems.Problem(problems.VectorField(lambda y: [y[0] ** 2], dim=1), y0=[1.0], t_end=2.0)
        whole = integrate(problem, HBVM(), checkpoint=path)
        assert whole.status.failed
        assert_same(integrate(problem, HBVM(), resume=path), whole)

    def test_a_finished_run_is_finished(self, path):
        problem = problems.load("kepler")
        whole = integrate(problem, HBVM(), checkpoint=path)
        assert_same(integrate(problem, HBVM(), resume=path), whole)


class TestOtherFiles:
    def given(self, path):
        problem = problems.load("kepler")
        integrate(problem, HBVM(k=4, s=2, h=0.1), times=[0.0, 1.0], checkpoint=path)
        return problem

    @pytest.mark.parametrize(
        ("other", "what"),
        [
            ({"problem": problems.load("kepler", e=0.3)}, "problem"),
            ({"problem": problems.load("pendulum")}, "problem"),
            ({"method": HBVM(k=4, s=2, h=0.2)}, "method"),
            ({"times": [0.0, 2.0]}, "times"),
            ({"sample": "steps"}, "sample"),
            ({"events": Event(lambda q: q[0])}, "events"),
        ],
        ids=["parameters", "problem", "method", "times", "sample", "events"],
    )
    def test_another_integration_is_refused(self, other, what, path):
        problem = self.given(path)
        mine = {"problem": problem, "method": HBVM(k=4, s=2, h=0.1), "times": [0.0, 1.0]} | other
        with pytest.raises(InputError, match=f"with other {what} than here"):
            integrate(**mine, resume=path)

    def test_a_damaged_file_is_told_in_one_sentence(self, path):
        problem = self.given(path)
        whole = path.read_bytes()
        middle = bytearray(whole)
        middle[-40] ^= 1
        for damaged in (b"", b"text", whole[:-1], whole[:200], bytes(middle)):
            path.write_bytes(damaged)
            with pytest.raises(InputError, match="is not a checkpoint of integrate, or is damaged"):
                integrate(problem, HBVM(k=4, s=2, h=0.1), times=[0.0, 1.0], resume=path)

    def test_no_file(self, path):
        problem = problems.load("kepler")
        with pytest.raises(InputError, match="there is no checkpoint"):
            integrate(problem, HBVM(), times=[0.0, 1.0], resume=path)
        made = integrate(problem, HBVM(), times=[0.0, 1.0], resume=path, checkpoint=path)
        assert made.status is Status.FINISHED


class TestProgress:
    @pytest.mark.parametrize("events", [(), Event(lambda q: q[0])], ids=["plain", "events"])
    def test_a_callback_hears_of_all_of_the_way(self, events):
        heard = []
        integrate(problems.load("kepler"), HBVM(), times=[50.0], events=events, progress=heard.append)
        assert isinstance(heard[0], watch.Progress)
        fractions = [progress.fraction for progress in heard]
        assert fractions == sorted(fractions)
        assert fractions[0] < 0.1
        assert fractions[-1] == 1.0
        assert heard[-1].left == 0.0
        assert heard[-1].steps > 0

    def test_it_changes_no_bit(self):
        problem = problems.load("kepler")
        watched = integrate(problem, HBVM(), progress=lambda progress: None)
        assert_same(watched, integrate(problem, HBVM()))

    def test_no_bar_without_a_terminal(self, capfd):
        integrate(problems.load("kepler"), HBVM(), progress=True)
        assert capfd.readouterr() == ("", "")

    def test_anything_else_is_refused(self):
        with pytest.raises(InputError, match="progress="):
            integrate(problems.load("kepler"), HBVM(), progress="yes")
        with pytest.raises(InputError, match="every_seconds="):
            integrate(problems.load("kepler"), HBVM(), every_seconds=-1.0)


LONG = """
import signal, sys
import numpy as np
import problems
from integrators import HBVM, integrate

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have made it deaf
options = {{"times": np.arange(0.0, 1e7, 10.0), "checkpoint": sys.argv[1], "every_seconds": 0.2}}
print("begun", flush=True)
solution = integrate(problems.load("kepler"), HBVM(k=8, s=4, h=0.01), {events} **options)
print(solution.status, solution.t.size, solution.reason)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
class TestSignals:
    def child(self, path, how, events=""):
        child = subprocess.Popen(
            [sys.executable, "-c", LONG.format(events=events), str(path)], stdout=subprocess.PIPE, text=True
        )
        assert child.stdout is not None
        child.stdout.readline()
        until = monotonic() + 60.0
        while not path.exists() and monotonic() < until:
            sleep(0.02)
        sleep(0.5)
        sent = monotonic()
        os.kill(child.pid, how)
        out, _ = child.communicate(timeout=60)
        return out, monotonic() - sent

    def test_ctrl_c_returns_what_was_reached(self, path):
        out, seconds = self.child(path, signal.SIGINT)
        words = out.split()
        assert words[0] == "interrupted"
        assert int(words[1]) > 100
        # Measured 0.1 to 0.25 s, with the end of the process. A busy machine may take longer.
        assert seconds < 10.0

    def test_ctrl_c_while_events_are_looked_for(self, path):
        out, seconds = self.child(path, signal.SIGINT, events="events=lambda q: q[0],")
        words = out.split()
        assert words[0] == "interrupted"
        assert int(words[1]) > 100
        assert seconds < 10.0  # as above

    def test_kill_leaves_a_whole_file(self, path):
        self.child(path, signal.SIGKILL)
        problem, method, times = problems.load("kepler"), HBVM(k=8, s=4, h=0.01), np.arange(0.0, 1e7, 10.0)
        part = integrate(problem, method, times=times, resume=path, progress=Breaks(2))
        n = part.t.size
        assert n > 100
        whole = integrate(problem, method, times=times[:n])
        assert part.y.tobytes() == whole.y.tobytes()
