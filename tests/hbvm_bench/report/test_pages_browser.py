"""The pages of the race, of endurance and of the paper in a real browser: what all pages share works."""

import pytest

pytest.importorskip("playwright.sync_api")

from hbvm_bench.report.document import Claim, Claims, Document, Section
from hbvm_bench.report.figures.drawn import LOOKS
from hbvm_bench.report.page import document, page_of
from hbvm_bench.report.write import write
from hbvm_bench.studies.paper.experiments.properties import Order
from hbvm_bench.studies.paper.properties_part import order
from hbvm_bench.summaries.table import Table
from tests.hbvm_bench.made_up_run import results_of
from tests.hbvm_bench.studies import made_up_studies

from .test_report_browser import CHROMIUM, browser, opened, serious, too_wide, wait_for_change

__all__ = ["browser"]  # a fixture
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine")


def made_up_document():
    """Return a document with a figure, claims and a table, as the report on the paper has them."""
    rows = [Order(s, s, [0.2, 0.1], [0.2 ** (2 * s), 0.1 ** (2 * s)], 2.0 * s) for s in (1, 2)]
    claim = Claim("It is of order 2s", "Section 2", "2.00 at `h=0.1`, 3.4e-15", "holds")
    table = Table("Numbers", ("method", "error"), [("Gauss(s=2)", "3.4e-15")], key="numbers")
    claims = Claims([("Made up", "made-up", [claim])])
    return Document(
        "Made up",
        ["A sentence."],
        [claims, Section("Made up", [order(rows), table], "made-up")],
        LOOKS,
    )


@pytest.fixture(scope="module", params=["race", "endure", "paper"])
def folder(request, tmp_path_factory):
    target = tmp_path_factory.mktemp(request.param)
    if request.param == "race":
        made = page_of(results_of(made_up_studies.race()))
    elif request.param == "endure":
        made = document(made_up_studies.endurance(target, starts=3))
    else:
        made = made_up_document()
    write(made, target)
    return target


@pytest.fixture(scope="module")
def page(browser, folder):
    with opened(browser, folder, reduced_motion="reduce", bypass_csp=True) as page:
        yield page


def test_no_page_is_wider_than_its_window(page):
    assert too_wide(page) == []


def test_a_page_is_small_and_its_figures_are_saved(page, folder):
    assert (folder / "index.html").stat().st_size <= 300_000  # 35 to 100 kB measured
    figure = page.locator("figure").first
    with page.expect_download() as saved:
        figure.locator("[data-save=svg]").click()
    assert saved.value.path().read_bytes().startswith(b"<svg")


def test_nothing_serious_is_found_by_axe(page):
    assert serious(page) == []


def test_the_theme_changes(page):
    ground = "getComputedStyle(document.body).backgroundColor"
    before = page.evaluate(ground)
    page.click("#theme")
    wait_for_change(page, ground, before)
