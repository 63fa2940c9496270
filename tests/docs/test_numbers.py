"""Numbers in the pages are those of the stored results: tables are copies of a report's, prose quotes it."""

import re
import sys

import jinja2
import pytest

from tests.docs import pages

sys.path.insert(0, str(pages.DOCS / "_ext"))
sys.path.insert(0, str(pages.DOCS / "pictures"))
import first_page
import work_precision
from stored import Stored

REPORTS = pages.ROOT / "reports"
LINK = re.compile(r"\]\((?:\.\./)*reports/(\w[\w-]*)/")
NUMBER = re.compile(r"(?<![\w.])\d\.\d+e-?\d+")  # a measured error; bounds are round numbers
RATIO = re.compile(r"(?<![\w.])\d+\.\d+(?= times| µs| ms|×| of the time)")
INSERTED = re.compile(r"\{\{ stored\(\".*?\) \}\}")


def report(name: str) -> str:
    """Return the text of a report, which `hbvm-bench report` draws from its stored results."""
    return (REPORTS / name / "report.md").read_text(encoding="utf-8")


def quotes() -> list[tuple[str, str, str]]:
    """Return the paragraphs that link to a report: page, report, text."""
    return [
        (str(page.relative_to(pages.ROOT)), names[0], " ".join(paragraph.split()))
        for page in pages.sources()
        for paragraph in re.split(r"\n\s*\n", page.read_text(encoding="utf-8"))
        if len(names := list(dict.fromkeys(LINK.findall(paragraph)))) == 1
        and (NUMBER.search(paragraph) or RATIO.search(paragraph))
    ]


def test_the_tables_of_the_first_page_are_those_of_the_reports():
    text = (pages.ROOT / "README.md").read_text(encoding="utf-8")
    assert text.count(": docs/_ext/first_page.py -->") == 3
    assert first_page.filled(text) == text


def test_the_diagram_of_the_first_page_is_drawn_from_the_report(tmp_path):
    work_precision.draw(tmp_path / "drawn.svg")
    shown = (pages.DOCS / "pictures" / "work_precision.svg").read_text(encoding="utf-8")
    points = re.compile(r"<use [^>]*>")
    assert len(points.findall(shown)) > 40
    assert points.findall((tmp_path / "drawn.svg").read_text(encoding="utf-8")) == points.findall(shown)


@pytest.mark.parametrize(("page", "name", "text"), quotes(), ids=lambda value: value[:40])
def test_what_a_paragraph_quotes_stands_in_the_report_it_links_to(page, name, text):
    numbers = {*NUMBER.findall(re.sub(r"`[^`]*`", "", text)), *RATIO.findall(text)}
    assert {one for one in numbers if one not in report(name)} == set(), page


def insertions() -> list[tuple[str, str]]:
    """Return what the build inserts from reports: page, expression."""
    return [
        (str(page.relative_to(pages.ROOT)), expression)
        for page in pages.sources()
        for expression in INSERTED.findall(page.read_text(encoding="utf-8"))
    ]


def test_pages_take_ratios_from_the_reports():
    taking = {page for page, _ in insertions()}
    wanted = {"docs/faq.md", "docs/general.md", "docs/ensembles.md", "docs/theory/adaptive_steps.md"}
    assert wanted <= taking


@pytest.mark.parametrize(("page", "expression"), insertions())
def test_what_the_build_inserts_is_a_number_of_the_report(page, expression):
    number = jinja2.Template(expression).render(stored=Stored())
    assert re.fullmatch(r"\d+(\.\d+)?", number), page
    report_of = re.search(r'stored\("(\w+)"', expression)
    assert report_of is not None
    if "digits" not in expression:
        assert f"{number}×" in report(report_of.group(1))


def test_a_page_that_inserts_numbers_enables_it():
    for page in {page for page, _ in insertions()}:
        head = (pages.ROOT / page).read_text(encoding="utf-8").split("---\n")[1]
        assert "substitution" in head, page


def test_a_cell_that_is_not_there_or_not_alone_is_an_error():
    with pytest.raises(ValueError, match=r"^0 cells are 'HBVM\(tol=2\)'"):
        Stored()("costs", "projection", "HBVM(tol=2)", "median")
    with pytest.raises(ValueError, match=r"^6 cells are 'HBVM\('"):
        Stored()("costs", "Time relative to HBVM()", "HBVM(", "median")
    with pytest.raises(ValueError, match="no number"):
        Stored()("costs", "projection", "HBVM(tol=1e-06, projection", "setting")


README = " ".join((pages.ROOT / "README.md").read_text(encoding="utf-8").split())
"""It is read on GitHub, where nothing is inserted: its ratios are compared."""

LOOSE = ("speed", "by energy and position error", "Outer; 1e-08, 1e-05", "WHFast512")
README_RATIOS = [
    ("0.23 times the time of Gauss", [LOOSE]),
    (
        "heyoka is faster, by a factor of 3.2 to 5.9",
        [("general", "by position error", f"(DETEST C{i}); 1e-12", "Taylor") for i in (1, 2, 3, 4)],
    ),
]


@pytest.mark.parametrize(("words", "cells"), README_RATIOS, ids=["WHFast512", "linear systems"])
def test_a_ratio_of_the_first_page_is_that_of_the_report(words, cells):
    assert words in README
    said = [float(number) for number in re.findall(r"\d+\.\d+", words)]
    values = [float(Stored()(*cell)) for cell in cells]
    if "factor" in words:
        values = [round(1.0 / max(values), 1), round(1.0 / min(values), 1)]
    assert values == said


UNMEASURED = {
    "bounds": {"1e-13", "1e-12", "1e-6", "1e-10", "1e-8", "1e-7", "1e-5"},
    "processors and vectors": {"512", "256", "5"},
    "lengths and orders": {"12,000", "4", "16", "200"},
    "versions and dates": {"3.11", "3", "2026", "3.0"},
    "lists": {"1", "2"},
}
"""Numbers of the first pages that nobody measured."""


@pytest.mark.parametrize("name", ["README.md", "docs/index.md"])
def test_every_measured_number_of_the_first_pages_is_drawn_from_a_report(name):
    text = (pages.ROOT / name).read_text(encoding="utf-8")
    for drawn in (first_page.MARKED, pages.FENCE, INSERTED, re.compile(r"\A---\n.*?\n---\n", re.DOTALL)):
        text = drawn.sub("", text)
    text = re.sub(r"`[^`\n]*`|\]\([^)]*\)|:::.*", "", text)
    numbers = set(re.findall(r"(?<![\w.-])\d[\d,]*(?:\.\d+)?(?:e-?\d+)?(?![\w])", text))
    compared = {number for words, _ in README_RATIOS for number in re.findall(r"\d+\.\d+", words)}
    assert numbers - compared - set().union(*UNMEASURED.values()) == set()


def test_ratios_of_the_page_of_headline_ratios_stand_in_the_reports():
    text = (pages.ROOT / "docs" / "developers" / "remeasured.md").read_text(encoding="utf-8")
    sections = [part for part in text.split("\n## ") if LINK.search(part)]
    assert len(sections) >= 8
    for part in sections:
        (name,) = set(LINK.findall(part))
        assert [ratio for ratio in re.findall(r"\d+\.\d+×", part) if ratio not in report(name)] == [], name


def test_the_first_page_is_read_in_five_minutes():
    text = re.sub(
        r"^```.*?^```|<!--.*?-->",
        "",
        (pages.ROOT / "README.md").read_text(encoding="utf-8"),
        flags=re.M | re.S,
    )
    assert len(re.findall(r"\S*\w\S*", text)) <= 900


def test_the_animation_is_light():
    picture = pages.DOCS / "pictures" / "sitnikov.svg"
    assert picture.stat().st_size < 300_000
    assert picture.read_text(encoding="utf-8").count("<animate ") == 6
