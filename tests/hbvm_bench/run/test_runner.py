"""Whatever a method does, it is a row with its reason, and the rest is unharmed."""

import concurrent.futures
import os
import signal
import subprocess
import sys
import time

import msgspec
import psutil
import pytest

from hbvm_bench.campaign.file import Case, Grid, Limits, TimingPlan
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.measure import memory, reading
from hbvm_bench.run import child, executors, loop, task, timing_pass, worker
from hbvm_bench.run.child import Child
from hbvm_bench.store.store import Store
from tests.hbvm_bench.conftest import SHORT, end_idle, run_case

GENEROUS = Limits(wall_seconds=30, memory_gib=2)
PLAN = TimingPlan(rounds=3, shortest=1e-6)


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
        ("Exiting()", "crashed", "no readable result"),
        ("Exiting(code=3)", "crashed", "exit code 3"),
        ("Raising()", "crashed", "RuntimeError: something <b>broke</b>"),
    ],
)
def test_a_failure_is_a_row_with_its_reason(toys, store, method, outcome, reason):
    record = run(store, method)
    assert record.result.outcome == outcome
    assert reason in record.result.reason
    assert record.result.metrics == {}
    assert store.series(record.id) == {}
    assert "Raising" not in method or record.log.endswith("RuntimeError: something <b>broke</b>\n")


@pytest.mark.parametrize(
    ("method", "outcome", "reason"),
    [
        ("Garbage(what='shape')", "crashed", "shape"),
        ("Garbage(what='times')", "crashed", "not asked for"),
        ("Garbage(what='few')", "crashed", "2 of 5"),
        ("Garbage(what='nan')", "crashed", "not finite from t = 1"),
        ("Garbage(what='complex')", "crashed", "complex128, not real numbers"),
        ("Refusing()", "refused", "it accepts nothing"),
        ("Missing()", "refused", "pip install nowhere"),
    ],
)
def test_what_a_method_should_not_return_is_told(toys, method, outcome, reason):
    result, series = worker._measure(resolve(case(method)), lambda: None)
    assert result.outcome == outcome
    assert reason in result.reason
    assert series == {}


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
    ended = Child(command=["-c", start]).ask(b"", Limits(wall_seconds=15, memory_gib=0.2))
    assert ended.cause == "memory"
    assert 0.2 < ended.peak_gib < 0.6  # measured 0.21 to 0.31
    assert ended.seconds < 10


def test_all_processes_are_walked_over_once_in_a_second_only(monkeypatch):
    walks = []
    monkeypatch.setattr(memory.psutil, "process_iter", lambda: walks.append(time.monotonic()) or [])
    Child(command=["-c", "import time; time.sleep(1.6)"]).ask(b"", GENEROUS)
    assert len(walks) == 1  # one at every poll would be more than ten


def test_a_lost_symmetry_voids_position_and_time(toys, store):
    record = run(store, "Straying()")
    assert "off axis reached 0.001" in record.result.violation
    metrics = record.result.metrics
    assert metrics["observable_end"].excluded
    assert not metrics["energy_max"].excluded
    assert metrics["guard_max"].value == 1e-3


def test_cases_run_on_any_executor(toys, store):
    requests = [task.request_of(resolve(case(f"Steady(h={h})")), GENEROUS) for h in (0.1, 0.2)]
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        records = list(loop.run_accuracy(requests, store, executors.pool_of(pool)))
    assert {record.id for record in records} == {one.id for one in requests}


def test_another_plan_takes_all_times_again_and_integrates_nothing(toys, store):
    plan = PLAN
    one = resolve(case("Steady()"))
    run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases([one], store, plan, GENEROUS)
    before = store.load(one.id)
    assert (before.timing.plan, timing_pass.outdated([one], store, plan)) == (plan, 0)
    for change in ({"rounds": 1}, {"shortest": 2e-4}, {"order": "alternating"}):
        other = msgspec.structs.replace(plan, **change)
        assert timing_pass.missing_visits([one], store, other) == 1
    other = msgspec.structs.replace(plan, rounds=2, clock="thread")
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
    assert loop.is_done(store.load(one.id), GENEROUS)


def test_a_timing_that_fails_says_why(toys, store):
    one = resolve(case("Steady(wait=0.05)"))
    run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases([one], store, PLAN, Limits(wall_seconds=0.1))
    record = reading.up_to_date(store, store.load(one.id))
    assert record.timing.why == "not timed: the time limit"
    assert record.result.metrics["warm_seconds"].why == "not timed: the time limit"
    assert timing_pass.missing_visits([one], store, PLAN) > 0
    once = TimingPlan(rounds=1, shortest=1e-4, budget=0.1)
    timing_pass.time_cases([one], store, once, GENEROUS)
    assert store.load(one.id).timing.why == ""
    assert timing_pass.missing_visits([one], store, once) == 0


def test_the_cases_of_a_problem_are_timed_in_turn_by_one_process(toys, store):
    methods = ("Steady()", "Steady(h=0.2)", "Crashing()", "Straying()")
    cases = [resolve(case(method)) for method in methods]
    for one in cases:
        run_case(one.case, str(store.directory), GENEROUS)
    assert timing_pass.missing_visits(cases, store, PLAN) == 1
    visits = []
    timing_pass.time_cases(cases, store, PLAN, GENEROUS, lambda one: visits.append(one.case.method))
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
    timing_pass.time_cases(cases, store, PLAN, GENEROUS, lambda *visit: pytest.fail("timed again"))


def test_compilations_share_the_rounds_and_are_processes_of_their_own(toys, store):
    plan = msgspec.structs.replace(PLAN, rounds=4, compilations=2)
    cases = [resolve(case(f"Steady(h={h})")) for h in (0.1, 0.2)]
    for one in cases:
        run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases(cases, store, plan, GENEROUS)
    for one in cases:
        timing = store.load(one.id).timing
        assert [round_.number for round_ in timing.rounds] == list(range(4))
        assert [round_.compilation for round_ in timing.rounds] == [0, 1, 1, 0]
    timing_pass.time_cases(cases, store, plan, GENEROUS, lambda *visit: pytest.fail("timed again"))
    assert timing_pass.outdated(cases, store, PLAN) == 2


def test_a_slow_setting_that_is_chosen_is_compared_in_rounds_that_did_not_choose_it(toys, store, monkeypatch):
    """Both are far behind a third and timed once; that which the errors asked for choose is timed again."""
    plan = msgspec.structs.replace(PLAN, rounds=6, compilations=3, front=True)
    cases = [resolve(case(f"Steady(h={h})")) for h in (0.1, 0.2, 0.4)]
    for one in cases:
        run_case(one.case, str(store.directory), GENEROUS)
    monkeypatch.setattr(timing_pass.front, "behind", lambda records, timings: {one.id for one in cases[:2]})
    monkeypatch.setattr(timing_pass.front, "chosen", lambda records, asked: {cases[1].id, cases[2].id})
    timing_pass.time_cases(cases, store, plan, GENEROUS)
    numbers = [[round_.number for round_ in store.load(one.id).timing.rounds] for one in cases]
    assert numbers == [[0, 4], [0, 1, 2, 4, 5], [0, 1, 2, 3, 4, 5]]


@pytest.mark.slow  # our kernel is compiled from nothing
def test_the_first_of_several_compilations_begins_with_empty_caches_which_the_others_share(store):
    plan = TimingPlan(rounds=2, shortest=1e-6, compilations=2)
    one = resolve(case("Gauss(s=2, h=0.1)"))
    run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases([one], store, plan, GENEROUS)
    timing = store.load(one.id).timing
    assert [round_.compile.cached for round_ in timing.rounds] == [False, True]
    assert timing.compile.seconds > 0.5  # of the order of 5 s; from the cache 0.1


def test_a_problem_is_timed_again_as_a_whole_where_one_of_its_cases_has_no_rounds(toys, store):
    """As after a kill between two records: rounds of different processes do not belong together."""
    cases = [resolve(case(f"Steady(h={h})")) for h in (0.1, 0.2)]
    for one in cases:
        run_case(one.case, str(store.directory), GENEROUS)
    timing_pass.time_cases(cases, store, PLAN, GENEROUS)
    before = store.load(cases[0].id)
    store.save(msgspec.structs.replace(store.load(cases[1].id), timing=None))
    assert timing_pass.missing_visits(cases, store, PLAN) == 1
    timing_pass.time_cases(cases, store, PLAN, GENEROUS)
    first, second = (store.load(one.id).timing for one in cases)
    assert first.process == second.process != before.timing.process
    assert len(first.rounds) == len(second.rounds) == 3


def children():
    return psutil.Process().children(recursive=True)


def wait_for(condition):
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_stopped_run_stores_nothing_and_leaves_no_process(toys, store):
    end_idle()
    before = set(children())
    pool = concurrent.futures.ThreadPoolExecutor(1)
    future = pool.submit(run_case, case("Endless()"), str(store.directory), GENEROUS)
    wait_for(lambda: set(children()) - before)
    (process,) = set(children()) - before
    child.stopping.set()
    try:
        with pytest.raises(task.InterruptedRunError):
            future.result(timeout=60)
    finally:
        child.stopping.clear()
        pool.shutdown()
    assert not process.is_running()
    assert list(store.everything()) == []


def numbers(record):
    kept = {k: v for k, v in record.result.metrics.items() if "compile" not in k and k != "peak_memory"}
    return msgspec.structs.replace(record.result, metrics=kept, compile=None, peak_gib=None)


@pytest.mark.parametrize(
    "method", ["Waving(h=0.3)", "HBVM(k=8, s=2, h=0.25)", "IAS15()", "Taylor(tol=1e-12)"]
)
def test_a_case_has_the_same_numbers_in_a_process_that_served_one_as_in_a_new_one(toys, store, method):
    end_idle()
    fresh = run(store, method)
    series = store.series(fresh.id)
    again = run(store, method)
    assert numbers(again) == numbers(fresh)
    assert (again.result.compile, fresh.result.compile is None) == (None, False)
    assert {k: v.tolist() for k, v in store.series(again.id).items()} == {
        k: v.tolist() for k, v in series.items()
    }


def test_a_case_that_ends_badly_costs_its_process_and_no_other_case(toys, store):
    methods = ["Counting(h={})", "Counting(h={})", "Crashing(number=11)", "Counting(h={})", "Hungry()"]
    methods += ["Counting(h={}, leaves='child')", "Counting(h={})", "Counting(h={})"]
    limits = Limits(wall_seconds=30, memory_gib=0.4)
    end_idle()
    records = [run(store, method.format(0.1 + i), limits) for i, method in enumerate(methods)]
    assert [record.result.outcome for record in records] == [
        "ok", "ok", "crashed", "ok", "killed", "ok", "ok", "ok",
    ]  # fmt: skip
    # how many cases its process had served: a new one after an end, and after one that left something behind
    counts = [record.result.counters.steps for record in records if record.result.outcome == "ok"]
    assert counts == [1, 2, 1, 1, 1, 2]
    assert max(record.peak_memory_gib for record in records if record.result.outcome == "ok") < 0.2


def test_another_library_has_another_process(toys, store):
    end_idle()
    for method in ("Counting(h=1.0)", "IAS15()", "Counting(h=2.0)"):
        record = run(store, method)
    assert record.result.counters.steps == 2
    assert len(waiting()) == 2


def waiting():
    return [process for _, process in task.idle._waiting]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_process_that_was_ended_or_stopped_while_it_had_nothing_to_do(toys, store, number):
    end_idle()
    run(store, "Steady(h=0.3)")
    (process,) = waiting()
    os.kill(process.process.pid, number)
    if number == signal.SIGKILL:
        wait_for(lambda: not process.alive)
        assert run(store, "Steady(h=0.4)").result.outcome == "ok"
    else:
        noted = msgspec.structs.replace(case("Steady(h=0.4)"), note="x" * 2**20)  # more than a pipe takes
        record = run_case(noted, str(store.directory), Limits(compile_seconds=0.5))
        assert record.result.status == "compiling"  # which is tried again
    assert run(store, "Steady(h=0.5)").result.outcome == "ok"


def test_no_process_outlives_a_runner_that_is_killed(toys):
    code = (
        "from hbvm_bench.run.task import execute, request_of; from hbvm_bench.campaign.file import *;"
        "from hbvm_bench.campaign.identity import resolve;"
        f"[execute(request_of(resolve(Case(problem={SHORT!r}, method=method)), Limits()))"
        " for method in ('Steady()', 'Endless()')]"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], env=os.environ)
    wait_for(lambda: psutil.Process(parent.pid).children())
    left = psutil.Process(parent.pid).children(recursive=True)
    time.sleep(1.0)  # it is in its second case, or not yet: either ends
    parent.kill()
    parent.wait()
    _, alive = psutil.wait_procs(left, timeout=30)
    assert [process for process in alive if process.status() != psutil.STATUS_ZOMBIE] == []
