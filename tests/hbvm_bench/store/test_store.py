import io
import json
import math
import multiprocessing
import sqlite3
import zlib
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from hbvm_bench.store import arrays
from hbvm_bench.store.files import atomic, ensure_writable
from hbvm_bench.store.records import Compile, Timing, TimingRound, Value
from hbvm_bench.store.store import FILE, Store
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


def changed(store, statement, *given):
    """Do to the file what nobody does, from another connection."""
    with sqlite3.connect(store.path) as other:
        other.execute(statement, given)
    other.close()


def test_a_missing_or_damaged_record_is_not_there(store):
    assert store.load(ID) is None
    store.save(RECORD)
    for text in ("[]", msgspec.json.encode(RECORD).decode()[:-50]):
        changed(store, "UPDATE results SET record=?", text)
        assert store.load(ID) is None
        assert list(store.everything()) == []


def npy(header, values=b""):
    """Return a file with one array of that header, as long as numpy asks headers to be."""
    text = header.encode().ljust(-(len(header) + 11) % 64 + len(header)) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + values


def numpy_file(values):
    stream = io.BytesIO()
    np.save(stream, values)
    return stream.getvalue()


HEADER = "{{'descr': '<f8', 'fortran_order': False, 'shape': {}}}"
WHOLE = arrays.packed(np.arange(100.0))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        WHOLE[:50],
        WHOLE[:-5],
        zlib.compress(b"no array"),
        numpy_file(np.array([{"a": 1}], dtype=object)),
        numpy_file(np.full(3, "x")),
        numpy_file(np.full(3, 1j)),
        npy(HEADER.format("(100000000000,)")),
        npy(HEADER.format("(-1,)"), bytes(64)),
        npy("{'descr': '<f8', 'shape': ((("),
        npy("(" * 5000),
    ],
)
def test_an_array_that_is_none_is_refused_in_one_sentence(store, data):
    store.save(RECORD, {"t": np.arange(3.0)})
    changed(store, "UPDATE arrays SET data=?", data)
    with pytest.raises(InputError, match="is damaged"):
        store.series(ID)


def test_an_array_takes_no_more_memory_than_is_allowed(monkeypatch):
    content = arrays.packed(np.zeros(10**6))  # 8 MB in 8 kB
    assert len(content) < 10_000
    monkeypatch.setenv("HBVM_BENCH_MAX_GIB", "0.01")
    assert arrays.unpacked(content).size == 10**6
    monkeypatch.setenv("HBVM_BENCH_MAX_GIB", "0.007")
    with pytest.raises(ValueError, match="HBVM_BENCH_MAX_GIB"):
        arrays.unpacked(content)


def test_a_name_that_is_none_is_not_there(store):
    store.save(RECORD, {"t": np.arange(3.0), '"><script>': np.ones(3), "../../x": np.ones(3)})
    assert list(store.series(ID)) == ["t"]


def test_a_row_and_its_arrays_are_there_together_or_not_at_all(store):
    """The second array cannot be stored."""
    with pytest.raises(ValueError, match="Object arrays cannot be saved"):
        store.save(RECORD, {"t": WHOLE, "y": None})
    assert store.load(ID) is None
    assert store.series(ID) == {}


def test_a_full_disk_is_one_sentence_and_leaves_what_there_was(store):
    store.save(RECORD, {"t": np.arange(3.0)})
    store._database.execute("PRAGMA max_page_count=20")
    noise = np.random.default_rng(1).standard_normal(10**5)
    with pytest.raises(InputError, match=r"cannot read or write .*: No space left on device"):
        store.save(made_up_run.record("other()"), {"t": noise})
    assert [one.id for one in store.everything()] == [ID]
    assert store.series(ID)["t"].tolist() == [0.0, 1.0, 2.0]


def test_a_run_ends_as_one_file(store):
    with store.locked():
        store.save(RECORD)
        assert {path.name for path in store.directory.iterdir()} >= {FILE, f"{FILE}-wal"}
    assert {path.name for path in store.directory.iterdir()} == {FILE}


def test_others_read_while_a_run_writes(store):
    with store.locked():
        store.save(RECORD)
        assert Store(store.directory).load(ID) == RECORD


def test_there_is_no_log_of_transactions_on_a_file_system_of_a_network(tmp_path, monkeypatch):
    kind = SimpleNamespace(mountpoint=str(tmp_path), fstype="nfs4")
    monkeypatch.setattr("psutil.disk_partitions", lambda **_: [kind])
    made = Store(tmp_path / "run")
    made.prepare()
    assert made._database.execute("PRAGMA journal_mode").fetchone() == ("delete",)
    made.save(RECORD)
    assert Store(tmp_path / "run").load(ID) == RECORD


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
    with sqlite3.connect(store.path) as other:
        ((text,),) = other.execute("SELECT record FROM results").fetchall()
    other.close()
    parsed = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in JSON"))
    assert parsed["result"]["reason"] == '"<é>'


def test_a_directory_without_a_run_says_so(tmp_path):
    with pytest.raises(InputError, match="has no results"):
        Store(tmp_path).index()
    with pytest.raises(InputError, match="does not exist"):
        Store(tmp_path / "nowhere").index()
    Store(tmp_path / "new").prepare()
    with pytest.raises(InputError, match="has no run yet"):
        Store(tmp_path / "new").index()


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
    assert timing.compile == Compile(seconds=2.0, cached=False)
    assert Timing(rounds=rounds[1:]).compile == Compile(seconds=0.1, cached=True)
    assert Timing(why="x").summary == {}
    assert Timing(rounds=rounds[2:]).summary == {"median": 9.0, "min": 9.0, "q1": 9.0, "q3": 9.0}
