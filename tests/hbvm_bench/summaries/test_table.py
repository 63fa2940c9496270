import io

import pytest
from rich.console import Console

from hbvm_bench.campaign.file import Case
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.report.terminal import results
from hbvm_bench.store.records import Value
from hbvm_bench.summaries.rows import (
    columns,
    format_value,
    group_of,
    grouped,
    numbers,
    reached,
    rows,
    seconds,
    status_of,
)
from problems.errors import InputError
from tests.hbvm_bench import made_up_run


def record(method, *, position=None, **more):
    """Return a record that is called by its method."""
    metrics = {"energy_max": 1e-15, "position_end": position} | more.pop("metrics", {})
    return made_up_run.record(method, id=method, metrics=metrics, **more)


FAR = record("far()", position=1.0)
NEAR = record("near()", position=1e-9, note="a note.")
OFF = record("off()", position=1e-12, violation="another trajectory: off axis reached 1")
STALLED = record("stalled()", outcome="stalled", status="stalled", t_stop=8.5343686, reason="it crawled.")
REFUSED = record("refused()", outcome="refused", status="", reason="no.", metrics={})
DIVERGED = record("diverged()", status="nonlinear_divergence", t_stop=3.0, reason="no convergence")
ALL = [FAR, STALLED, OFF, NEAR, REFUSED, DIVERGED]


def test_a_table_without_positions_does_not_claim_to_be_sorted_by_them():
    ((title, _),) = grouped(rows([record("a()")]))
    assert title == "At the end; without a reference solution, so that the position error is unknown"
    (ranked, _), (alone, _), (ended, _) = grouped(rows([record("a()"), NEAR, STALLED]))
    assert ranked == "On the requested trajectory, by position error at the end"
    assert "by position error" not in alone + ended


def test_settings_that_nobody_recommended_are_not_called_so():
    assert Case(problem="p()", method="m()").settings == "chosen"


def test_rows_are_grouped_and_sorted_by_position_never_by_energy():
    assert [row.record.id for row in rows(ALL)] == [
        *("near()", "far()"),
        "off()",
        *("stalled()", "refused()", "diverged()"),
    ]


def test_without_a_reference_the_order_of_the_campaign_stays():
    assert [row.record.id for row in rows([record("b()"), record("a()")])] == ["b()", "a()"]


def test_a_metric_to_sort_by_is_checked():
    with pytest.raises(InputError, match="did you mean 'energy_max'"):
        rows(ALL, "energy_maxi")


def test_every_failure_says_what_and_when():
    assert [status_of(r) for r in (FAR, STALLED, REFUSED, DIVERGED)] == [
        *("ok", "stalled at t = 8.534"),
        *("refused", "nonlinear divergence at t = 3"),
    ]
    remarks = {row.record.id: row.remark for row in rows(ALL)}
    assert remarks["stalled()"] == "stalled at t = 8.534: it crawled"
    assert remarks["refused()"] == "refused: no"
    assert remarks["off()"] == "another trajectory: off axis reached 1"
    assert remarks["near()"] == "a note"


def test_groups():
    assert {r.id: group_of(r) for r in (*ALL, record("a()"))} == {
        "near()": "on",
        "far()": "apart",
        "a()": "uncompared",
        "off()": "off",
        "stalled()": "ended",
        "refused()": "ended",
        "diverged()": "ended",
    }
    assert [r.id for r in ALL if reached(r)] == ["far()", "near()"]


def test_a_void_number_is_shown_and_not_ranked():
    cell = format_value(METRICS["position_end"], Value(value=1e-12, excluded=True, why="because"))
    assert (cell.text, cell.excluded, cell.why) == ("1.0e-12", True, "because")
    assert cell.sort == float("inf")


@pytest.mark.parametrize(
    ("key", "number", "text"),
    [
        ("energy_max", 0.0, "0"),
        ("energy_max", 3.4e236, "3.4e+236"),
        ("steps", 1275000.0, "1\u202f275\u202f000"),
        ("warm_seconds", 0.0203, "20.3 ms"),
        ("observable_end", -0.21429082377, "-0.214291"),
        ("observable_end", 5.143e21, "5.143e+21"),
        ("observable_end", 0.0, "0"),
    ],
)
def test_numbers_are_written_as_their_metric_needs(key, number, text):
    assert format_value(METRICS[key], Value(value=number)).text == text


@pytest.mark.parametrize(
    ("number", "text"), [(0.0, "0 µs"), (1.5e-6, "1.5 µs"), (0.02, "20 ms"), (7.25, "7.25 s")]
)
def test_seconds_have_three_digits_and_a_unit(number, text):
    assert seconds(number) == text


def test_columns_are_the_headline_ones_that_exist_or_those_asked_for():
    assert [m.key for m in columns(ALL)] == ["energy_max", "position_end"]
    assert [m.key for m in columns(ALL, ["steps"])] == ["steps"]


def test_a_method_has_one_number_on_all_problems():
    other = made_up_run.record("near()", id="x", problem="q()")
    assert numbers([FAR, NEAR, other]) == {"far()": 1, "near()": 2, "x": 2}


def test_a_narrow_terminal_gives_up_columns_and_keeps_the_methods():
    metrics = {key: Value(value=1e-9) for key in METRICS}
    full = record("HBVM(k=16, s=8, h=0.125)", metrics=metrics)
    for width, hidden in ((60, True), (200, False)):
        console = Console(width=width, record=True, file=io.StringIO())
        for renderable in results([full], width=width):
            console.print(renderable)
        text = console.export_text()
        assert "HBVM(k=16, s=8, h=0.125)" in text
        assert "energy" in text
        assert "position" in text
        assert ("columns do not fit" in text) == hidden
        assert ("compile" in text) != hidden
