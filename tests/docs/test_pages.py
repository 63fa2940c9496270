"""Links of the documentation lead somewhere, and its pictures are described; test_pasted.py runs its code."""

import doctest
import re

import pytest

from hbvm_bench.campaign.file import shipped
from tests.docs import pages

EXECUTED = [path for path in pages.sources() if pages.cells(path)]
TUTORIALS = pages.listed(pages.DOCS / "tutorials" / "index.md")


def _name(path):
    return str(path.relative_to(pages.ROOT))


@pytest.mark.parametrize("page", pages.sources(), ids=_name)
def test_every_link_leads_to_a_file_and_to_a_heading_in_it(page):
    broken = []
    for target in pages.links(page):
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        if not path.exists() or (anchor and path.suffix == ".md" and anchor not in pages.anchors(path)):
            broken.append(target)
    for name in pages.listed(page):
        if not pages.page(name, page).is_file():
            broken.append(name)
    assert broken == []


@pytest.mark.parametrize("page", pages.sources(), ids=_name)
def test_every_file_of_the_repository_that_a_page_names_is_there(page):
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"`((?:tests|examples|integrators|problems|hbvm_bench|docs)/[\w/]+\.\w+)`", text)
    examples = {
        "integrators/peers/NAME.py",
        "problems/catalogue/NAME.py",
        "hbvm_bench/studies/NAME.toml",
        "problems/catalogue/quartic.py",
        "docs/_build/html/index.html",  # what `make docs` builds
    }
    assert [name for name in named if name not in examples and not (pages.ROOT / name).is_file()] == []


def test_every_shipped_campaign_has_a_budget_of_time():
    text = (pages.DOCS / "developers" / "release.md").read_text(encoding="utf-8")
    budgets = re.findall(r"^\| ([\w-]+) \| (\d+)", text, re.MULTILINE)
    assert {name for name, _ in budgets} >= {*shipped()}


def test_the_example_of_the_first_page_is_true():
    failed, tried = doctest.testfile(str(pages.DOCS / "index.md"), module_relative=False)
    assert (failed, tried > 4) == (0, True)


@pytest.mark.parametrize("name", TUTORIALS)
def test_a_tutorial_runs_something_and_says_what_next(name):
    page = pages.DOCS / "tutorials" / f"{name}.md"
    assert page in EXECUTED
    assert page.read_text(encoding="utf-8").partition("\n## What next\n")[2].count("](") >= 2


@pytest.mark.parametrize("page", EXECUTED, ids=_name)
def test_every_picture_is_described_in_words(page):
    drawn = sum("plt.show()" in cell for cell in pages.cells(page))
    assert drawn >= 1
    assert page.read_text(encoding="utf-8").count("\n    alt: ") == drawn
