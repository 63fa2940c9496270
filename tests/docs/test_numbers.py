"""Numbers in the pages are those of the stored results: tables are copies of a report's, prose quotes it."""

import re
import sys

import jinja2
import pytest

from tests.docs import pages

sys.path.insert(0, str(pages.DOCS / "_ext"))
from stored import Stored

REPORTS = pages.ROOT / "reports"
LINK = re.compile(r"\]\((?:\.\./)*reports/(\w[\w-]*)/")
NUMBER = re.compile(r"(?<![\w.])\d\.\d+e-?\d+")  # a measured error; bounds are round numbers
RATIO = re.compile(r"(?<![\w.])\d+\.\d+(?= times| µs| ms|×| of the time)")
INSERTED = re.compile(r"\{\{ stored\(\".*?\) \}\}")


def report(name: str) -> str:
    """Return the text of a report, which `hbvm-bench report` draws from its stored results."""
    folder = REPORTS / name
    return next(path for path in folder.glob("*.md")).read_text(encoding="utf-8")


def quotes() -> list[tuple[str, str, str]]:
    """Return the paragraphs that link to a report: page, report, text."""
    return [
        (str(page.relative_to(pages.ROOT)), names[0], " ".join(paragraph.split()))
        for page in pages.sources()
        for paragraph in re.split(r"\n\s*\n", page.read_text(encoding="utf-8"))
        if len(names := list(dict.fromkeys(LINK.findall(paragraph)))) == 1
        and (NUMBER.search(paragraph) or RATIO.search(paragraph))
    ]


def test_the_first_table_is_the_reports():
    rows = re.findall(r"^\| .* \|$", report("race"), re.MULTILINE)
    shown = re.findall(r"^\| .* \|$", (pages.ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    first = next(i for i, row in enumerate(shown) if row.startswith("| problem | fastest setting"))
    assert len(shown[first:]) > 5
    assert [row for row in shown[first : first + 11] if row not in rows] == []


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

WHFAST = "WHFast512 × HBVM and Gauss"
README_RATIOS = [
    ("0.54 times the time of Gauss", [("race", "At other accuracies", "1e-08, 1e-05 | Gauss", WHFAST)]),
    (
        "heyoka is faster, by a factor of 2.6 to 3.8",
        [("general", "by position error", f"(C{i}) | 1e-12", "Taylor") for i in (1, 2, 3, 4)],
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


def test_no_other_ratio_of_the_first_page_is_without_a_report():
    prose = " ".join(text for text in re.split(r"(?<=[.:]) ", README) if "|" not in text)
    ratios = re.findall(r"(?<![\w.])\d+\.\d+ times|by a factor of \d+\.\d+ to \d+\.\d+", prose)
    assert {one for one in ratios if not any(one in words for words, _ in README_RATIOS)} == set()


def test_ratios_of_the_page_of_headline_ratios_stand_in_the_reports():
    text = (pages.ROOT / "docs" / "developers" / "remeasured.md").read_text(encoding="utf-8")
    sections = [part for part in text.split("\n## ") if LINK.search(part)]
    assert len(sections) >= 8
    for part in sections:
        (name,) = set(LINK.findall(part))
        assert [ratio for ratio in re.findall(r"\d+\.\d+×", part) if ratio not in report(name)] == [], name


def test_the_first_page_is_read_in_five_minutes():
    text = re.sub(
        r"^```.*?^```", "", (pages.ROOT / "README.md").read_text(encoding="utf-8"), flags=re.M | re.S
    )
    assert len(re.findall(r"\S*\w\S*", text)) <= 900


AUTOMATIC = {
    "Outer Solar System": "outer_solar_system",
    "Sitnikov's problem": "sitnikov",
    "Kepler's problem, e = 0.6": "kepler(e=0.6",
    "Hénon–Heiles": "henon_heiles",
    "Restricted three-body problem (less accurate)": "cr3bp",
}
LOST = {
    "ten decays in a row (C1)": ("general", "by position error", "(C1) | 1e-12", "Taylor"),
    "ten decays in a row, faster and faster (C2)": ("general", "by position error", "(C2) | 1e-12", "Taylor"),
    "heat equation, 10 points (C3)": ("general", "by position error", "(C3) | 1e-12", "Taylor"),
    "heat equation, 51 points (C4)": ("general", "by position error", "(C4) | 1e-12", "Taylor"),
    "outer Solar System": ("race", "At other accuracies", "1e-08, 1e-05 | Gauss", WHFAST),
}


def cells_of_the_first_page(name):
    """Return the cells behind a name in the first table that has it."""
    text = (pages.ROOT / "README.md").read_text(encoding="utf-8")
    row = re.search(rf"^\| {re.escape(name)} \|(.*)\|$", text, re.MULTILINE)
    assert row is not None
    return [cell.strip() for cell in row[1].split("|")]


@pytest.mark.parametrize("name", AUTOMATIC)
def test_the_row_of_the_default_is_that_of_its_report(name):
    columns = ("znver5-512bit", "znver5-512bit-avx2")
    stored = [Stored()("automatic", "against", AUTOMATIC[name], column) for column in columns]
    assert cells_of_the_first_page(name) == stored
    reports = [
        row for row in report("automatic").splitlines() if AUTOMATIC[name] in row and "against" not in row
    ]
    assert ("less accurate" in name) == any("less accurate" in row for row in reports[:2])


@pytest.mark.parametrize("name", LOST)
def test_a_row_of_losses_is_that_of_its_report(name):
    assert cells_of_the_first_page(name)[-1] == Stored()(*LOST[name])


def test_the_animation_is_light():
    picture = pages.DOCS / "pictures" / "sitnikov.svg"
    assert picture.stat().st_size < 300_000
    assert picture.read_text(encoding="utf-8").count("<animate ") == 6
