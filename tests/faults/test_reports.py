"""What a report must survive: ensembles, names that attack, bytes that command a terminal."""

import lzma
import re
from typing import Any

import msgspec
import pytest

from hbvm_bench import cli
from hbvm_bench.store.store import PACKED, Store, StoredRun
from problems.errors import InputError
from tests.hbvm_bench.made_up_run import archived
from tests.hbvm_bench.studies import made_up_studies

ENSEMBLE = """
name = "both"

[grid]
count = 20

[[problems]]
use = "pendulum(t_end=5.0)"

[[methods]]
use = "Gauss(s=2, h=0.25)"

[[ensembles]]
problem = "pendulum(t_end=5.0)"
count = 3
methods = [{ use = "Gauss(s=3, h=0.25)" }]
"""


def test_a_campaign_with_an_ensemble_is_run_and_reported_as_it_is_typed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "both.toml").write_text(ENSEMBLE)
    assert cli.main(["run", "both.toml", "--no-timing", "--report", "r"]) == 0
    assert "t_end=5.0), 3 trajectories at once" in " ".join(capsys.readouterr().out.split())
    text = (tmp_path / "r" / "report.md").read_text(encoding="utf-8")
    ours, together = text[text.index("\n| # | method") :].split("3 trajectories at once", 1)
    assert "| `Gauss(s=2, h=0.25)` |" in ours
    assert "| `Gauss(s=3, h=0.25)` |" not in ours
    assert "| `Gauss(s=3, h=0.25)` |" in together
    one, several = text[text.index("## Results") : text.index("\n| # | method")].split("3 trajectories", 1)
    assert "at these ends" in several
    assert "at these ends" not in one
    assert "3 trajectories at once" in (tmp_path / "r" / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("command", [["report", "empty", "-o", "deep/r"], ["report", "nowhere", "-o", "r"]])
def test_a_report_that_cannot_be_made_leaves_no_directory(tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    Store(tmp_path / "empty").prepare()
    assert cli.main(command) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["empty"]


HOSTILE = "\x1b]0;named\x07\x1b[2J<script>alert(1)</script> [/bold] ``` \u200f![x](http://example.org)"


def stored_results(directory):
    """Store results of all three kinds whose texts attack whoever shows them."""
    said: dict[str, Any] = {
        "machine": {"processor": HOSTILE, "llvm_processor": HOSTILE},
        "versions": {HOSTILE: HOSTILE},
    }
    said["command"] = f"{HOSTILE}\n```\n{HOSTILE}"
    archived(directory / "race", made_up_studies.race(**said))
    store = made_up_studies.endurance(directory / "endure", starts=3)
    for record in store.records():
        timing = msgspec.structs.replace(record.timing, machine=said["machine"])
        store.save(msgspec.structs.replace(record, timing=timing, versions=said["versions"]))
    store.write_index(msgspec.structs.replace(store.index(), command=said["command"]))
    run = made_up_studies.defaults(said["machine"])
    records = [msgspec.structs.replace(one, versions=said["versions"]) for one in run.records]
    index = msgspec.structs.replace(run.index, command=said["command"])
    archived(directory / "automatic", StoredRun(index=index, records=records))


@pytest.mark.parametrize("name", ["race", "endure", "automatic"])
def test_a_stored_result_commands_no_terminal_and_leaves_no_markdown(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    stored_results(tmp_path)
    assert cli.main(["report", name, "-o", "r"]) == 0
    said = capsys.readouterr().out
    assert "\x1b" not in said
    assert "\u200f" not in said
    assert "<script>alert" not in (tmp_path / "r" / "index.html").read_text(encoding="utf-8")
    said = (tmp_path / "r" / "report.md").read_text(encoding="utf-8")
    assert "\x1b" not in said
    for line in said.splitlines():
        assert line.startswith("    ") or not re.search(r"(?<!\\)<script|^```|[^\\`]```", line)


def test_a_race_whose_problem_is_no_file_name_is_refused(tmp_path):
    """It names the files of the report."""
    archived(tmp_path, made_up_studies.race())
    path = tmp_path / PACKED
    content = lzma.decompress(path.read_bytes())
    path.write_bytes(lzma.compress(content.replace(b'"outer_solar_system"', b'"../../../elsewhere"')))
    (stored,) = Store(path).runs()
    with pytest.raises(InputError, match="must be a file name"):
        stored.index()
