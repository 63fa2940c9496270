"""Two runs side by side: only what is beyond noise is called a change."""

import csv
import json
import sys

import msgspec
import numpy as np
import pytest

from hbvm_bench import cli
from hbvm_bench.campaign.file import Campaign, MethodEntry
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.store.merge import merge
from hbvm_bench.store.records import Compile, Load, Result, Timing, TimingRound, Value
from hbvm_bench.store.store import Index, Store
from hbvm_bench.summaries import compare as comparing
from hbvm_bench.summaries.compare import compare
from hbvm_bench.summaries.export import export
from problems.errors import InputError
from tests.hbvm_bench import made_up_run

VALUES = {"energy_max": 3e-16, "position_end": 2.5e-7, "steps": 1000.0, "warm_seconds": 0.01}


def timing(rng, level=0.01, noise=0.02, speed=1.0, load=None):
    """Return three rounds of two samples; rounds scatter by ``noise``, the machine's speed is its own."""
    rounds = [
        TimingRound(
            samples=(level * speed * drift * np.exp(rng.normal(0, 0.003, 2))).tolist(),
            repeats=3,
            compile=Compile(seconds=0.1, cached=True),
            calibration=(0.010 * speed * np.exp(rng.normal(0, 0.003, 3))).tolist(),
        )
        for drift in np.exp(rng.normal(0, noise, 3))
    ]
    return Timing(rounds=rounds, load=load)


def make(folder, count=3, seed=0, prefix="0", edit=lambda number, record: record):
    """Write a run of ``count`` cases; ``prefix`` of their ids stands for the sources."""
    rng = np.random.default_rng(seed)
    methods = [MethodEntry(use=f"IAS15(epsilon={10.0**-i!r})") for i in range(count)]
    campaign = Campaign(name="x", problems=["kepler()"], methods=methods)
    cases = campaign.cases()
    ids = [f"{prefix}{number:03d}".ljust(64, "e") for number in range(count)]
    store = Store(folder)
    store.prepare()
    store.write_index(Index(campaign=campaign, ids=ids, version="1", command="hbvm-bench run x"))
    for number, (id_, case) in enumerate(zip(ids, cases, strict=True)):
        record = made_up_run.record(
            case,
            id=id_,
            metrics=VALUES,
            timing=timing(rng),
            versions={"rebound": "5.2.2"},
            machine={"processor": "x"},
        )
        if (edited := edit(number, record)) is not None:
            nowhere = dict.fromkeys(("position_t", "position", "phase"), np.empty(0))
            y = np.arange(12.0).reshape(3, 4) / 7
            store.save(edited, {"t": np.arange(3.0), "y": y, "distance": np.ones(3), **nowhere})
    return store


def with_value(record, key, value):
    metrics = record.result.metrics | {key: Value(value=value)}
    return msgspec.structs.replace(record, result=msgspec.structs.replace(record.result, metrics=metrics))


def test_two_runs_of_the_same_have_no_change(tmp_path):
    found = compare(make(tmp_path / "a"), make(tmp_path / "b", seed=1))
    assert (found.cases, found.equal, found.rounded, found.changed) == (3, 9, 0, [])
    assert (found.timed, found.slower, found.faster) == (3, [], [])
    assert found.unchanged


def test_the_same_sources_on_the_same_machine_must_give_the_same_digits(tmp_path):
    second = make(tmp_path / "b", edit=lambda i, r: with_value(r, "position_end", 2.5e-7 * (1 + 1e-14)))
    found = compare(make(tmp_path / "a"), second)
    assert [change.quantity for change in found.changed] == 3 * ["position error at the end"]
    assert found.changed[0].after == f"{2.5e-7 * (1 + 1e-14):.17g}"


@pytest.mark.parametrize(
    ("key", "value", "rounding"),
    [
        ("position_end", 2.5e-7 * (1 + 1e-8), True),
        ("position_end", 2.5e-7 * 1.01, False),  # a truncation error is not noise
        ("energy_max", 9e-16, True),
        ("energy_max", 3e-14, False),
        ("steps", 1001.0, False),
    ],
)
def test_other_sources_may_round_otherwise_but_not_err_otherwise(tmp_path, key, value, rounding):
    second = make(tmp_path / "b", prefix="1", edit=lambda i, r: with_value(r, key, value))
    found = compare(make(tmp_path / "a"), second)
    assert (found.rounded, len(found.changed)) == ((3, 0) if rounding else (0, 3))
    assert found.behind == ["the sources of hbvm-bench or of a method"]


def test_a_case_that_ends_otherwise_or_is_missing_is_a_change(tmp_path):
    def edit(number, record):
        if number == 0:
            return None
        if number == 1:
            return record
        return msgspec.structs.replace(record, result=Result(outcome="timeout", reason="slow"))

    found = compare(make(tmp_path / "a"), make(tmp_path / "b", edit=edit))
    assert found.only_first == ["IAS15(epsilon=1.0) on kepler()"]
    assert (found.changed[0].quantity, found.changed[0].before, found.changed[0].after) == (
        "outcome",
        "ok",
        "timeout",
    )
    assert not found.unchanged


def test_a_slower_machine_is_divided_out_and_a_slower_method_is_not(tmp_path):
    rng = np.random.default_rng(7)
    timings = [timing(rng, speed=3.0), timing(rng, level=0.013, speed=3.0), timing(rng, speed=3.0)]
    second = make(tmp_path / "b", 3, edit=lambda i, r: msgspec.structs.replace(r, timing=timings[i]))
    found = compare(make(tmp_path / "a"), second)
    assert [change.method for change in found.slower] == ["IAS15(epsilon=0.1)"]
    assert "times as long" in found.slower[0].after
    assert found.faster == []


def test_noise_is_hardly_ever_called_a_change(tmp_path):
    wrong = 0
    for seed in range(3):
        one = make(tmp_path / f"a{seed}", 60, seed=2 * seed)
        wrong += len((found := compare(one, make(tmp_path / f"b{seed}", 60, seed=2 * seed + 1))).slower)
        wrong += len(found.faster)
    assert wrong <= 1  # of 180; measured: 0


def test_times_without_a_core_of_their_own_are_not_compared(tmp_path):
    starved = timing(np.random.default_rng(1), load=Load(others=0.5, steal=0.0))
    second = make(tmp_path / "b", edit=lambda i, r: msgspec.structs.replace(r, timing=starved))
    found = compare(make(tmp_path / "a"), second)
    assert (found.timed, found.noise) == (0, None)
    assert "other work took 50% of a core" in found.untimed[0]
    assert found.unchanged


def test_the_command_says_what_changed_and_its_exit_code_too(tmp_path, capsys):
    make(tmp_path / "a")
    make(tmp_path / "b", prefix="1", edit=lambda i, r: with_value(r, "steps", 7.0))
    assert cli.main(["compare", str(tmp_path / "a"), str(tmp_path / "a")]) == 0
    assert "no change exceeds the noise" in capsys.readouterr().out
    assert cli.main(["compare", str(tmp_path / "a"), str(tmp_path / "b")]) == 1
    out = capsys.readouterr().out
    assert "9 compared, 6 equal, 0 within rounding, 3 changed" in out
    assert cli.main(["compare", str(tmp_path / "a"), str(tmp_path / "b"), "--json"]) == 1
    assert len(json.loads(capsys.readouterr().out)["changed"]) == 3
    assert cli.main(["compare", str(tmp_path / "a"), str(tmp_path / "none")]) == 2


def test_merged_runs_keep_of_each_case_what_got_further(tmp_path):
    def first_only(number, record):
        return record if number == 0 else msgspec.structs.replace(record, result=Result(outcome="timeout"))

    one = make(tmp_path / "a", edit=first_only)
    two = make(tmp_path / "b", seed=1, edit=lambda i, r: None if i == 0 else r)
    other = make(tmp_path / "c", 1, prefix="9")
    out = Store(tmp_path / "out")
    assert merge([one, two, other], out) == (4, 4, 0)
    records = out.records()
    assert [record.result.outcome for record in records] == 4 * ["ok"]
    assert records[0] == one.records()[0]
    assert records[1:3] == two.records()
    assert records[3].id.startswith("9")
    assert np.array_equal(out.series(records[1].id)["y"], np.arange(12.0).reshape(3, 4) / 7)
    with pytest.raises(InputError, match="holds a run already"):
        merge([one, two], out)
    assert not comparing.compare(one, out).unchanged


def test_the_merge_command_needs_two_runs(tmp_path, capsys):
    make(tmp_path / "a")
    make(tmp_path / "b", prefix="1")
    a, b, out = (str(tmp_path / name) for name in ("a", "b", "out"))
    assert cli.main(["merge", a, a, "--out", out]) == 2
    assert "two runs or more" in capsys.readouterr().err
    assert cli.main(["merge", a, b, "--out", out]) == 0
    assert "6 of 6 cases" in capsys.readouterr().out
    assert cli.main(["show", out]) == 0


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_an_exported_table_has_all_that_was_measured(tmp_path, ending):
    store = make(tmp_path / "a", edit=lambda i, r: with_value(r, "energy_max", 1 / 3))
    read = {"csv": _read_csv, "parquet": _read_parquet}[ending]
    assert export([store.directory], tmp_path / f"cases.{ending}") == 3
    row = read(tmp_path / f"cases.{ending}")[1]
    assert row["method"] == "IAS15(epsilon=0.1)"
    assert row["method_options"] == '{"epsilon":0.1}'
    assert float(row["energy_max"]) == 1 / 3
    assert int(row["time_samples"]) == 6
    assert row["t_stop"] in (None, "")
    assert set(METRICS) <= row.keys()
    assert export([store.directory], tmp_path / f"t.{ending}", "timings") == 18
    times = [float(row["seconds"]) for row in read(tmp_path / f"t.{ending}")[:6]]
    assert times == store.records()[0].timing.samples
    assert export([store.directory], tmp_path / f"s.{ending}", "series") == 54
    last = read(tmp_path / f"s.{ending}")[14]
    assert (last["quantity"], int(last["component"]), float(last["t"])) == ("y", 3, 2.0)
    assert float(last["value"]) == 11 / 7


def _read_csv(path):
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def _read_parquet(path):
    return pytest.importorskip("pyarrow.parquet").read_table(path).to_pylist()


def test_an_export_that_cannot_be_made_says_so_and_leaves_no_file(tmp_path, monkeypatch, capsys):
    make(tmp_path / "a")
    a, out = str(tmp_path / "a"), tmp_path / "out"
    assert cli.main(["export", a, "-o", str(out / "x.xlsx")]) == 2
    assert ".csv or .parquet" in capsys.readouterr().err
    assert cli.main(["export", a, "-o", str(out / "x.csv"), "--table", "case"]) == 2
    assert "did you mean 'cases'" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert cli.main(["export", a, "-o", str(out / "x.parquet")]) == 2
    assert "hbvm-bench[export]" in capsys.readouterr().err
    assert list(out.iterdir()) == []
    assert cli.main(["export", a, "-o", str(out / "x.csv")]) == 0
    assert "3 rows" in capsys.readouterr().out
