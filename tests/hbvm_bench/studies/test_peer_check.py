"""Every peer through the harness beside its library alone: the same steps to the same end."""

from dataclasses import replace

import msgspec
import pytest

import integrators.registry
from hbvm_bench import cli
from hbvm_bench.store.files import write_json
from hbvm_bench.studies.peers import check
from hbvm_bench.studies.peers.check import PAIRS
from hbvm_bench.summaries import peers
from hbvm_bench.summaries.peers import PeerCheck, Row

for library in ("heyoka", "rebound", "diffrax"):
    pytest.importorskip(library)


def made_up(ratio=1.0, steps=5, alone=0.03, difference=0.0):
    row = Row(
        problem="kepler(e=0.6)", method="Taylor()", call="propagate_until",
        seconds=[ratio * alone] * 3, alone=[alone] * 3, steps=5, alone_steps=steps, difference=difference,
    )  # fmt: skip
    return PeerCheck(
        rows=[row],
        refused={},
        machine={"processor": "a processor"},
        versions={"heyoka": "7"},
        measured="2026-11-21T00:00:00",
    )


def test_every_peer_that_is_registered_is_checked():
    registered = {
        name
        for name in integrators.registry.names()
        if integrators.registry.get(name).library != "hbvm-bench"
    }
    assert registered == {pair.method.partition("(")[0] for pair in PAIRS}


# Of diffrax's methods with a fixed step, which share their code and compile for seconds, one is enough.
SLOW = ("LeapfrogMidpoint", "ReversibleHeun", "Dopri8(h=")


@pytest.mark.parametrize(
    "pair",
    [pytest.param(pair, marks=[pytest.mark.slow] if pair.method.startswith(SLOW) else []) for pair in PAIRS],
    ids=[f"{pair.method} on {pair.problem}" for pair in PAIRS],
)
def test_the_harness_takes_the_library_s_own_steps_to_its_own_end(pair):
    result = check.check([pair], rounds=2, short=True, tell=lambda what: None)
    if result.refused and pair.method.startswith("WHFast512"):
        pytest.skip(*result.refused.values())
    assert not result.refused
    (row,) = result.rows
    assert row.steps == row.alone_steps >= 50
    # 0 but for REBOUND's fixed steps, whose clock we set anew: there 2e-12, from the last, shortened step
    assert row.difference < 1e-10
    assert len(row.seconds) == len(row.alone) == 2


@pytest.mark.parametrize(
    ("result", "beyond"),
    [
        (made_up(1.05), False),
        (made_up(1.06), True),
        (made_up(1.1, alone=0.0001), False),  # ten microseconds, of a very short run
        (made_up(1.5, alone=0.0001), True),
        (made_up(1.0, steps=6), True),
        (made_up(difference=1e-7), False),  # a clock that is added up
        (made_up(difference=1e-5), True),
    ],
)
def test_a_row_is_marked_where_the_bench_costs_too_much_or_steps_differ(
    monkeypatch, tmp_path, result, beyond
):
    def in_a_process(out, rounds):
        write_json(out, result)
        return 0

    monkeypatch.setattr(check, "in_a_process", in_a_process)
    assert result.rows[0].beyond is beyond
    out = tmp_path / "peers.json"
    assert cli.main(["doctor", "--peers", "--out", str(out)]) == int(beyond)
    assert peers.load(out) == result
    assert ("(beyond)" in peers.table(result).rows[0][3]) is beyond


def test_the_reports_print_what_was_kept_with_its_day_machine_and_command():
    shown = peers.kept()
    assert shown is not None
    kept = peers.load()
    assert kept is not None
    assert {row.method.partition("(")[0] for row in kept.rows} == {p.method.partition("(")[0] for p in PAIRS}
    for words in (kept.measured[:10], str(kept.machine["processor"]), "hbvm-bench doctor --peers"):
        assert words in shown.note


def test_a_process_that_dies_leaves_nothing(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(check, "in_a_process", lambda out, rounds: -9)
    out = tmp_path / "peers.json"
    assert cli.main(["doctor", "--peers", "--out", str(out)]) == 1
    assert "exit code -9" in capsys.readouterr().err
    assert not out.exists()


def test_a_peer_that_raises_does_not_lose_what_the_others_gave():
    def raises(problem, method):
        raise ZeroDivisionError("broken")

    good = next(pair for pair in PAIRS if pair.problem.startswith("cr3bp"))
    bad = replace(good, alone=raises)
    result = check.check([good, bad], rounds=2, short=True, tell=lambda what: None)
    assert len(result.rows) == 1
    assert result.refused == {f"{bad.method} on {bad.problem}": "ZeroDivisionError: broken"}
    assert result.sources == peers.digest([good.method])


def test_a_result_of_other_sources_says_so():
    now = msgspec.structs.replace(made_up(), sources=peers.digest(["Taylor()"]))
    assert "an earlier version" in peers.table(made_up()).note
    assert "an earlier version" not in peers.table(now).note
