"""Readings are pure functions of the stored integrations: another rule runs nothing again."""

import uuid
from dataclasses import replace

import msgspec
import pytest

from hbvm_bench.campaign.file import Campaign, Case, Checks, Grid, Limits, MethodEntry
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.measure import drift, metrics, reading
from hbvm_bench.reference import solutions
from hbvm_bench.run import loop
from hbvm_bench.store.records import ErrorGrowth
from hbvm_bench.store.store import Index, Store
from hbvm_bench.summaries.rows import rows
from tests.hbvm_bench.conftest import SHORT, run_case

METHODS = ("Waving(h=0.3)", "Stalling()", "Cautious()")
CHECKS = Checks(reversal=0.5, starts=3)
LIMITS = Limits(wall_seconds=60)
DOUBLED = replace(
    metrics.find("energy_max"),
    key="energy_doubled",
    function=lambda measured: 2 * abs(measured.errors["energy"]).max(),
)


def run(directory, problem, methods, grid=None):
    made = Store(directory)
    made.prepare()
    grid = grid or Grid(count=4)
    cases = [Case(problem=problem, method=method, grid=grid, checks=CHECKS) for method in methods]
    records = [run_case(case, str(made.directory), LIMITS) for case in cases]
    campaign = Campaign(
        name="x",
        problems=[problem],
        methods=[MethodEntry(use=method) for method in methods],
        grid=grid,
        checks=CHECKS,
    )
    made.write_index(Index(campaign=campaign, ids=[one.id for one in records], version="0", command=""))
    return made


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("read") / "run"


@pytest.fixture
def store(toys, place):
    """Return the store of one run for all tests, which read it."""
    return Store(place) if place.exists() else run(place, SHORT, METHODS)


def is_complete(store):
    """Whether a run of the same campaign would integrate nothing."""
    return all(loop.is_done(store.load(resolve(one.case).id), LIMITS) for one in store.records())


def test_the_store_has_what_the_integration_gave_and_nothing_that_judges_it(store):
    for record in store.records():
        assert (record.result.metrics, record.result.growth, record.result.violation) == ({}, {}, "")
        kinds = {name.partition(".")[0] for name in store.series(record.id)}
        assert kinds <= {"t", "y", "extra", "starts", "reversal"}
    series = store.series(store.records()[0].id)
    assert series["starts.y"].shape == (2, *series["y"].shape)
    assert series["reversal.y"].shape == (1, series["y"].shape[1])


def test_a_new_metric_of_stored_cases_needs_no_run(store, monkeypatch):
    before = reading.records(store)
    monkeypatch.setitem(metrics.METRICS, "energy_doubled", DOUBLED)
    monkeypatch.setattr(reading, "rule", lambda: str(uuid.uuid4()))
    now = reading.records(store)
    assert "energy_doubled" not in before[0].result.metrics
    values = now[0].result.metrics
    assert values["energy_doubled"].value == 2 * values["energy_max"].value > 0
    assert now[1].result.metrics["energy_doubled"].why == "only to t = 1"  # where the stepper says it stopped
    # all others are what they were: nothing that a metric is made of is missing in the store
    assert [{k: v for k, v in one.result.metrics.items() if k != "energy_doubled"} for one in now] == [
        one.result.metrics for one in before
    ]
    assert values["reversal"].value == 0.0
    assert values["peak_memory"].value > 10
    assert is_complete(store)


def test_another_reference_changes_positions_and_needs_no_run(toys, tmp_path, monkeypatch):
    store = run(tmp_path, "sitnikov()", ["Waving(h=0.3)"], Grid(step=25.0))
    (before,) = reading.records(store)
    known = solutions.find_file(resolve(before.case).problem)
    moved = msgspec.structs.replace(known, y=[["1.5" for _ in row] for row in known.y])
    monkeypatch.setattr(solutions, "find_file", lambda problem, made: moved)
    (now,) = reading.records(store)
    assert now.result.metrics["position_end"].value != before.result.metrics["position_end"].value
    assert now.result.metrics["energy_max"] == before.result.metrics["energy_max"]
    assert is_complete(store)


def test_another_growth_needs_no_run(store, monkeypatch):
    before = reading.records(store)[0].result.growth
    assert before["energy"].starts == 3
    monkeypatch.setattr(drift, "fit", lambda t, errors, *, signed: ErrorGrowth(kind="power", slope=1.0))
    monkeypatch.setattr(reading, "rule", lambda: str(uuid.uuid4()))
    assert reading.records(store)[0].result.growth["energy"] == ErrorGrowth(kind="power", slope=1.0)
    assert is_complete(store)


def test_what_was_read_is_kept(store, monkeypatch):
    now = reading.records(store)
    monkeypatch.setattr(reading, "read", lambda *record: pytest.fail("read again"))
    assert reading.records(store) == now


def test_where_nothing_can_be_written_it_is_read_all_the_same(store, monkeypatch):
    monkeypatch.setattr(reading.kept, "put", lambda *_: False)
    monkeypatch.setattr(reading, "rule", lambda: str(uuid.uuid4()))
    assert reading.records(store)[0].result.metrics["energy_max"].value > 0


def test_what_a_solution_warns_of_is_in_its_record_and_its_row(store):
    record = store.records()[2]
    assert record.result.warnings == ["it is a toy."]
    (remark,) = [row.remark for row in rows(store.records()) if row.record.id == record.id]
    assert remark == "it is a toy"
