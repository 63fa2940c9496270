"""What a report must survive: ensembles, names that attack, bytes that command a terminal."""

import pytest

from hbvm_bench import cli

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
    ours, together = text[text.index("\n## ") :].split("3 trajectories at once", 1)
    assert "| `Gauss(s=2, h=0.25)` |" in ours
    assert "| `Gauss(s=3, h=0.25)` |" not in ours
    assert "| `Gauss(s=3, h=0.25)` |" in together
    assert "3 trajectories at once" in (tmp_path / "r" / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("command", [["report", "empty", "-o", "deep/r"], ["report", "nowhere", "-o", "r"]])
def test_a_report_that_cannot_be_made_leaves_no_directory(tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "campaign.json").write_text(
        '{"campaign": {"name": "x", "problems": ["pendulum()"], "methods": [{"use": "IAS15()"}]}, '
        '"ids": ["0"], "version": "0", "command": "hbvm-bench run x"}'
    )
    assert cli.main(command) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["empty"]
