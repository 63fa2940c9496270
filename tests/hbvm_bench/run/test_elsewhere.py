"""The bench without the calls that only Linux or Unix has: each is hidden, and its substitute runs."""

import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from hbvm_bench.campaign.file import Case, Grid, Limits
from hbvm_bench.measure import doctor, machine, memory, timing
from hbvm_bench.run import child
from hbvm_bench.run.child import Child
from hbvm_bench.store.store import Store
from tests.elsewhere import elsewhere
from tests.hbvm_bench.conftest import SHORT, end_idle, run_case


@pytest.fixture
def hidden(monkeypatch):
    """Hide the calls of Linux from this process, which starts the others and watches them."""
    for name in ("fork", "killpg", "getsid", "sched_getaffinity", "sched_setaffinity"):
        monkeypatch.delattr(os, name)
    monkeypatch.setattr(machine, "BINDS", False)
    monkeypatch.setattr(memory, "PROCESSES", Path("nowhere"))
    monkeypatch.setattr(memory, "resource", None)
    monkeypatch.setattr(child, "resource", None)
    end_idle()


def all_end(processes):
    """Whether processes end within ten seconds; psutil's way to wait for them needs what is hidden."""
    deadline = time.monotonic() + 10
    while any(one.is_running() and one.status() != psutil.STATUS_ZOMBIE for one in processes):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


@pytest.mark.parametrize(
    ("method", "outcome", "reason"),
    [
        ("Steady()", "ok", ""),
        ("Endless()", "timeout", "did not end within 2 s"),
        ("Hungry()", "killed", "used more than 0.6 GiB of memory"),
        ("Exiting(code=3)", "crashed", "the process ended with exit code 3"),
    ],
)
@pytest.mark.usefixtures("hidden", "toys")
def test_a_case_has_a_process_that_begins_with_nothing_and_its_limits_hold(tmp_path, method, outcome, reason):
    store = Store(tmp_path)
    store.prepare()
    asked = Case(problem=SHORT, method=method, grid=Grid(count=4))
    seconds = 2 if outcome == "timeout" else 60  # the others end earlier, on a busy machine too
    record = run_case(asked, str(store.directory), Limits(wall_seconds=seconds, memory_gib=0.6))
    assert (record.result.outcome, record.result.reason) == (outcome, reason)
    assert (
        0.02 < record.peak_memory_gib < 1.2
    )  # measured 0.04; it eats 30 MiB every 10 ms and is looked at every 20 ms


@pytest.mark.usefixtures("hidden")
def test_memory_of_descendants_counts_and_they_are_killed():
    eat = "x = bytearray(300 << 20); import time; time.sleep(20)"
    start = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {eat!r}])"
    process = Child(command=["-c", start])
    while not (descendants := psutil.Process(process.process.pid).children()):
        time.sleep(0.02)
    ended = process.ask(b"", Limits(wall_seconds=15, memory_gib=0.2))
    assert ended.cause == "memory"
    assert 0.2 < ended.peak_gib < 0.6  # measured 0.31
    assert all_end(descendants)


def test_a_worker_ends_with_its_parent_where_the_system_does_not_see_to_it():
    """By the end of its input, as the parent's are closed."""
    worker = (
        "import time; from hbvm_bench.run import child, worker; child.limit = lambda: None;"
        "worker._answered = lambda *_: time.sleep(60); worker.main()"
    )
    parent = (
        "import sys; from hbvm_bench.run.child import Child; from hbvm_bench.campaign.file import Limits;"
        f"asked = Child(command=['-c', {worker!r}]); print(asked.process.pid, flush=True);"
        """asked.ask(b'{"rows": [], "limits": {}}', Limits())"""
    )
    with subprocess.Popen([sys.executable, "-c", parent], stdout=subprocess.PIPE, text=True) as process:
        child_ = psutil.Process(int(process.stdout.readline()))
        time.sleep(1.0)
        assert child_.is_running()
        process.kill()
        assert all_end([child_])


def test_psutil_tells_the_memory_that_the_system_tells(monkeypatch):
    told = memory.of_process(os.getpid())
    monkeypatch.setattr(memory, "PROCESSES", Path("nowhere"))
    assert memory.of_process(os.getpid()).resident == pytest.approx(told.resident, rel=0.1)
    monkeypatch.setattr(memory, "resource", None)
    assert memory.own_peak() >= 0.9 * told.resident
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    assert memory.of_process(ended.pid) == memory.Memory()


def test_where_no_core_can_be_bound_all_are_used(monkeypatch):
    monkeypatch.setattr(machine, "BINDS", False)
    before = psutil.Process().cpu_affinity()
    assert machine.cores() == list(range(os.cpu_count()))
    with machine.staying_on_a_core(), machine.leaving_a_core() as core:
        assert core == machine.cores()[-1]
        assert psutil.Process().cpu_affinity() == before


def test_the_work_of_processes_that_this_one_started_is_no_other_work():
    before = timing.busy()
    spin = "import time\nwhile time.process_time() < 0.5: pass"
    subprocess.run([sys.executable, "-c", spin], check=True)
    assert timing.busy()[2] - before[2] > 0.45


def test_what_the_system_does_not_tell_is_no_finding_of_good_news(monkeypatch):
    times = type("Times", (), {"user": 1.0, "system": 2.0, "idle": 3.0})()  # as on macOS and Windows
    monkeypatch.setattr(psutil, "cpu_times", lambda: times)
    monkeypatch.setattr(doctor, "STAT", Path("nowhere"))
    monkeypatch.setattr(machine, "_cpu", dict)
    assert timing.busy()[:2] == (3.0, 0.0)
    assert [one.subject for one in doctor.steadiness(lambda: 0.01)] == ["calibration", "share"]
    assert [(one.state, one.observed[:11]) for one in (doctor.load(), doctor.virtual())] == [
        ("note", "not visible")
    ] * 2
    assert "family" not in machine.describe()


@pytest.mark.slow
def test_a_campaign_with_times_and_a_report_where_all_of_it_is_missing(tmp_path):
    environment = elsewhere(tmp_path)
    seen = subprocess.run(
        [sys.executable, "-c", "import os; print(hasattr(os, 'fork'))"],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert seen.stdout == "False\n"
    command = [sys.executable, "-W", "error", "-m", "hbvm_bench.cli", "run", "-p", "kepler(t_end=3.0)"]
    command += ["-m", "Gauss(s=2, h=0.1)", "-m", "HBVM()", "--quick"]
    done = subprocess.run(
        [*command, "--out", str(tmp_path / "run"), "--report", str(tmp_path / "report")],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    store = Store(tmp_path / "run")
    records = list(store.everything())
    assert [len(record.timing.rounds) for record in records] == [3, 3]
    assert "Gauss(s=2, h=0.1)" in (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
