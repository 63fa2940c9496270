import re
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from hbvm_bench.campaign.file import name_of
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.campaign.shorter import chosen, quick_run
from hbvm_bench.commands.studies import race_as_data
from hbvm_bench.measure.computation import VALUE, packed
from hbvm_bench.report.figures.style import looks
from hbvm_bench.report.markdown import printed
from hbvm_bench.report.page import gather, page_of
from hbvm_bench.report.write import write
from hbvm_bench.store.records import Load
from hbvm_bench.store.store import PACKED, opened
from hbvm_bench.studies.race import report, results, tables
from hbvm_bench.studies.race.figures import work_precision
from hbvm_bench.summaries import standings
from problems.errors import InputError
from tests.hbvm_bench.made_up_run import results_of
from tests.hbvm_bench.studies.race.conftest import made_up, record, save

REPORTS = Path(__file__).parents[4] / "reports"


def test_a_stored_race_is_read_back_equal(race, tmp_path):
    save(race, tmp_path)
    (found,) = results.races_of(gather(opened([tmp_path])))
    assert (found.entry, found.run, found.records) == (race.entry, race.run, race.records)
    assert [p.name for p in tmp_path.iterdir()] == [PACKED]  # no temporary file is left


def test_compile_times_that_are_none_are_refused(race):
    stored = {"compile times of kepler": (None, {VALUE: packed([{"contest": 1}])})}
    with pytest.raises(InputError, match="compile times of the race are damaged"):
        results.races_of(results_of(race.run, computed=stored))


def test_the_json_has_ratios_goals_and_all_samples(race):
    data = msgspec.json.decode(msgspec.json.encode(race_as_data([race])))
    goal = next(goal for goal in data["goals"] if goal["goal"]["against"] == "Taylor")
    assert goal["ratio"] == pytest.approx(15.0)
    assert goal["verdict"] == "reached"
    (first, *_) = data["races"][0]["cases"]
    samples = [one["samples"] for one in first["timing"]["rounds"]]
    assert samples == [one.samples for one in race.records[0].timing.rounds]
    levels = [r for r in data["ratios"] if r["peer"] == "Taylor"]
    assert [r["energy"] for r in levels[1:]] == pytest.approx([10.0**-d for d in range(8, 15)])


def test_the_report_is_drawn_from_the_results_alone_and_deterministic(race, tmp_path):
    first = [path.read_bytes() for path in write(page_of(results_of(race.run)), tmp_path / "a")]
    second = [path.read_bytes() for path in write(page_of(results_of(race.run)), tmp_path / "b")]
    assert first == second
    figure = "figures/work-precision-outer_solar_system.svg"
    assert (tmp_path / "a" / figure).read_bytes() == (tmp_path / "b" / figure).read_bytes()
    assert figure in first[0].decode()


def test_the_page_asks_for_nothing_and_escapes_everything(race, tmp_path):
    page = write(page_of(results_of(race.run)), tmp_path)[1].read_text()
    assert "<b>fast</b>" not in page
    assert "&lt;b&gt;fast&lt;/b&gt;" in page
    assert not re.search(r'(?:src|href)="(?!#|results\.sqlite\.xz")', page)
    assert page.count("<table") == page.count("</table>")


def with_load(race, load):
    """Return a race beside which the machine had so much other work."""
    records = [
        msgspec.structs.replace(one, timing=one.timing and msgspec.structs.replace(one.timing, load=load))
        for one in race.records
    ]
    return replace(race, records=records)


def test_the_report_says_what_is_doubtful_void_refused_and_quick(race):
    assert "doubtful" in " ".join(report.remarks(with_load(race, Load(others=0.3, steal=0.0))))
    said = " ".join(report.remarks(race))
    assert "doubtful" not in said
    assert "quick run" in said
    assert "Does not apply: REBOUND, leapfrog" in said
    rows = {row[0]: row for row in tables.everything(race).rows}
    assert rows["IAS15(mode='global')"][2] == "(1.0e-15)"
    assert rows["IAS15()"][-1] == "stalled: stood still"


def test_the_times_of_several_compilations_are_compared(race):
    assert not any("Compiled" in said for said in report.remarks(race))
    first = race.records[0]
    rounds = [msgspec.structs.replace(one, compilation=i) for i, one in enumerate(first.timing.rounds)]
    timed = msgspec.structs.replace(first, timing=msgspec.structs.replace(first.timing, rounds=rounds))
    (said,) = [one for one in report.remarks(replace(race, records=[timed])) if "Compiled" in one]
    assert "Compiled 3 times" in said
    assert "at most 1.33 times (Gauss(s=8, h=2.0))" in said  # 1.2 over 0.9, the record's rounds


def test_the_best_compilation_of_each_family_stands_beside_the_median(race):
    assert tables.compiled(race) is None

    def recompiled(record):
        if record.timing is None:
            return record
        rounds = [msgspec.structs.replace(one, compilation=i) for i, one in enumerate(record.timing.rounds)]
        return msgspec.structs.replace(record, timing=msgspec.structs.replace(record.timing, rounds=rounds))

    again = replace(race, records=[recompiled(record) for record in race.records])
    table = tables.compiled(again)
    assert table is not None
    assert table.rows[0][1] == "HBVM and Gauss"
    assert {row[3] for row in table.rows} == {"3"}
    assert {row[6] for row in table.rows} == {"1.33"}
    assert [row[1] for row in table.rows[1:]] == ["heyoka"]  # IAS15 is not as accurate


def test_compile_times_are_shown_where_the_machine_had_no_other_work(race):
    assert tables.compiling(with_load(race, Load(others=0.3, steal=0.0))) is None
    assert tables.compiling(with_load(race, None)).rows[0][2:] == ("2.5 s", "3.5 s")


def test_the_tables_say_why_there_is_no_ratio(race):
    (row,) = tables.headline([race]).rows
    cells = dict(zip(tables.headline([race]).head, row, strict=True))
    assert cells["heyoka"] == "15.0× (15.0–15.0)"
    assert cells["IAS15"] == "no valid run"
    assert cells["leapfrog"] == "does not apply"
    assert cells["WHFast"] == "not reached"


def test_times_stand_at_position_errors_from_loose_to_tight_whatever_the_energy_error(race):
    table = tables.positions(race)
    assert table is not None
    assert [row[0] for row in table.rows] == ["1e-03", "1e-06", "1e-09", "1e-12"]
    assert [row[1] for row in table.rows] == [*["Gauss(s=8, h=2.0)"] * 3, "not reached"]
    taylor = table.head.index("heyoka × HBVM and Gauss")
    cells = [row[taylor].split()[0] for row in table.rows]
    assert cells == ["15.0×", "15.0×", "30.0×", "30"]  # the last, 30 ms, alone
    assert tables.positions(replace(race, records=race.records[5:7])) is None  # none has a time


def test_goals_are_listed_with_their_verdict(race):
    verdicts = {verdict.goal.against: verdict.verdict for verdict in race.goals}
    assert verdicts == {"Taylor": "reached", "IAS15": "missed", "WHFast": "reached"}
    assert [row[-1] for row in tables.goals([race]).rows][
        1
    ] == "missed: no setting of the other library is as accurate"


def test_a_race_without_any_valid_run_has_no_figure(race):
    excluded = replace(race, records=race.records[5:7])
    assert work_precision(excluded, looks([])) is None


def test_fixed_and_adaptive_steps_are_rows_of_their_own_and_the_faster_counts(race):
    own = record("HBVM(tol=1e-14)", 0.0005, 5e-14, 5e-11)
    both = replace(race, records=[*race.records, own])
    rows = {row[0]: row[1] for row in tables.fastest(both).rows}
    assert rows["HBVM and Gauss, fixed step size"] == "Gauss(s=8, h=1.5)"
    assert rows["HBVM and Gauss, adaptive step size"] == "HBVM(tol=1e-14)"
    assert (rows["heyoka, Taylor, adaptive step size"], rows["REBOUND, WHFast, fixed step size"]) == (
        "Taylor()",
        "not reached",
    )
    table = tables.headline([both])
    cells = dict(zip(table.head, table.rows[0], strict=True))
    assert cells["HBVM and Gauss, fixed step size"].startswith("2 ms")
    assert cells["HBVM and Gauss, adaptive step size"].startswith("500 µs")
    assert cells["heyoka"].startswith("60.0×")


def test_the_report_names_one_command_where_the_problems_together_are_one_run(race):
    def run(key, words):
        entry = msgspec.structs.replace(race.entry, name=key)
        index = msgspec.structs.replace(race.run.index, command=words)
        return replace(race, entry=entry, run=msgspec.structs.replace(race.run, index=index))

    keys = [name_of(entry) for entry in results.declared().entries()]
    single = [run(key, f"hbvm-bench race --problem {key} --out x") for key in keys]
    assert report.commands(single) == "hbvm-bench race --out x"
    assert report.commands(single[1:]) == "\n".join(one.run.command for one in single[1:])
    other = [run("kepler", "hbvm-bench race --problem kepler --rounds 5 --out x"), *single[1:]]
    assert report.commands(other).count("\n") == len(keys) - 1


def test_the_rules_are_those_of_the_run_and_not_of_the_file_of_today(race):
    timing = msgspec.structs.replace(race.run.index.campaign.timing, shortest=0.05)
    campaign = msgspec.structs.replace(race.run.index.campaign, timing=timing)
    run = msgspec.structs.replace(race.run, index=msgspec.structs.replace(race.run.index, campaign=campaign))
    said = " ".join(report.rules([replace(race, run=run)]))
    assert "as last 50 ms." in said


def test_a_quick_run_has_the_best_known_setting_of_every_family():
    for races in results.by_kind(gather(opened([REPORTS / "race"]))).values():
        for race in races:
            short = msgspec.structs.replace(chosen(results.declared(), [race.key]), quick=True)
            there = {resolve(case).case.method for case in short.cases()}
            within = dict(zip(results.ERRORS, race.asked, strict=True))
            best = [standings.best(race.settings(family), within) for family in race.families]
            assert {one.case.method for one in best if one is not None} <= there


def test_families_are_compared_by_as_many_settings_each():
    campaign = chosen(results.declared(), ["outer_solar_system"])
    (entry,) = campaign.entries()
    records = [record(case.method, 0.01, 1e-14, 1e-12) for case in campaign.cases()]
    found = results.Race(entry, made_up().run, records)
    assert {family: len(of) for family, of in found.competing.items()} == dict.fromkeys(found.families, 16)
    for family in ("", "IAS15"):
        kinds = [row for row in found.rows if row.family == family]
        assert [one for row in kinds for one in found.rows[row][::2]] == found.competing[family]
    quick = quick_run(campaign)
    records = [record(case.method, 0.01, 1e-14, 1e-12) for case in quick.cases()]
    found = results.Race(entry, made_up().run, records)
    assert {family: len(of) for family, of in found.competing.items()} == dict.fromkeys(found.families, 6)


def test_the_table_of_the_readme_is_that_of_the_stored_results():
    races = results.races_of(gather(opened([REPORTS / "race"])))
    table = printed(replace(tables.overview(races), title="", note=""))
    assert table in (REPORTS.parent / "README.md").read_text(encoding="utf-8"), table
