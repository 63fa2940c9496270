"""Whoever runs the cases, and whatever is killed meanwhile: the same numbers, and no finished case lost."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace

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
from tests.hbvm_bench.conftest import SHORT, stored

from .cluster import Cluster

LIMITS = Limits(wall_seconds=60, memory_gib=2)
COST = ("compile_seconds", "compile_cold", "compile_cached", "peak_memory")


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


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_in_the_middle_gives_what_this_machine_gives(toys, tmp_path):
    chosen = [*cases(6, wait=0.2), resolve(Case(problem=SHORT, method="Crashing()"))]
    here, there = store_in(tmp_path / "here"), store_in(tmp_path / "there")
    run_on("local", chosen, here, jobs=2)
    with Cluster(tmp_path, 3) as cluster, executors.opened(f"dask://{cluster.address}") as pool:
        cluster.wait_for(lambda: pool.slots() == 3, "workers")
        records = loop.run_accuracy([request_of(one, LIMITS) for one in chosen], there, pool)
        next(records)
        cluster.kill(cluster.workers[0])
        assert len(list(records)) == len(chosen) - 1
        assert pool.slots() == 2
    assert_equal(values(here, chosen), values(there, chosen))
    assert there.load(chosen[-1].id).result.reason == "the process ended by signal SIGSEGV"


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


def test_a_runner_that_is_killed_costs_no_finished_case(toys, tmp_path):
    methods = [word for h in (1, 2) for word in ("-m", f"Waving(h={h}.0)")]
    slow = "Waving(h=3.0, wait=60.0)"
    command = [sys.executable, "-m", "hbvm_bench.cli", "run", "-p", SHORT, *methods]
    options = ["--jobs", "1", "--no-timing", "--out", str(tmp_path / "run")]
    running = subprocess.Popen([*command, "-m", slow, *options], stderr=subprocess.DEVNULL)
    store = Store(tmp_path / "run")
    deadline = time.monotonic() + 60
    while len(stored(store)) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    running.send_signal(signal.SIGKILL)
    running.wait()
    kept = stored(store)
    assert len(kept) == 2
    assert all(set(store.series(key)) == {"t", "y"} for key in kept)

    again = [*command, "-m", "Waving(h=3.0)", *options]
    done = subprocess.run(again, capture_output=True, text=True, timeout=60, check=True)
    assert "measuring on this machine: 3, 2 already there" in done.stderr
    assert kept.items() <= stored(store).items()


TIMED = """
name = "timed"
problems = ["{problem}"]
methods = [{{ use = "Waving(h={{h}}, wait=0.05)", sweep = {{ h = [0.1, 0.2] }} }}]
[timing]
rounds = 2
"""


@pytest.mark.slow
def test_a_runner_that_is_killed_while_it_times_loses_no_round_and_takes_none_twice(toys, tmp_path):
    file = tmp_path / "timed.toml"
    file.write_text(TIMED.format(problem=SHORT))
    store = Store(tmp_path / "run")
    command = [sys.executable, "-m", "hbvm_bench.cli", "run", str(file), "--out", str(store.directory)]

    def rounds():
        if not store.path.is_file():
            return {}
        try:
            return {one.id: one.timing.rounds for one in store.everything() if one.timing is not None}
        except InputError:  # it has no tables yet
            return {}

    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while not rounds() and time.monotonic() < deadline:
        time.sleep(0.02)
    running.send_signal(signal.SIGKILL)
    running.wait()
    kept = rounds()
    assert 1 <= sum(map(len, kept.values())) < 4
    subprocess.run(command, capture_output=True, timeout=60, check=True)
    after = rounds()
    assert [len(one) for one in after.values()] == [2, 2]
    assert all(after[key][: len(one)] == one for key, one in kept.items())


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


@pytest.mark.parametrize(
    ("deaths", "number"), [(1, signal.SIGKILL), (2, signal.SIGSEGV), (2, signal.SIGKILL)]
)
def test_a_case_whose_process_dies_runs_again(toys, tmp_path, deaths, number):
    counted = tmp_path / "runs"
    method = f"Crashing(number={int(number)}, counted={str(counted)!r}, times={deaths})"
    (case,) = [resolve(Case(problem=SHORT, method=method))]
    (record,) = run_on("local", [case], store_in(tmp_path / "run"))
    assert record.result.outcome == "ok"
    assert counted.stat().st_size == deaths + 1


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSEGV])
def test_a_case_whose_process_died_three_times_is_told_by_the_exit_code_and_runs_again(
    toys, tmp_path, capsys, number
):
    counted = tmp_path / "runs"
    method = f"Crashing(number={int(number)}, counted={str(counted)!r}, times=3)"
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
