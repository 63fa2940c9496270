"""The time of an interval far longer than those that were measured."""

import pytest

from hbvm_bench.campaign.file import load
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.store.store import Index, StoredRun
from hbvm_bench.summaries import frame
from hbvm_bench.summaries.longer import longer
from tests.hbvm_bench import made_up_run

SETTING = "Gauss(s=8, h=0.025)"


def run(seconds, positions):
    campaign, records = load("planets"), []
    for case in map(resolve, campaign.cases()):
        place = int("10000" in case.case.problem)
        time = seconds[place] * (1.0 if case.case.method == SETTING else 3.0)
        metrics = {"energy_max": 1e-15, "position_end": positions[place], "steps": 1000.0}
        records.append(made_up_run.record(case, [time], metrics=metrics))
    index = Index(campaign=campaign, ids=[one.id for one in records], version="0", command="")
    return frame.cases([StoredRun(index=index, records=records)])


def test_the_fastest_setting_of_the_longest_interval_is_extrapolated_in_proportion():
    table = longer(run((0.05, 1.0), (1e-10, 2e-9)), 5e9, "years")
    assert table is not None
    assert table.head[-1] == "5e+09 years"
    families = [row[0] for row in table.rows]
    assert families == ["HBVM and Gauss", "WHFast", "WHFast512", "SABA", "IAS15", "Taylor"]
    row = dict(zip(table.head, table.rows[0], strict=True))
    assert row["setting"] == SETTING
    assert row["a step"] == "1 ms"
    assert row["10,000 years"] == "1 s"
    assert row["grows as"] == "t^1.0"  # 20 times the error after 20 times the time
    assert float(row["5e+09 years"].split()[0]) == pytest.approx(5.79, abs=0.01)  # 500,000 s


def test_what_is_not_accurate_enough_is_not_extrapolated():
    assert longer(run((0.05, 1.0), (1e-10, 1e-3)), 5e9, "years") is None
