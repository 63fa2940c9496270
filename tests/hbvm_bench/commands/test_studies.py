"""Studies with a command of their own give the page of ``run NAME --report``, byte for byte."""

from pathlib import Path

import msgspec
import pytest

from hbvm_bench.campaign.file import load
from hbvm_bench.campaign.shorter import chosen, quick_run
from hbvm_bench.cli import main
from hbvm_bench.store.store import PACKED, Store
from tests.hbvm_bench import made_up_run


def pages(directory, command):
    """Return every file of a report, its rows read, with a word for the command that it names."""
    files = {path.name: path.read_bytes() for path in directory.rglob("*") if path.is_file()}
    (stored,) = Store(directory / PACKED).runs()
    rows = [*stored.records(), stored.computed(), stored.index()]
    files[PACKED] = msgspec.json.encode(rows)
    assert any(command.encode() in content for content in files.values())
    return {name: content.replace(command.encode(), b"COMMAND") for name, content in files.items()}


@pytest.mark.parametrize(
    ("name", "problem", "quick"),
    [("race", "kepler", ["--quick"]), ("automatic", "kepler", []), ("endure", "outer_solar_system", [])],
)
def test_a_study_and_its_campaign_draw_the_same_bytes(name, problem, quick, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    campaign = chosen(load(name), [problem])
    monkeypatch.setattr("hbvm_bench.commands.run.load", lambda asked: campaign)
    place = Path("runs") / (name + "-quick" * bool(quick))
    made_up_run.finish(Store(place), quick_run(campaign) if quick else campaign)
    assert main([name, *quick]) == 0
    mine = pages(place / "report", " ".join(["hbvm-bench", name, *quick]))
    assert main(["run", name, *quick, "--report", "theirs"]) == 0
    theirs = pages(Path("theirs"), " ".join(["hbvm-bench", "run", name, *quick]))
    assert mine.keys() == theirs.keys()
    assert [one for one in mine if mine[one] != theirs[one]] == []
