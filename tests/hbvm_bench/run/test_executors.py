"""Whoever runs the cases, and whatever is killed meanwhile: the same numbers, and no finished case lost."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from hbvm_bench import cli
from hbvm_bench.campaign.file import Case, Grid, Limits
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.measure import reading
from hbvm_bench.run import executors, loop
from hbvm_bench.run.task import UnfinishedRunError, execute, request_of
from hbvm_bench.store.store import Store
from problems.errors import InputError
from tests.hbvm_bench.conftest import SHORT

from .cluster import Cluster

LIMITS = Limits(wall_seconds=60, memory_gib=2)
COST = ("warm_seconds", "compile_seconds", "peak_memory")


def cases(count, wait=0.0):
    methods = [f"Waving(h={0.1 * (i + 1):.1f}, wait={wait})" for i in range(count)]
    return [resolve(Case(problem=SHORT, method=method, grid=Grid(count=4))) for method in methods]


def store_in(folder):
    made = Store(folder)
    made.prepare()
    return made


def values(store, chosen):
    """Return everything about cases that is not a matter of time and place."""
    found = {}
    for case in chosen:
        record = reading.up_to_date(store, store.load(case.id))
        kept = {key: v for key, v in record.result.metrics.items() if key not in COST}
        result = msgspec.structs.replace(record.result, metrics=kept, compile=None, peak_gib=None)
        found[case.id] = (record.case, result, record.versions, store.series(case.id))
    return found


def assert_equal(one, other):
    assert one.keys() == other.keys()
    for key in one:
        assert one[key][:-1] == other[key][:-1]
        assert one[key][-1].keys() == other[key][-1].keys()
        for name, series in one[key][-1].items():
            assert np.array_equal(series, other[key][-1][name], equal_nan=True)


def run_on(name, chosen, store, jobs=None, limits=LIMITS):
    with executors.opened(name, jobs) as pool:
        return list(loop.run_accuracy([request_of(one, limits) for one in chosen], store, pool))


PAGE = Path(__file__).parents[3] / "docs" / "howto" / "clusters.md"


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_what_this_machine_gives_and_what_the_page_shows(tmp_path):
    """A campaign and an ensemble; the page has the file, the command and what that prints."""
    (tmp_path / "my.toml").write_text(re.search(r"```toml\n(.*?)```", PAGE.read_text(), re.DOTALL)[1])
    command = [sys.executable, "-m", "hbvm_bench.cli", "run", "my.toml", "--no-timing", "--out"]
    subprocess.run([*command, "here"], cwd=tmp_path, check=True, capture_output=True, timeout=300)
    with Cluster(tmp_path, 2) as cluster:
        address = ["--executor", f"dask://{cluster.address}"]
        running = subprocess.Popen(
            [*command, "runs/my", *address],
            cwd=tmp_path,
            stderr=subprocess.PIPE,
            text=True,
            stdout=subprocess.DEVNULL,
        )
        with running:
            lines = [running.stderr.readline(), running.stderr.readline()]
            cluster.kill(cluster.workers[0])
            lines += running.stderr
    assert running.returncode == 0
    here, there = (Store(tmp_path / name) for name in ("here", "runs/my"))
    chosen = [resolve(record.case) for record in here.records()]
    assert {case.case.ensemble is None for case in chosen} == {True, False}
    assert_equal(values(here, chosen), values(there, chosen))

    def bare(lines):  # the cases end in any order, after other seconds, and the cluster has another address
        return sorted(
            re.sub(r"\[\d+/|[\d.]+ m?s\b|dask://[\w.:]+|at [\w.]+:\d+", "", " ".join(line.split()))
            for line in lines
            if "running" not in line  # said every 30 s
        )

    shown = re.search(r"```text\n(.*?)```", PAGE.read_text(), re.DOTALL)[1].splitlines()
    assert bare(lines) == bare(shown)


@pytest.mark.slow
def test_a_scheduler_that_is_killed_costs_no_finished_case(toys, tmp_path):
    chosen = cases(4, wait=0.5)
    store = store_in(tmp_path / "run")
    with Cluster(tmp_path, 1) as cluster, executors.opened(f"dask://{cluster.address}") as pool:
        records = loop.run_accuracy([request_of(one, LIMITS) for one in chosen], store, pool)
        first = next(records)
        cluster.kill(cluster.scheduler)
        with pytest.raises(UnfinishedRunError, match=r"scheduler at .* is gone"):
            list(records)
    kept = [case for case in chosen if store.load(case.id)]
    assert first.id in [case.id for case in kept]
    missing = [case for case in chosen if case not in kept]
    assert missing
    run_on("local", missing, store)
    assert all(store.load(case.id).result.outcome == "ok" for case in chosen)


CAMPAIGN = """
name = "killed"
problems = ["{problem}", "sitnikov(t_end=2.0)"]
methods = [{{ use = "Steady(h={{h}}, wait=0.1)", sweep = {{ h = [0.1, 0.2, 0.3] }} }}]
timing = {{ rounds = {rounds}, shortest = 0.02 }}
"""


@pytest.mark.parametrize(
    ("kills", "rounds"), [(2, 0), pytest.param(10, 2, marks=pytest.mark.slow)], ids=["twice", "ten times"]
)
def test_a_runner_that_is_killed_loses_nothing_and_does_nothing_twice(toys, tmp_path, kills, rounds):
    """At random moments; in the slow form while it times, too."""
    file = tmp_path / "killed.toml"
    file.write_text(CAMPAIGN.format(problem=SHORT, rounds=rounds))
    store, whole = Store(tmp_path / "run"), Store(tmp_path / "whole")
    command = [sys.executable, "-m", "hbvm_bench.cli", "run", str(file), "--jobs", "1", "--out"]

    def rows():
        if not store.path.is_file():
            return {}
        with contextlib.suppress(InputError):  # it has no tables yet
            return {
                one.id: (one.finished, one.timing and one.timing.rounds, store.packed_series(one.id))
                for one in store.everything()
            }
        return {}

    def kept(before, after):
        """Whether all that was there is there; a row without times may have got some."""
        return all(
            key in after
            and all(a == b for a, b in zip(before[key], after[key], strict=True) if a is not None)
            for key in before
        )

    moment = np.random.default_rng(51)
    for _ in range(kills):
        had = rows()
        running = subprocess.Popen(
            [*command, str(store.directory)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        deadline = time.monotonic() + 60
        while rows() == had and running.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        time.sleep(moment.uniform(0.0, 0.5))
        running.kill()
        running.wait()
        assert kept(had, rows())
    had = rows()
    for directory in (store, whole):
        subprocess.run([*command, str(directory.directory)], capture_output=True, timeout=120, check=True)
    now = rows()
    assert kept(had, now)
    assert len(now) == 6
    chosen = [resolve(record.case) for record in whole.records()]
    assert {case.id for case in chosen} == now.keys()
    assert_equal(values(store, chosen), values(whole, chosen))
    if rounds:
        assert all(len(taken) == rounds for _, taken, _ in now.values())


def test_a_second_run_into_one_directory_is_refused(tmp_path, capsys):
    store = store_in(tmp_path / "run")
    with store.locked():
        command = ["run", "-p", SHORT, "-m", "IAS15()", "--out", str(store.directory)]
        assert cli.main(command) == 2
    assert "another run is writing to" in capsys.readouterr().err


def test_any_executor_can_be_named(toys, tmp_path):
    chosen = cases(2)
    store = store_in(tmp_path / "run")
    records = run_on("concurrent.futures:ProcessPoolExecutor", chosen, store, jobs=1)
    assert [record.result.outcome for record in records] == ["ok", "ok"]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("lokal", "there is no executor 'lokal'"),
        ("dask://here", "dask://HOST:PORT"),
        ("dask://127.0.0.1:9", "no dask scheduler answers at 127.0.0.1:9"),
        ("nowhere:Executor", "nowhere"),
        ("concurrent.futures:Nothing", "Nothing"),
        ("pathlib:Path", "no concurrent.futures.Executor"),
    ],
)
def test_an_executor_that_is_not_there_says_so(monkeypatch, name, says):
    monkeypatch.setattr(executors, "CONNECT", 0.3)
    with pytest.raises(InputError, match=says), executors.opened(name):
        pass


def test_without_distributed_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'hbvm-bench\[dask\]'"), executors.opened("dask://h:1"):
        pass


def test_a_machine_that_would_run_another_case_says_what_differs(toys):
    asked = request_of(cases(1)[0], LIMITS)
    row = msgspec.structs.replace(asked.rows[0], id="0" * 64)
    with pytest.raises(UnfinishedRunError, match="other sources"):
        execute(msgspec.structs.replace(asked, rows=[row]))
    row = msgspec.structs.replace(row, versions=row.versions | {"toys": "0.9"})
    with pytest.raises(UnfinishedRunError, match=r"it has toys 1\.0 instead of 0\.9$"):
        execute(msgspec.structs.replace(asked, rows=[row]))


def test_a_machine_that_would_run_another_case_ends_the_run(toys, tmp_path):
    foreign = replace(cases(1)[0], id="0" * 64)  # as if made from other sources
    store = store_in(tmp_path / "run")
    with pytest.raises(UnfinishedRunError, match="it has other sources of hbvm-bench"):
        run_on("local", [foreign], store)
    assert list(store.everything()) == []


class Losing(ThreadPoolExecutor):
    """Loses every case of one method."""

    lost = 0

    def submit(self, fn, task):
        if "h=0.2" not in task.case.method:
            return super().submit(fn, task)
        self.lost += 1
        future = Future()
        future.set_exception(OSError("the machine is gone"))
        return future


def test_a_case_that_an_executor_loses_is_tried_three_times_and_named_after_all_others(toys, tmp_path):
    chosen = cases(2)
    store = store_in(tmp_path / "run")
    with Losing(1) as executor:
        records = loop.run_accuracy(
            [request_of(one, LIMITS) for one in chosen], store, executors.pool_of(executor)
        )
        assert next(records).id == chosen[0].id
        with pytest.raises(UnfinishedRunError, match="1 case could not be run: OSError: the machine"):
            next(records)
        assert executor.lost == 3


def test_a_case_whose_process_dies_runs_again(toys, tmp_path):
    counted = tmp_path / "runs"
    method = f"Crashing(number={int(signal.SIGSEGV)}, counted={str(counted)!r}, times=2)"
    (case,) = [resolve(Case(problem=SHORT, method=method))]
    (record,) = run_on("local", [case], store_in(tmp_path / "run"))
    assert record.result.outcome == "ok"
    assert counted.stat().st_size == 3


def test_a_case_whose_process_died_three_times_is_told_by_the_exit_code_and_runs_again(
    toys, tmp_path, capsys
):
    counted = tmp_path / "runs"
    method = f"Crashing(number={int(signal.SIGKILL)}, counted={str(counted)!r}, times=3)"
    command = ["run", "-p", SHORT, "-m", method, "-m", "Waving(h=1.0)", "--no-timing", "--jobs", "1"]
    command += ["--out", str(tmp_path / "run"), "--report", str(tmp_path / "report")]
    assert cli.main(command) == 1
    assert "the process of 1 case died 3 times (Crashing(" in capsys.readouterr().err
    assert counted.stat().st_size == 3
    assert (tmp_path / "report" / "report.md").exists()
    assert cli.main(command) == 0
    assert "measuring on this machine: 2, 1 already there" in capsys.readouterr().err
    assert counted.stat().st_size == 4


def test_threads_of_this_machine_keep_their_cases_on_cores_of_their_own(toys, tmp_path):
    (case,) = [resolve(Case(problem=SHORT, method="Pinned()"))]
    store = store_in(tmp_path / "run")
    (record,) = run_on("local", [case], store, jobs=1)
    assert record.result.counters.steps == 1
    (record,) = run_on("local", [case], store, jobs=1 + len(os.sched_getaffinity(0)))
    assert record.result.counters.steps == len(os.sched_getaffinity(0))
