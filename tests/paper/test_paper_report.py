"""The report's machinery: departure, tasks, documents, the command."""

import io
import re
from functools import partial

import numpy as np
import pytest

from hbvm_bench.cli import main
from hbvm_bench.commands import paper as command
from hbvm_bench.report.figures.canvas import picture
from hbvm_bench.report.figures.png import small
from hbvm_bench.studies.paper import others, page, tasks
from hbvm_bench.studies.paper.departure import departure
from hbvm_bench.studies.paper.document import Claim, Part, number, sheet
from hbvm_bench.studies.paper.henon_heiles_figures import fates
from hbvm_bench.summaries.table import Table
from integrators.gauss import Gauss
from integrators.protocol import Samples, Status
from problems import Hamiltonian

HOSTILE = 'a <script>alert("x")</script> | `code` & 3.4e-15\nnext'


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


def test_tasks_give_the_same_results_here_and_in_processes():
    work = [tasks.Task(f"{i}", partial(pow, i, 2), cost=i) for i in range(4)]
    seen: list[str] = []
    here = tasks.run_all(work, 1, lambda key, _: seen.append(key))
    assert here == tasks.run_all(work, 2, lambda *_: None) == {"0": 0, "1": 1, "2": 4, "3": 9}
    assert seen == ["3", "2", "1", "0"]


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (3.39e-3, "3.4e-3"), (1e-15, "1.0e-15"), (0.4169, "0.417"), (1608.0, "1,608"), (None, "–")],
)
def test_numbers_are_short(value, text):
    assert number(value) == text


def test_hostile_words_cannot_break_the_documents():
    table = Table(HOSTILE, (HOSTILE, "n"), [(HOSTILE, "1e-3")], HOSTILE, key="hostile")
    part = Part("hostile", HOSTILE, [HOSTILE], [Claim(HOSTILE, HOSTILE, HOSTILE, "holds")], [HOSTILE, table])
    html = page.page([part], HOSTILE)
    assert html.count("<script>") == 1
    assert "alert(" in html
    markdown = page.markdown([part], "hbvm-bench paper")
    row = next(line for line in markdown.splitlines() if line.endswith("| confirmed |"))
    assert len(re.findall(r"(?<!\\)\|", row)) == 5
    assert "<script>" not in re.sub(r"`[^`]*`", "", markdown).replace("\\<script", "")


def test_powers_of_ten_are_set_as_powers_and_code_is_left_alone():
    assert "3.4·10<sup>−15</sup>" in page.html_cell("at 3.4e-15")
    assert ">10<sup>4</sup>" in page.html_cell("1e4")
    assert "tol=1e-15" in page.html_prose("`Taylor(tol=1e-15)`")
    assert page.html_cell("-0.015") == "−0.015"


def test_the_same_figure_gives_the_same_bytes():
    times = {"Gauss(s=2, h=1.0)": [100.0, None], "HBVM(k=4, s=2, h=1.0)": [None, None]}
    first, second = fates(times, 7000.0), fates(times, 7000.0)
    assert (first.svg, first.png) == (second.svg, second.png)


def test_pictures_are_kept_small_without_a_visible_difference():
    from PIL import Image

    stream, sheet_of_paper = io.BytesIO(), sheet(5.0, 3.0)
    sheet_of_paper.subplots().plot(np.sin(np.linspace(0.0, 20.0, 400)))
    sheet_of_paper.savefig(stream, format="png", dpi=160)
    drawn = stream.getvalue()
    made = small(drawn)
    assert len(made) < 0.6 * len(drawn)  # measured 0.4
    before, after = (
        np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=float) for png in (drawn, made)
    )
    assert np.abs(before - after).mean() < 0.5  # 0.02 of 255


def test_a_figure_s_size_in_the_page_follows_its_width():
    drawn = page.drawing(picture(sheet(5.0, 1.0), "empty", "t", "c", "s"))
    assert f"max-width:{360 * page.ENLARGED:.0f}px" in drawn


def test_an_unknown_part_is_refused_with_the_nearest_name(capsys):
    assert main(["paper", "sitnikof"]) == 2
    assert "sitnikov" in capsys.readouterr().err


def test_a_part_is_written_whole_and_twice_the_same(tmp_path):
    files = []
    for name in ("first", "second"):
        command.write_report(("claims",), tmp_path / name, 1, "hbvm-bench paper claims")
        found = {p.relative_to(tmp_path / name): p for p in (tmp_path / name).rglob("*") if p.is_file()}
        files.append({str(key): path.read_bytes() for key, path in found.items()})
    assert files[0] == files[1]
    html, markdown = files[0]["index.html"].decode(), files[0]["report.md"].decode()
    assert not re.search(r'(?:src|href)="(?:https?:)?//', html)
    for link in re.findall(r"\]\(((?:figures|data)/[^)]+)\)", markdown) + re.findall(
        r'href="((?:figures|data)/[^"]+)"', html
    ):
        assert link in files[0], link
    assert "**8** confirmed · **0** confirmed in part · **0** not found" in markdown


def test_a_library_that_refuses_is_a_row_with_its_reason():
    pytest.importorskip("rebound")
    row = others.on_period_annulus("WHFast(h=0.02)")
    assert not row.numbers
    assert "bodies" in row.remark


def test_heyoka_finds_the_same_edge():
    pytest.importorskip("heyoka")
    row = others.on_period_annulus("Taylor(tol=1e-15, high_accuracy=True, compact_mode=True)")
    assert row.numbers["error"] < 2e-15  # 4.6e-16
