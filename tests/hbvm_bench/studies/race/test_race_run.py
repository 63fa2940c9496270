import json

import pytest

from hbvm_bench.cli import main
from hbvm_bench.report.page import gather
from hbvm_bench.store.store import FILE, Store
from hbvm_bench.studies.race import results


@pytest.mark.slow
def test_the_quick_race_runs_and_prints_json(tmp_path, capsys):
    pytest.importorskip("heyoka")
    arguments = ["race", "--quick", "--problem", "kepler", "--rounds", "2", "--json", "--out", str(tmp_path)]
    assert main(arguments) == 0
    data = json.loads(capsys.readouterr().out)
    assert [race["problem"] for race in data["races"]] == ["kepler"]
    assert {ratio["peer"] for ratio in data["ratios"]} == {"Taylor", "IAS15", "Leapfrog", "DOP853"}
    assert {path.name for path in tmp_path.iterdir()} == {FILE, "report"}
    (race,) = results.races_of(gather([Store(tmp_path)]))
    ours, taylor = race.best("", 1e-13, 1e-10), race.best("Taylor", 1e-13, 1e-10)
    for record, energy, position in ((ours, 1e-13, 1e-10), (taylor, 1e-13, 1e-11)):
        assert record.result.metrics["energy_max"].value < energy  # measured 7e-15 and 3e-15
        assert record.result.metrics["position_end"].value < position  # measured 6e-13 and 5e-14
        assert [one.number for one in record.timing.rounds] == [0, 1]
        assert record.timing.call > 0
    assert len(race.calibration) == 2
    assert str(tmp_path) not in (tmp_path / "report" / "README.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--problem", "keppler"], "kepler"),
        (["--rounds", "1"], "rounds"),
        (["--out", "/proc/nowhere"], "cannot write"),
        (["--speed"], "speed"),
    ],
)
def test_what_cannot_be_used_is_one_sentence_and_exit_code_2(arguments, words, capsys):
    assert main(["race", *arguments]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_the_settings_are_printed_without_running(capsys):
    assert main(["race", "--settings", "--problem", "kepler"]) == 0
    said = capsys.readouterr().out
    assert "Gauss(s=16, h=0.5)" in said
    assert "heyoka, Taylor, adaptive step size, 16" in said
