"""Metrics are of the stored series: a new one, or a better word, runs nothing again."""

from dataclasses import replace

import msgspec
import pytest

from hbvm_bench.campaign.file import Campaign, Case, Checks, Grid, Limits, MethodEntry
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.measure import metrics, reading
from hbvm_bench.run import loop
from hbvm_bench.store.store import Index, Store
from hbvm_bench.summaries.rows import rows
from tests.hbvm_bench.conftest import SHORT, run_case

METHODS = ("Waving(h=0.3)", "Stalling()", "Cautious()")
DOUBLED = replace(
    metrics.find("energy_max"),
    key="energy_doubled",
    function=lambda measured: 2 * abs(measured.errors["energy"]).max(),
)


@pytest.fixture
def store(toys, tmp_path):
    made = Store(tmp_path / "run")
    made.prepare()
    cases = [
        Case(problem=SHORT, method=method, grid=Grid(count=4), checks=Checks(reversal=0.5))
        for method in METHODS
    ]
    records = [run_case(case, str(made.directory), Limits(wall_seconds=60)) for case in cases]
    campaign = Campaign(
        name="x",
        problems=[SHORT],
        methods=[MethodEntry(use=method) for method in METHODS],
        grid=Grid(count=4),
        checks=Checks(reversal=0.5),
    )
    made.write_index(Index(campaign=campaign, ids=[one.id for one in records], version="0", command=""))
    return made


@pytest.fixture
def another_rule(monkeypatch):
    monkeypatch.setitem(metrics.METRICS, "energy_doubled", DOUBLED)
    monkeypatch.setattr(reading, "rule", lambda: "another")


def test_a_new_metric_of_stored_cases_needs_no_run(store, another_rule):
    before = store.records()
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
    limits = Limits(wall_seconds=60)
    assert all(loop.is_kept(resolve(one.case), store, limits) for one in now)


def test_metrics_are_evaluated_once_and_kept(store, another_rule, monkeypatch):
    now = reading.records(store)
    monkeypatch.setattr(reading, "evaluated", lambda *record: pytest.fail("evaluated again"))
    assert reading.records(store) == store.records() == now


def test_while_a_run_is_writing_a_reader_writes_nothing(store, another_rule):
    before = store.records()
    with store.locked():
        assert "energy_doubled" in reading.records(store)[0].result.metrics
    assert store.records() == before


def test_a_record_of_an_earlier_version_is_shown_as_it_was_stored(store, another_rule):
    (record, *_) = store.records()
    store.save(msgspec.structs.replace(record, evaluated_by=""))
    assert "energy_doubled" not in reading.records(store)[0].result.metrics


def test_what_a_solution_warns_of_is_in_its_record_and_its_row(store):
    record = store.records()[2]
    assert record.result.warnings == ["it is a toy."]
    (remark,) = [row.remark for row in rows(store.records()) if row.record.id == record.id]
    assert remark == "it is a toy"
