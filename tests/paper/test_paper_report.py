"""The report's machinery: departure, tasks, documents, the command."""

import io
import re
from dataclasses import dataclass
from functools import partial
from typing import get_type_hints

import numpy as np
import pytest
from msgspec.structs import replace

from hbvm_bench.campaign.file import load
from hbvm_bench.cli import main
from hbvm_bench.report.figures.canvas import new, small
from hbvm_bench.store.store import PACKED, Store
from hbvm_bench.studies import computations as results
from hbvm_bench.studies.drawn import number
from hbvm_bench.studies.paper import properties_part, report
from hbvm_bench.studies.paper.experiments import others
from hbvm_bench.studies.paper.experiments.departure import departure
from hbvm_bench.studies.paper.henon_heiles_part import fates
from integrators.methods.gauss import Gauss
from integrators.protocol import Array, Samples, Status
from problems import Hamiltonian
from problems.errors import InputError


@pytest.fixture
def falling():
    """A particle that falls from rest: q = -t^2/2."""

    def H(q, p):
        return p[0] ** 2 / 2 + q[0]

    return Gauss(s=1, h=0.25).compile(Hamiltonian(H, dof=1, name="falling"))


def test_a_departure_is_the_first_own_step_beyond(falling):
    found = departure(falling.start(np.zeros(2)), 100.0, lambda y: y[:, 0] < -2.0, stretch=1.0)
    assert found == 2.25  # q(2) = -2 is not beyond


def test_a_departure_is_seen_on_a_grid_where_asked_for(falling):
    found = departure(falling.start(np.zeros(2)), 100.0, lambda y: y[:, 0] < -2.0, stretch=8.0, every=2.0)
    assert found == 4.0


def test_what_stays_has_no_departure(falling):
    assert departure(falling.start(np.zeros(2)), 3.1, lambda y: y[:, 0] < -50.0, stretch=0.1) is None


def test_a_failure_is_a_departure():
    class Failing:
        t = 1.5

        def advance(self, times, *, sample=None):
            return Samples(np.empty(0), np.empty((0, 1)), Status.NOT_FINITE, "blown up")

    assert departure(Failing(), 10.0, lambda y: y[:, 0] > 0, stretch=1.0) == 1.5  # type: ignore[arg-type]


def square(i: int) -> int:
    if i == 3:
        raise ValueError("three is too many")
    return i**2


def part(count: int) -> results.Part:
    runs = [results.Task(f"{i}", partial(square, i), cost=i) for i in range(count)]
    return results.Part("squares", "Squares", runs, lambda found: [], lambda found: [])


def work(count: int) -> list[results.Task]:
    return part(count).tasks


def ran(tasks, directory, jobs=1):
    """Run tasks and return what is kept, and what was said of those that ended, in order."""
    said: dict[str, str] = {}
    store = Store(directory)
    store.prepare()
    kept = results.run_all("paper", tasks, jobs, store, said.__setitem__)
    return kept, said


def stored(directory):
    return results.load("paper", Store(directory).studies())


@pytest.mark.parametrize("jobs", [1, 2])
def test_tasks_give_the_same_results_here_and_in_processes(tmp_path, jobs):
    kept, said = ran(work(3), tmp_path, jobs)
    found = results.PartResults(part(3), stored(tmp_path))
    assert [found["0"], found["1"], found["2"]] == [0, 1, 4]
    assert stored(tmp_path) == kept
    if jobs == 1:
        assert list(said) == ["squares/2", "squares/1", "squares/0"]  # the long ones first


def row(values: list[float]) -> list[float]:
    return [value + 1 for value in values]


def test_what_was_divided_is_put_together_again(tmp_path):
    runs = results.split("rows", row, [1.0, 2.0, 3.0, 4.0, 5.0], 2, cost=1)
    whole = results.Part("p", "P", runs, lambda found: [], lambda found: [])
    ran(whole.tasks, tmp_path)
    assert results.PartResults(whole, stored(tmp_path))["rows"] == [2.0, 3.0, 4.0, 5.0, 6.0]


def test_a_computation_that_fails_loses_no_other_and_says_why(tmp_path):
    ran(work(4), tmp_path)
    found = results.PartResults(part(4), stored(tmp_path))
    assert found["2"] == 4
    with pytest.raises(InputError, match=r"'squares/3' failed with ValueError: three is too many \(test_pa"):
        found["3"]


def test_a_run_goes_on_where_it_was_but_not_by_other_code(tmp_path):
    ran(work(2), tmp_path)
    assert list(ran(work(3), tmp_path)[1]) == ["squares/2"]
    assert list(ran(work(3), tmp_path)[1]) == []
    kept = stored(tmp_path)
    Store(tmp_path).keep_study("paper", results.StoredResults(kept.results, {}, code="another"))
    assert len(ran(work(3), tmp_path)[1]) == 3


def test_a_failure_is_tried_again(tmp_path):
    ran(work(4), tmp_path)
    assert list(ran(work(4), tmp_path)[1]) == ["squares/3"]


@pytest.mark.parametrize(
    ("beside", "says"),
    [({}, "were not run"), ({"paper": {"results": 3}}, "damaged"), ({"paper": {}}, "damaged")],
)
def test_what_is_missing_or_damaged_is_told(beside, says):
    with pytest.raises(InputError, match=says):
        results.load("paper", beside)


@dataclass(frozen=True)
class Mixed:
    values: Array
    rows: list[tuple[str, float | None]]


def mixed() -> dict[str, Mixed]:
    values = np.array([[1e-300, np.nan, -0.0], [np.inf, 0.1, 3.0]])
    return {"one": Mixed(values, [("a", None), ("b", np.float64(np.nan))])}


def test_what_is_kept_comes_back_to_the_last_bit():
    back = results.unpacked(results.packed(mixed()), mixed)["one"]
    assert back.values.tobytes() == mixed()["one"].values.tobytes()
    assert back.values.shape == (2, 3)
    assert back.rows[0] == ("a", None)
    assert np.isnan(back.rows[1][1])


def test_every_result_of_the_paper_can_be_kept():
    """Its function says what it returns; else it could not be read again."""
    for task in (task for part in report.PARTS for task in part.tasks):
        assert get_type_hints(results.function_of(task.run))["return"]


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


def test_pictures_are_kept_small_without_a_visible_difference():
    from PIL import Image

    stream, sheet_of_paper = io.BytesIO(), new(5.0, 3.0)
    sheet_of_paper.subplots().plot(np.sin(np.linspace(0.0, 20.0, 400)))
    sheet_of_paper.savefig(stream, format="png", dpi=160)
    drawn = stream.getvalue()
    made = small(drawn)
    assert len(made) < 0.6 * len(drawn)  # measured 0.4
    before, after = (
        np.asarray(Image.open(io.BytesIO(png)).convert("RGBA").convert("RGB"), dtype=float)
        for png in (drawn, made)
    )
    assert np.abs(before - after).mean() < 1.5  # of 255; measured 1.04: the palette has white as 254


@pytest.fixture
def small_paper(monkeypatch):
    """Return the campaign with one method, and one of the paper's parts."""
    campaign = load("paper")
    methods = [replace(campaign.methods[0], use=["HBVM(k=18, s=2, h=0.5)"])]
    monkeypatch.setattr(report, "PARTS", (properties_part.PART,))
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

    kept = stored(tmp_path)
    del kept.results["claims/orders"]
    Store(tmp_path).keep_study("paper", kept)
    assert main(["report", str(tmp_path), "--out", str(tmp_path / "again")]) == 1
    assert (
        "not made: the order: InputError: the computation 'claims/orders' was not run."
        in capsys.readouterr().err
    )
    text = (tmp_path / "again" / "report.md").read_text(encoding="utf-8")
    assert "**Not made: the order**" in text
    assert "Conservation from k ≥ νs/2" in text


def test_a_library_that_refuses_is_a_row_with_its_reason():
    pytest.importorskip("rebound")
    row = others.measured("period-annulus", "WHFast(h=0.02)")
    assert not row.numbers
    assert "bodies" in row.remark


def test_heyoka_finds_the_same_edge():
    pytest.importorskip("heyoka")
    row = others.measured("period-annulus", "Taylor(tol=1e-15, high_accuracy=True, compact_mode=True)")
    assert row.numbers["error"] < 2e-15  # 4.6e-16
