import re

import msgspec
import pytest

from hbvm_bench.commands.race import as_data
from hbvm_bench.report.figures.style import looks
from hbvm_bench.report.write import write
from hbvm_bench.studies.race import report, results, tables
from hbvm_bench.studies.race.contests import CONTESTS
from hbvm_bench.studies.race.figures import front, work_precision
from problems.errors import InputError

KEY = "outer_solar_system"


def test_a_stored_race_is_read_back_equal(race, tmp_path):
    path = results.save(race, tmp_path)
    assert path.name == f"{KEY}.json"
    assert results.load(tmp_path, [KEY]) == [race]
    assert [p.name for p in tmp_path.iterdir()] == [path.name]  # no temporary file is left


def test_an_empty_directory_says_how_to_fill_it(tmp_path):
    with pytest.raises(InputError, match="hbvm-bench race --out"):
        results.load(tmp_path, [KEY])


@pytest.mark.parametrize("content", [b"", b"{", b'{"contest": 1}', b"[]"])
def test_a_file_that_is_no_race_is_refused_by_name(content, tmp_path):
    (tmp_path / f"{KEY}.json").write_bytes(content)
    with pytest.raises(InputError, match=f"{KEY}.json"):
        results.load(tmp_path, [KEY])


def test_a_race_of_another_version_is_refused(race, tmp_path):
    results.save(msgspec.structs.replace(race, schema=0), tmp_path)
    with pytest.raises(InputError, match="another version"):
        results.load(tmp_path, [KEY])


def test_the_json_has_ratios_goals_and_all_samples(race):
    data = msgspec.json.decode(msgspec.json.encode(as_data([race])))
    goal = next(goal for goal in data["goals"] if goal["peer"] == "heyoka")
    assert goal["ratio"] == pytest.approx(15.0)
    assert goal["reached"]
    assert data["races"][0]["outcomes"][0]["seconds"] == race.outcomes[0].seconds
    levels = [r for r in data["ratios"] if r["peer"] == "heyoka"]
    assert [r["energy"] for r in levels[1:]] == pytest.approx([10.0**-d for d in range(8, 15)])


def test_the_report_is_drawn_from_the_results_alone_and_deterministic(race, tmp_path):
    first = [path.read_bytes() for path in write(report.document([race]), tmp_path / "a")]
    second = [path.read_bytes() for path in write(report.document([race]), tmp_path / "b")]
    assert first == second
    figure = "figures/work-precision-outer_solar_system.svg"
    assert (tmp_path / "a" / figure).read_bytes() == (tmp_path / "b" / figure).read_bytes()
    assert figure in first[0].decode()


def test_the_page_asks_for_nothing_and_escapes_everything(race, tmp_path):
    page = write(report.document([race]), tmp_path)[1].read_text()
    assert "<b>fast</b>" not in page
    assert "&lt;b&gt;fast&lt;/b&gt;" in page
    assert not re.search(r'(?:src|href)="(?!#|figures/|data/|\w+\.json")', page)
    assert page.count("<table") == page.count("</table>")


def test_the_report_says_what_is_doubtful_void_refused_and_quick(race):
    said = " ".join(report.remarks(race))
    assert "doubtful" in said
    assert "quick run" in said
    assert "Does not apply: REBOUND, leapfrog" in said
    rows = {row[0]: row for row in tables.everything(race).rows}
    assert rows["IAS15(mode='global')"][2] == "(1.0e-15)"
    assert rows["IAS15()"][-1] == "stalled: stood still"


def test_the_tables_say_why_there_is_no_ratio(race):
    (row,) = tables.headline([race]).rows
    cells = dict(zip(tables.headline([race]).head, row, strict=True))
    assert cells["heyoka"] == "15.0× (15.0–15.0)"
    assert cells["IAS15"] == "no valid run"
    assert cells["leapfrog"] == "does not apply"
    assert cells["WHFast"] == "not reached"


def test_goals_are_listed_with_their_verdict(race):
    verdicts = {row[1]: row[-1] for row in tables.goals([race]).rows}
    assert verdicts == {"heyoka": "reached", "IAS15": "missed", "WHFast": "reached"}


def test_a_race_without_any_valid_run_has_no_figure(race):
    void = msgspec.structs.replace(race, outcomes=race.outcomes[5:7])
    assert work_precision(void, looks([])) is None


def test_the_front_of_a_family_is_beaten_by_none_of_it(race):
    ours = [o for o in race.outcomes if o.setting.family == "hbvm"]
    assert [o.setting.method for o in front(ours, "position")] == ["Gauss(s=8, h=2.0)", "Gauss(s=8, h=1.5)"]
    assert [o.setting.method for o in front(ours, "energy")] == [
        "Gauss(s=8, h=2.0)",
        "HBVM(k=16, s=8, h=2.0)",
    ]


def test_the_report_names_one_command_where_the_contests_together_are_one_run(race):
    def run(key, words):
        contest = msgspec.structs.replace(race.contest, key=key)
        return msgspec.structs.replace(race, contest=contest, command=words)

    single = [run(key, f"hbvm-bench race --problem {key} --out x") for key in CONTESTS]
    assert report.commands(single) == "hbvm-bench race --out x"
    assert report.commands(single[1:]) == "\n".join(one.command for one in single[1:])
    other = [run("kepler", "hbvm-bench race --problem kepler --rounds 5 --out x"), *single[1:]]
    assert report.commands(other).count("\n") == len(CONTESTS) - 1
