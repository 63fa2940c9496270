import json
import math
import multiprocessing

import numpy as np
import pytest

from hbvm_bench.store.files import atomic, ensure_writable
from hbvm_bench.store.records import Compile, Timing, TimingRound, Value
from hbvm_bench.store.store import Store
from problems.errors import InputError
from tests.hbvm_bench import made_up_run

ID = "0123456789abcdef" * 4
RECORD = made_up_run.record(id=ID, metrics={"energy_max": 1e-15})


@pytest.fixture
def store(tmp_path):
    made = Store(tmp_path / "run")
    made.prepare()
    return made


def test_what_is_saved_is_loaded(store):
    series = {"t": np.arange(3.0), "y": np.array([[1.0], [np.nan], [np.inf]])}
    store.save(RECORD, series)
    assert store.load(ID) == RECORD
    loaded = store.series(ID)
    assert loaded.keys() == series.keys()
    assert all(np.array_equal(loaded[k], series[k], equal_nan=True) for k in series)


def test_a_missing_cut_or_foreign_record_is_not_there(store):
    assert store.load(ID) is None
    store.save(RECORD)
    path = store.cases / f"{ID[:24]}.json"
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert store.load(ID) is None
    path.write_bytes(whole.replace(ID.encode(), ID[::-1].encode()))
    assert store.load(ID) is None
    path.write_bytes(b"[]")
    assert store.load(ID) is None


def test_series_that_are_missing_or_cut_are_empty(store):
    assert store.series(ID) == {}
    store.save(RECORD, {"t": np.arange(100.0)})
    path = store.cases / f"{ID[:24]}.npz"
    path.write_bytes(path.read_bytes()[:50])
    assert store.series(ID) == {}


def test_pickles_are_not_read(store):
    store.save(RECORD)
    with (store.cases / f"{ID[:24]}.npz").open("wb") as stream:
        np.savez(stream, t=np.array([{"a": 1}], dtype=object))
    assert store.series(ID) == {}


def test_a_file_is_whole_or_not_there(tmp_path):
    target = tmp_path / "x"
    target.write_text("old")

    def write_half():
        with atomic(target) as temporary:
            temporary.write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def _write(path, letter):
    for _ in range(100):
        with atomic(path) as temporary:
            temporary.write_text(letter * 10_000)


def test_two_processes_that_write_one_file_leave_one_of_their_files(tmp_path):
    target = tmp_path / "x"
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_write, args=(target, letter)) for letter in "ab"]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        text = target.read_text() if target.exists() else ""
        assert text in ("", "a" * 10_000, "b" * 10_000)
    for writer in writers:
        writer.join()
        assert writer.exitcode == 0
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_no_metric_is_nan_or_infinite(bad):
    with pytest.raises(ValueError, match="finite"):
        Value(value=bad)


def test_a_record_is_json_that_anyone_can_read(store):
    store.save(made_up_run.record(id=ID, outcome="stalled", status="stalled", t_stop=8.5, reason='"<é>'))
    text = (store.cases / f"{ID[:24]}.json").read_text(encoding="utf-8")
    parsed = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in JSON"))
    assert parsed["result"]["reason"] == '"<é>'


def test_a_directory_without_a_run_says_so(tmp_path):
    with pytest.raises(InputError, match="has no results"):
        Store(tmp_path).index()
    with pytest.raises(InputError, match="does not exist"):
        Store(tmp_path / "nowhere").index()
    (tmp_path / "campaign.json").write_text('{"x": 1}')
    with pytest.raises(InputError, match="not the index"):
        Store(tmp_path).index()


def test_a_place_that_cannot_be_written_is_refused_and_left_as_it_was(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="cannot write"):
        ensure_writable(tmp_path / "file" / "below" / "it")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_timing_keeps_its_samples_and_tells_median_and_quartiles():
    compiles = [Compile(seconds=s, cached=c) for s, c in ((2.0, False), (0.2, True), (0.1, True))]
    rounds = [
        TimingRound(samples=samples, repeats=3, compile=compile_)
        for samples, compile_ in zip(([1.0, 2.0], [3.0, 4.0], [9.0]), compiles, strict=True)
    ]
    timing = Timing(rounds=rounds)
    assert timing.samples == [1.0, 2.0, 3.0, 4.0, 9.0]
    assert timing.summary == {"median": 3.0, "min": 1.0, "q1": 2.0, "q3": 4.0}
    assert timing.compile == Compile(seconds=0.2, cached=True)
    assert Timing(why="x").summary == {}
    assert Timing(rounds=rounds[2:]).summary == {"median": 9.0, "min": 9.0, "q1": 9.0, "q3": 9.0}
