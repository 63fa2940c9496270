"""What is done with a large run takes a time that grows with its cases, and no faster."""

from collections import Counter

import pytest

import problems
from hbvm_bench import cli
from hbvm_bench.store.store import Store
from tests.hbvm_bench import made_up_run

SMALL, LARGE = 100, 300
METHODS = 50
# Rows of results and arrays that are read for one case: measured.
READS = {
    "run {run}/campaign.toml --out {run}": 4,
    "show {run}": 1,
    "show {run} --json": 1,
    "export {run} --out {out}/cases.csv": 1,
    "export {run} --table timings --out {out}/timings.csv": 1,
    "compare {run} {run}": 2,
    "merge {run} {other} --out {out}/merged": 8,
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    made = {}
    for count in (2, SMALL, LARGE):
        folder = tmp_path_factory.mktemp("large") / str(count)
        names = made_up_run.kepler(max(count // METHODS, 1))
        store = made_up_run.write(Store(folder), names, min(count, METHODS))
        (folder / "campaign.toml").write_text(made_up_run.toml(store.index().campaign))
        made[count] = folder
    return made


@pytest.mark.parametrize(("command", "reads"), READS.items())
def test_a_row_of_a_case_is_read_a_few_times_and_a_problem_made_once(
    runs, command, reads, monkeypatch, tmp_path, capsys
):
    read, load = Store._all, problems.load
    counted, made = Counter(), Counter()

    def counting(store, query, *given):
        rows = read(store, query, *given)
        counted["rows"] += len(rows) if "results" in query or "arrays" in query else 0
        return rows

    monkeypatch.setattr(Store, "_all", counting)
    monkeypatch.setattr(
        problems, "load", lambda name, **given: made.update([str(given)]) or load(name, **given)
    )
    found = []
    for count in (SMALL, LARGE):
        counted.clear()
        words = command.format(run=runs[count], other=runs[2], out=tmp_path / str(count))
        assert cli.main(words.split()) == 0
        found.append(counted["rows"])
    assert found[1] - found[0] == reads * (LARGE - SMALL)
    assert max(made.values(), default=0) <= 1
