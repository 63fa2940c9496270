"""What leaves a run for other tools says which case it was."""

import csv
import json

import msgspec
import pytest
from msgspec.structs import replace

from hbvm_bench.campaign.entries import Checks, Ensemble
from hbvm_bench.campaign.grid import Grid
from hbvm_bench.summaries import export
from hbvm_bench.summaries.frame import case, framed
from tests.hbvm_bench import made_up_run


@pytest.fixture(scope="module")
def records():
    record, _ = made_up_run.made_up("HBVM(k=16, s=8, h=0.125)", 0)
    small = Ensemble(count=10, vary=(("e", 0.1),))
    cases = [
        replace(record.case, checks=Checks(starts=4)),
        replace(record.case, grid=Grid(), ensemble=small),
        replace(record.case, grid=Grid(), ensemble=replace(small, count=20)),
    ]
    return [replace(record, case=case) for case in cases]


def test_json_has_the_grid_the_checks_and_the_ensemble_with_their_defaults(records):
    one, small, large = json.loads(msgspec.json.encode(export.as_json(records)))["cases"]
    assert one["grid"]["step"] == 25.0
    assert one["grid"]["spacing"] == small["grid"]["spacing"] == "equal"
    assert (one["checks"], one["ensemble"]) == (
        {"starts": 4, "reversal": 0.0, "chaos": False},
        None,
    )
    assert small["ensemble"] == {"count": 10, "spread": 1e-2, "vary": [["e", 0.1]]}
    assert large["ensemble"]["count"] == 20
    assert (one["problem"], one["settings"], one["note"]) == ("sitnikov(e=0.75)", "chosen", "")
    assert one["outcome"] == "ok"


def test_two_ensembles_of_a_problem_differ_in_the_table(records):
    text = framed([case(record) for record in records]).to_csv(index=False)
    rows = list(csv.DictReader(text.splitlines()))
    assert rows[0]["ensemble"] == ""
    assert [json.loads(row["ensemble"])["count"] for row in rows[1:]] == [10, 20]
