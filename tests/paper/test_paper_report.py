"""The report's machinery: departure, tasks, documents, the command."""

import re
import sqlite3
from contextlib import closing
from dataclasses import dataclass
from dataclasses import replace as replace_task
from typing import get_type_hints

import numpy as np
import pytest
from msgspec.structs import replace

from hbvm_bench.campaign import folder
from hbvm_bench.campaign.file import load, shipped
from hbvm_bench.cli import main
from hbvm_bench.measure.computation import function_of, packed, unpacked
from hbvm_bench.report.figures.drawn import number
from hbvm_bench.report.page import Results
from hbvm_bench.report.parts import Part, PartResults
from hbvm_bench.run import computing, executors
from hbvm_bench.store.store import FILE, PACKED, Store
from hbvm_bench.studies.paper.experiments.departure import departure
from hbvm_bench.studies.paper.henon_heiles_part import fates
from integrators.methods.gauss import Gauss
from integrators.protocol import Array, Samples, Status
from problems import Hamiltonian
from problems.errors import InputError

report = folder.module(shipped()["paper"].parent, "blocks")


@pytest.fixture
def falling():
    """A particle that falls from rest: q = -t^2/2."""

    def H(q, p):
        return p[0] ** 2 / 2 + q[0]

    return Gauss(s=1, h=0.25).compile(Hamiltonian(H, dof=1, name="falling"))


def test_a_departure_is_the_first_own_step_beyond(falling):
    found = departure(falling.start(np.zeros(2)), 100.0, lambda y: y[:, 0] < -2.0, stretch=1.0)
    assert found == 2.25  # q(2) = -2 is not beyond


def test_what_stays_has_no_departure(falling):
    assert departure(falling.start(np.zeros(2)), 3.1, lambda y: y[:, 0] < -50.0, stretch=0.1) is None


def test_a_failure_is_a_departure():
    class Failing:
        t = 1.5

        def advance(self, times, *, sample=None):
            return Samples(np.empty(0), np.empty((0, 1)), Status.NOT_FINITE, "blown up")

    assert departure(Failing(), 10.0, lambda y: y[:, 0] > 0, stretch=1.0) == 1.5  # type: ignore[arg-type]


TASKS = """
import functools
from hbvm_bench.measure.computation import Task, split

def square(i: int) -> int:
    if i == 3:
        raise ValueError("three is too many")
    return i**2

def row(values: list[float]) -> list[float]:
    return [value + 1 for value in values]

def tasks(quick):
    squares = [Task(f"squares/{i}", functools.partial(square, i), cost=i) for i in range(2 if quick else 4)]
    return squares + split("squares/rows", row, [1.0, 2.0, 3.0, 4.0, 5.0], 2, cost=9)
"""


@pytest.fixture
def study(tmp_path):
    """Return a folder with computations, one of which fails."""
    (tmp_path / "blocks.py").write_text(TASKS)
    return tmp_path


def ran(study, store, *, quick=False):
    """Run what is missing of the computations, and return the keys of those that ended, in order."""
    campaign = replace(load("smoke"), computes="./blocks.py:tasks", quick=quick)
    left = computing.missing(computing.plan(campaign, study), store)
    with executors.opened(jobs=1) as pool:
        return [row.case.method for row in computing.run(left, store, pool, lambda running: None)]


def results_of(study, store):
    runs = folder.module(study, "blocks").tasks(False)
    bare = [replace_task(task, key=task.key.removeprefix("squares/")) for task in runs]
    part = Part("squares", "Squares", bare, lambda found: [], lambda found: [])
    return PartResults(
        part,
        Results(
            [], [], {}, computed={key: (row, store.series(row.id)) for key, row in store.computed().items()}
        ),
    )


def test_computations_run_as_cases_do_and_one_that_fails_says_why_and_is_tried_again(study):
    store = Store(study / "run")
    store.prepare()
    keys = ran(study, store)
    assert keys[-4:] == ["squares/3", "squares/2", "squares/1", "squares/0"]  # the long ones first
    found = results_of(study, store)
    assert [found["0"], found["1"], found["2"]] == [0, 1, 4]
    assert found["rows"] == [2.0, 3.0, 4.0, 5.0, 6.0]  # what was divided is put together again
    with pytest.raises(InputError, match=r"'squares/3' failed with ValueError: three is too many \(b"):
        found["3"]
    assert ran(study, store) == ["squares/3"]
    (study / "blocks.py").write_text(TASKS.replace("i**2", "i**3"))
    assert len(ran(study, store)) == 6  # by other code
    assert results_of(study, store)["2"] == 8
    with pytest.raises(InputError, match="'squares/7' was not run"):
        results_of(study, store)["7"]


@dataclass(frozen=True)
class Mixed:
    values: Array
    rows: list[tuple[str, float | None]]


def mixed() -> dict[str, Mixed]:
    values = np.array([[1e-300, np.nan, -0.0], [np.inf, 0.1, 3.0]])
    return {"one": Mixed(values, [("a", None), ("b", np.float64(np.nan))])}


def test_what_is_kept_comes_back_to_the_last_bit():
    back = unpacked(packed(mixed()), mixed)["one"]
    assert back.values.tobytes() == mixed()["one"].values.tobytes()
    assert back.values.shape == (2, 3)
    assert back.rows[0] == ("a", None)
    assert np.isnan(back.rows[1][1])


def test_every_result_of_the_paper_can_be_kept():
    """Its function says what it returns; else it could not be read again."""
    for task in report.tasks(quick=False):
        assert get_type_hints(function_of(task.run))["return"]


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (3.39e-3, "3.4e-3"), (1e-15, "1.0e-15"), (0.4169, "0.417"), (1608.0, "1,608"), (None, "–")],
)
def test_numbers_are_short(value, text):
    assert number(value) == text


def test_the_same_figure_gives_the_same_bytes():
    times = {"gauss": [100.0, None], "hbvm": [None, None]}
    first, second = fates(times), fates(times)
    assert first.svg == second.svg


@pytest.fixture
def small_paper(monkeypatch):
    """Return the campaign with one method, and one of the paper's parts."""
    campaign = load("paper")
    methods = [replace(campaign.methods[0], use=["HBVM(k=18, s=2, h=0.5)"])]
    monkeypatch.setattr(report, "PARTS", (report.properties_part.PART,))
    monkeypatch.setattr("hbvm_bench.commands.paper.load", lambda name: replace(campaign, methods=methods))


@pytest.mark.slow
def test_a_report_is_written_whole_drawn_again_and_loses_little_where_a_result_is_missing(
    small_paper, tmp_path, capsys
):
    assert main(["paper", "--jobs", "1", "--out", str(tmp_path)]) == 0
    folder = tmp_path / "report"
    files = {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    html, markdown = files["index.html"].decode(), files["report.md"].decode()
    assert not re.search(r'(?:src|href)="(?:https?:)?//', html)
    assert "**8** confirmed · **0** confirmed in part · **0** not found" in markdown

    for place in (tmp_path, folder):  # from the store, and from the report alone
        assert main(["report", str(place), "--out", str(tmp_path / "again")]) == 0
        for name in ("index.html", "report.md", PACKED):
            assert (tmp_path / "again" / name).read_bytes() == files[name], (place, name)

    with closing(sqlite3.connect(tmp_path / FILE)) as database, database:
        database.execute("DELETE FROM results WHERE method='claims/orders'")
    assert main(["report", str(tmp_path), "--out", str(tmp_path / "again")]) == 1
    assert (
        "not made: the order: InputError: the computation 'claims/orders' was not run."
        in capsys.readouterr().err
    )
    text = (tmp_path / "again" / "report.md").read_text(encoding="utf-8")
    assert "**Not made: the order**" in text
    assert "Conservation from k ≥ νs/2" in text
