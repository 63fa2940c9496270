"""Whatever a method does, it is a row with its reason, and the rest is unharmed."""

import concurrent.futures
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import psutil
import pytest

from hbvm_bench.campaign.file import Case, Grid, Limits, TimingPlan
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.measure import memory, reading
from hbvm_bench.run import executors, loop, supervise, timing_pass, warm
from hbvm_bench.run import task as execute
from hbvm_bench.store.store import Store
from tests.hbvm_bench.conftest import SHORT, run_case

GENEROUS = Limits(wall_seconds=30, memory_gib=2)
PLAN = TimingPlan(rounds=2, samples=2, shortest=1e-4, budget=1)
TOGETHER = TimingPlan(rounds=3, shortest=1e-6, interleaved=True)


@pytest.fixture
def store(tmp_path):
    made = Store(tmp_path / "run")
    made.prepare()
    return made


def case(method):
    return Case(problem=SHORT, method=method, grid=Grid(count=4))


def run(store, method, limits=GENEROUS):
    record = run_case(case(method), str(store.directory), limits)
    assert reading.up_to_date(store, store.load(record.id)) == record
    return record


def test_a_case_that_works_has_metrics_and_series(toys, store):
    record = run(store, "Steady()")
    assert (record.result.outcome, record.result.status, record.role) == ("ok", "finished", "peer")
    assert record.versions["toys"] == "1.0"
    # the toy stays at rest, so its energy is exact
    assert record.result.metrics["energy_max"].value == 0.0
    assert record.result.metrics["position_end"].why.startswith("the stored reference ")
    assert record.peak_memory_gib > 0.01
    assert store.series(record.id)["y"].shape == (5, 18)


@pytest.mark.parametrize(
    ("method", "outcome", "reason"),
    [
        ("Crashing()", "crashed", "SIGSEGV"),
        (f"Crashing(number={int(signal.SIGABRT)})", "crashed", "SIGABRT"),
        (f"Crashing(number={int(signal.SIGKILL)})", "killed", "SIGKILL"),
        ("Raising()", "crashed", "RuntimeError: something <b>broke</b>"),
        ("Exiting()", "crashed", "no readable result"),
        ("Exiting(code=3)", "crashed", "exit code 3"),
        ("Garbage(what='shape')", "crashed", "shape"),
        ("Garbage(what='times')", "crashed", "not asked for"),
        ("Garbage(what='few')", "crashed", "2 of 5"),
        ("Garbage(what='nan')", "crashed", "not finite from t = 1"),
        ("Garbage(what='complex')", "crashed", "complex128, not real numbers"),
        ("Garbage(what='result')", "crashed", "no readable result"),
        ("Garbage(what='series')", "crashed", "no readable result"),
        ("Refusing()", "refused", "it accepts nothing"),
        ("Missing()", "refused", "pip install nowhere"),
    ],
)
def test_a_failure_is_a_row_with_its_reason(toys, store, method, outcome, reason):
    record = run(store, method)
    assert record.result.outcome == outcome
    assert reason in record.result.reason
    assert record.result.metrics == {}
    assert store.series(record.id) == {}


def test_a_stall_keeps_what_came_before(toys, store):
    record = run(store, "Stalling()")
    assert (record.result.outcome, record.result.reason) == ("stalled", "it crawled.")
    assert record.result.metrics["energy_max"].excluded
    assert store.series(record.id)["t"].tolist() == [0.0, 0.25]


def test_noise_on_the_output_does_no_harm(toys, store):
    assert run(store, "Garbage(what='noise')").result.outcome == "ok"


def test_what_never_returns_is_ended_at_its_limit(toys, store):
    start = time.monotonic()
    record = run(store, "Endless()", Limits(wall_seconds=3))
    assert (record.result.outcome, record.result.reason) == ("timeout", "did not end within 3 s")
    assert time.monotonic() - start < 10


def test_compiling_does_not_count_against_the_limit_of_a_case(toys, store):
    record = run(store, "Compiling(wait=1.5)", Limits(wall_seconds=1.0))
    assert record.result.outcome == "ok"


def test_a_timeout_while_compiling_is_not_kept_for_ever(toys, store):
    limits = Limits(compile_seconds=1.0)
    record = run(store, "Compiling(wait=60.0)", limits)
    assert (record.result.outcome, record.result.status) == ("timeout", "compiling")
    assert "still compiling after 1 s" in record.result.reason
    assert not loop.is_done(record, limits)


def test_what_eats_memory_is_killed_at_its_limit(toys, store):
    record = run(store, "Hungry()", Limits(wall_seconds=30, memory_gib=0.6))
    assert (record.result.outcome, record.result.reason) == ("killed", "used more than 0.6 GiB of memory")
    # it eats 30 MiB every 10 ms and is looked at every 20 ms
    assert record.peak_memory_gib < 1.2


def test_memory_of_processes_that_it_starts_counts_too():
    eat = "x = bytearray(300 << 20); import time; time.sleep(20)"
    start = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {eat!r}])"
    ended = supervise.watch(
        supervise.Subprocess([sys.executable, "-c", start], {}), Limits(wall_seconds=15, memory_gib=0.2)
    )
    assert ended.cause == "memory"
    assert 0.2 < ended.peak_gib < 0.6  # measured 0.21 to 0.31
    assert ended.seconds < 10


def test_all_processes_are_walked_over_once_in_a_second_only(monkeypatch):
    walks = []
    monkeypatch.setattr(memory.psutil, "process_iter", lambda: walks.append(time.monotonic()) or [])
    supervise.watch(
        supervise.Subprocess([sys.executable, "-c", "import time; time.sleep(1.6)"], {}), GENEROUS
    )
    assert len(walks) == 1  # one at every poll would be more than ten


def test_a_lost_symmetry_voids_position_and_time(toys, store):
    record = run(store, "Straying()")
    assert "off axis reached 0.001" in record.result.violation
    metrics = record.result.metrics
    assert metrics["observable_end"].excluded
    assert not metrics["energy_max"].excluded
    assert metrics["guard_max"].value == 1e-3


def test_cases_run_on_any_executor(toys, store):
    cases = [resolve(case(f"Steady(h={h})")) for h in (0.1, 0.2)]
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        records = list(loop.run_accuracy(cases, store, GENEROUS, executors.pool_of(pool)))
    assert {record.id for record in records} == {one.id for one in cases}


def test_timing_keeps_all_samples_and_is_not_taken_twice(toys, store):
    cases = [resolve(case(method)) for method in ("Steady()", "Crashing()", "Stalling()")]
    for one in cases:
        run_case(one.case, str(store.directory), GENEROUS)
    assert timing_pass.missing_visits(cases, store, PLAN) == 2
    visits = []
    timing_pass.time_cases(
        cases, store, PLAN, GENEROUS, lambda round_, one: visits.append((round_, one.case.method))
    )
    assert visits == [(0, "Steady()"), (1, "Steady()")]
    record = reading.up_to_date(store, store.load(cases[0].id))
    assert [len(one.samples) for one in record.timing.rounds] == [2, 2]
    assert all(0 < one.share < 1.5 for one in record.timing.rounds)
    assert record.timing.compile.seconds == 0.25
    assert record.result.metrics["warm_seconds"].value == record.timing.summary["median"]
    assert record.result.metrics["compile_seconds"].value == 0.25
    timing_pass.time_cases(cases, store, PLAN, GENEROUS, lambda *visit: pytest.fail("timed again"))


@pytest.mark.parametrize("plan", [PLAN, TOGETHER])
@pytest.mark.parametrize(
    "change",
    [{"rounds": 1}, {"shortest": 2e-4}, {"samples": 1}, {"order": "alternating"}, {"clock": "thread"}],
)
def test_another_plan_takes_all_times_again_and_integrates_nothing(toys, store, plan, change):
    one = resolve(case("Steady()"))
    run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases([one], store, plan, GENEROUS)
    before = store.load(one.id)
    assert (before.timing.plan, timing_pass.outdated([one], store, plan)) == (plan, 0)
    other = msgspec.structs.replace(plan, **change)
    assert timing_pass.outdated([one], store, other) == 1
    timing_pass.time_cases([one], store, other, GENEROUS)
    now = store.load(one.id)
    assert now.timing.plan == other
    assert len(now.timing.rounds) == other.rounds  # none of those before stands among them
    # Whole rounds are compared: single samples of 0.1 ms may agree to the nanosecond by chance.
    assert not {(*one.samples, *one.calibration) for one in now.timing.rounds} & {
        (*one.samples, *one.calibration) for one in before.timing.rounds
    }
    assert now.finished == before.finished
    assert loop.is_kept(one, store, GENEROUS)


def test_a_timing_that_fails_says_why(toys, store):
    one = resolve(case("Steady(wait=0.5)"))
    run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases([one], store, PLAN, Limits(wall_seconds=0.1))
    record = reading.up_to_date(store, store.load(one.id))
    assert record.timing.why == "not timed: the time limit"
    assert record.result.metrics["warm_seconds"].why == "not timed: the time limit"
    assert timing_pass.missing_visits([one], store, PLAN) > 0
    once = TimingPlan(rounds=1, samples=1, shortest=1e-4, budget=0.1)
    timing_pass.time_cases([one], store, once, GENEROUS)
    assert store.load(one.id).timing.why == ""
    assert timing_pass.missing_visits([one], store, once) == 0


def test_the_cases_of_a_problem_are_timed_in_turn_by_one_process(toys, store):
    methods = ("Steady()", "Steady(h=0.2)", "Crashing()", "Straying()")
    cases = [resolve(case(method)) for method in methods]
    for one in cases:
        run_case(one.case, str(store.directory), GENEROUS)
    assert timing_pass.missing_visits(cases, store, TOGETHER) == 1
    visits = []
    timing_pass.time_cases(
        cases, store, TOGETHER, GENEROUS, lambda round_, one: visits.append(one.case.method)
    )
    assert visits == ["Steady()"]
    first, second, crashed, strayed = (reading.up_to_date(store, store.load(one.id)) for one in cases)
    assert crashed.timing is None
    assert (strayed.timing.rounds, strayed.timing.why) == ([], timing_pass.OFF)
    assert first.timing.process == second.timing.process != ""
    for record in (first, second):
        assert [one.number for one in record.timing.rounds] == [0, 1, 2]
        assert record.timing.call > 0
        assert record.result.metrics["warm_seconds"].value == record.timing.summary["median"]
    # one sample of the calibration at the beginning of each round, the same for all
    assert [one.calibration for one in first.timing.rounds] == [
        one.calibration for one in second.timing.rounds
    ]
    timing_pass.time_cases(cases, store, TOGETHER, GENEROUS, lambda *visit: pytest.fail("timed again"))


def test_compilations_share_the_rounds_and_are_processes_of_their_own(toys, store):
    plan = msgspec.structs.replace(TOGETHER, rounds=8, compilations=4)
    cases = [resolve(case(f"Steady(h={h})")) for h in (0.1, 0.2)]
    for one in cases:
        run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases(cases, store, plan, GENEROUS)
    for one in cases:
        timing = store.load(one.id).timing
        assert [round_.number for round_ in timing.rounds] == list(range(8))
        assert [round_.compilation for round_ in timing.rounds] == [0, 2, 3, 1, 0, 2, 3, 1]
    timing_pass.time_cases(cases, store, plan, GENEROUS, lambda *visit: pytest.fail("timed again"))
    assert timing_pass.outdated(cases, store, TOGETHER) == 2


@pytest.mark.slow  # our kernel is compiled twice from nothing
def test_each_compilation_begins_with_empty_caches(store):
    plan = TimingPlan(rounds=2, shortest=1e-6, interleaved=True, compilations=2)
    one = resolve(case("Gauss(s=2, h=0.1)"))
    run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases([one], store, plan, GENEROUS)
    rounds = store.load(one.id).timing.rounds
    assert [round_.compile.cached for round_ in rounds] == [False, False]
    assert min(round_.compile.seconds for round_ in rounds) > 0.5  # of the order of 5 s


def test_a_problem_is_timed_again_as_a_whole_where_one_of_its_cases_has_no_rounds(toys, store):
    """As after a kill between two records: rounds of different processes do not belong together."""
    cases = [resolve(case(f"Steady(h={h})")) for h in (0.1, 0.2)]
    for one in cases:
        run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases(cases, store, TOGETHER, GENEROUS)
    before = store.load(cases[0].id)
    store.save(msgspec.structs.replace(store.load(cases[1].id), timing=None))
    assert timing_pass.missing_visits(cases, store, TOGETHER) == 1
    timing_pass.time_cases(cases, store, TOGETHER, GENEROUS)
    first, second = (store.load(one.id).timing for one in cases)
    assert first.process == second.process != before.timing.process
    assert len(first.rounds) == len(second.rounds) == 3


def test_an_interleaved_timing_that_ends_at_its_limit_says_why(toys, store):
    one = resolve(case("Steady(wait=0.5)"))
    run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases([one], store, TOGETHER, Limits(wall_seconds=0.1))
    assert store.load(one.id).timing.why == "not timed: the time limit"
    assert timing_pass.missing_visits([one], store, TOGETHER) == 1


def test_a_stopped_run_stores_nothing_and_leaves_no_process(toys, store):
    pool = concurrent.futures.ThreadPoolExecutor(1)
    future = pool.submit(run_case, case("Endless()"), str(store.directory), GENEROUS)
    while not supervise._children:
        time.sleep(0.01)
    (child,) = supervise._children
    supervise.stop_all()
    try:
        with pytest.raises(execute.InterruptedRunError):
            future.result(timeout=60)
    finally:
        supervise.allow()
        pool.shutdown()
    assert not Path(f"/proc/{child.pid}").exists()
    assert list(store.everything()) == []


def numbers(record):
    kept = {k: v for k, v in record.result.metrics.items() if "compile" not in k and k != "peak_memory"}
    return msgspec.structs.replace(record.result, metrics=kept, compile=None, peak_gib=None)


@pytest.mark.parametrize(
    "method", ["Waving(h=0.3)", "HBVM(k=8, s=2, h=0.25)", "IAS15()", "Taylor(tol=1e-12)"]
)
def test_a_case_has_the_same_numbers_in_a_fork_as_in_a_process_that_begins_with_nothing(
    toys, store, monkeypatch, method
):
    forks = [run(store, method) for _ in range(2)]  # of the libraries alone, and of a case
    series = store.series(forks[0].id)
    monkeypatch.setattr(warm, "fork_server", lambda environment: (_ for _ in ()).throw(OSError))
    fresh = run(store, method)
    assert [numbers(one) for one in forks] == 2 * [numbers(fresh)]
    assert fresh.result.compile is not None
    assert {k: v.tolist() for k, v in store.series(fresh.id).items()} == {
        k: v.tolist() for k, v in series.items()
    }


def test_what_a_case_does_to_its_process_reaches_no_later_one(toys, store):
    warm.close()
    methods = ["Steady(h={})", "Crashing(number=11)", "Steady(h={})", "Exiting(code=3)", "Hungry()"]
    methods += ["Counting(h={})", "Counting(h={})", "Counting(h={})"]
    limits = Limits(wall_seconds=30, memory_gib=0.4)
    records = [run(store, method.format(0.1 + i), limits) for i, method in enumerate(methods)]
    outcomes = ["ok", "crashed", "ok", "crashed", "killed", "ok", "ok", "ok"]
    assert [record.result.outcome for record in records] == outcomes
    # all are forks of the first one, and each counts itself alone
    assert [record.result.counters.steps for record in records[5:]] == [1, 1, 1]


def test_a_process_with_threads_or_children_is_not_forked_from(toys, store):
    warm.close()
    for what in ("thread", "child"):
        assert [run(store, f"Counting(h={h}, leaves={what!r})").result.counters.steps for h in (1, 2)] == [
            1,
            1,
        ]


def test_a_nest_whose_process_was_killed_is_replaced(toys, store):
    assert run(store, "Steady(h=0.3)").result.outcome == "ok"
    for server in warm._idle:
        os.kill(server.process.pid, signal.SIGKILL)
    assert run(store, "Steady(h=0.4)").result.outcome == "ok"
    assert run(store, "Steady(h=0.5)").result.outcome == "ok"


def test_a_case_whose_warm_process_is_killed_meanwhile_runs_again(toys, store):
    warm.close()
    before = set(psutil.Process().children())
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        future = pool.submit(run_case, case("Waving(h=0.3, wait=1.0)"), str(store.directory), GENEROUS)
        while not supervise._children:
            time.sleep(0.01)
        for process in set(psutil.Process().children()) - before:
            process.kill()
        record = future.result(timeout=30)
    assert record.result.outcome == "ok"
    assert record.result.compile is not None  # in a process that began with nothing


def stopped_meanwhile(store, method, limits, act):
    """Run a case, stop its warm process as soon as it has started it, do ``act`` and return the record."""
    warm.close()
    before = set(psutil.Process().children())
    servers = []

    def stop_at_once(asked):
        until_answered(asked)
        if not servers:
            servers.extend(set(psutil.Process().children()) - before)
            servers[0].suspend()

    until_answered = warm._until_answered
    with pytest.MonkeyPatch.context() as patch, concurrent.futures.ThreadPoolExecutor(1) as pool:
        patch.setattr(warm, "_until_answered", stop_at_once)
        future = pool.submit(run_case, case(method), str(store.directory), limits)
        while not supervise._children:
            time.sleep(0.01)
        (server,) = servers
        act()
        try:
            return future.result(timeout=30)
        finally:
            warm.close()
            assert not server.is_running()


def test_the_limit_of_a_case_holds_though_its_warm_process_is_stopped(toys, store, monkeypatch):
    monkeypatch.setattr(warm, "GRACE", 0.5)
    record = stopped_meanwhile(store, "Endless()", Limits(wall_seconds=2), lambda: None)
    assert (record.result.outcome, record.result.reason) == ("timeout", "did not end within 2 s")


def test_a_case_ends_well_though_its_warm_process_is_stopped(toys, store, monkeypatch):
    monkeypatch.setattr(warm, "GRACE", 0.5)
    record = stopped_meanwhile(store, "Waving(h=0.3, wait=1.0)", GENEROUS, lambda: None)
    assert record.result.outcome == "ok"


def test_a_run_with_a_stopped_warm_process_is_stopped(toys, store, monkeypatch):
    monkeypatch.setattr(warm, "GRACE", 0.5)
    try:
        with pytest.raises(execute.InterruptedRunError):
            stopped_meanwhile(store, "Endless()", GENEROUS, supervise.stop_all)
    finally:
        supervise.allow()


def test_a_stopped_warm_process_is_replaced_and_no_thread_waits_for_it_after_ctrl_c(toys, store, monkeypatch):
    monkeypatch.setattr(warm, "GRACE", 0.5)
    warm.close()
    assert run(store, "Steady(h=0.3)").result.outcome == "ok"
    (server,) = warm._idle
    process = psutil.Process(server.process.pid)
    for one in (process, *process.children()):
        one.suspend()
    start = time.monotonic()
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        future = pool.submit(run_case, case("Steady(h=0.4)"), str(store.directory), GENEROUS)
        time.sleep(0.5)
        supervise.stop_all()
        try:
            with pytest.raises(execute.InterruptedRunError):
                future.result(timeout=30)
        finally:
            supervise.allow()
    assert time.monotonic() - start < 10  # it would wait a minute for an answer
    assert run(store, "Steady(h=0.5)").result.outcome == "ok"


def test_no_process_outlives_a_runner_that_is_killed(toys):
    code = (
        "from hbvm_bench.run.task import execute, task_of; from hbvm_bench.campaign.file import *;"
        "from hbvm_bench.campaign.identity import resolve;"
        f"[execute(task_of(resolve(Case(problem={SHORT!r}, method=method)), Limits()))"
        " for method in ('Steady()', 'Endless()')]"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], env=os.environ)
    left = []
    deadline = time.monotonic() + 60
    while (
        len(left) < 3 and time.monotonic() < deadline
    ):  # of the libraries, of a case done, of the endless one
        time.sleep(0.05)
        left = psutil.Process(parent.pid).children(recursive=True)
    parent.kill()
    parent.wait()
    assert len(left) == 3
    _, alive = psutil.wait_procs(left, timeout=30)
    assert [process for process in alive if process.status() != psutil.STATUS_ZOMBIE] == []
