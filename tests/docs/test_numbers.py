"""Numbers in the pages are those of the stored results: tables are copies of a report's, prose quotes it."""

import re

import pytest

from tests.docs import pages

REPORTS = pages.ROOT / "reports"
LINK = re.compile(r"\]\((?:\.\./)*reports/(\w[\w-]*)/")
NUMBER = re.compile(r"(?<![\w.])\d\.\d+e-?\d+")  # a measured error; bounds are round numbers
RATIO = re.compile(r"(?<![\w.])\d+\.\d+(?= times| µs| ms|×)")


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
        if len(names := list(dict.fromkeys(LINK.findall(paragraph)))) == 1 and NUMBER.search(paragraph)
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
