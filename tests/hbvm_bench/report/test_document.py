"""Every block is printed as markdown and as HTML; one that fails loses no other; reports are redrawn."""

import dataclasses
import re
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import get_args

import pytest
from msgspec.structs import replace

from hbvm_bench.campaign.file import Goal
from hbvm_bench.report import html, markdown, problem
from hbvm_bench.report.document import (
    Block,
    CaseTable,
    Claim,
    Claims,
    Commands,
    Details,
    Document,
    Failed,
    Files,
    Items,
    Links,
    Note,
    Notice,
    Section,
    attempt,
    pieces,
)
from hbvm_bench.report.figures.canvas import Picture, new, picture, styled
from hbvm_bench.report.figures.style import looks
from hbvm_bench.report.html import Place
from hbvm_bench.report.page import document
from hbvm_bench.report.write import rendered, write
from hbvm_bench.store.store import Store, opened
from hbvm_bench.summaries.table import Table
from tests.hbvm_bench import made_up_run

REPORTS = Path(__file__).parents[3] / "reports"
HOSTILE = 'a <script>alert("x")</script> | `code` & 3.4e-15\nnext'
TOP = Place(2, {}, {"drawn"}, set())


class Tags(HTMLParser):
    """Collects the tags, and checks that they are closed in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.seen = [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        if tag not in ("input", "br", "use", "meta"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.seen.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@styled
def drawn(text="a figure") -> Picture:
    figure = new(3.0, 2.0)
    figure.subplots().plot([0.0, 1.0], [1.0, 2.0], label=text)
    return picture(figure, "drawn", text, f"caption of {text}", f"summary of {text}")


@pytest.fixture(scope="module")
def ranked(tmp_path_factory):
    store = made_up_run.write(Store(tmp_path_factory.mktemp("run")), ["pendulum(p=1.0)"], 3)
    return next(block for block in document(store).walk() if isinstance(block, CaseTable))


def examples(text: str, ranked: CaseTable) -> list[Block]:
    """Return one block of each kind, all of its words being a text."""
    return [
        text,
        Note(text),
        Notice(text, text),
        Items([text, text], "numbered"),
        Commands(f"hbvm-bench {text}"),
        Claims([(text, "there", [Claim(text, text, text, "partly")])]),
        ranked,
        Files(text, ["kept.json"]),
        Links([(text, text, "other.html")]),
        Failed(text, text),
        Details(text, [text]),
        Section(text, [text], "here", code="kepler()"),
        Table(text, (text, "n"), [(text, "1e-3 (2e-3)")], text, key="table", groups=((text, 2),)),
        drawn(text),
    ]


def test_there_is_an_example_of_every_kind_of_block(ranked):
    assert {type(block) for block in examples("x", ranked)} == set(get_args(Block))


@pytest.mark.parametrize("index", range(len(get_args(Block))))
def test_a_block_says_the_same_in_both_and_nothing_in_it_is_taken_for_markup(ranked, index):
    block = examples(HOSTILE, ranked)[index]
    page, text = str(html.printed([block], TOP)), markdown.printed(block)
    tags = Tags(page)
    assert "script" not in tags.seen
    outside_code = re.sub(r"^    .*$|`[^`]*`", "", text, flags=re.M)
    assert "<script" not in outside_code.replace("\\<script", "")
    if block is not ranked:
        shown = re.sub(r"<[^>]+>", "", page)
        assert "alert(" in shown
        assert "alert(" in text
        assert not isinstance(block, Table) or all(
            len(re.findall(r"(?<!\\)\|", line)) == 3 for line in text.splitlines() if line.startswith("|")
        )


def test_code_is_what_stands_between_backquotes_and_a_lone_one_is_itself():
    assert pieces("a `b c` d`") == [("a ", False), ("b c", True), (" d`", False)]
    assert markdown.words("a `b*` c*") == "a `b*` c\\*"
    assert html.words("a `b<` c<") == "a <code>b&lt;</code> c&lt;"
    assert markdown.words("`") == "\\`"
    assert pieces("a ``` b ``` c") == [("a ``` b ``` c", False)]  # a fence in somebody's text is none


def test_powers_of_ten_are_set_as_powers_and_code_is_left_alone():
    assert "3.4·10<sup>−15</sup>" in html.words("at 3.4e-15")
    assert ">10<sup>4</sup>" in html.words("1e4")
    assert ">10<sup>6</sup>" in html.words("1e+06 years")
    assert html.words("0e+00") == "0"
    assert "tol=1e-15" in html.words("`Taylor(tol=1e-15)`")
    assert "tol=1e-15" in html.words("Taylor(tol=1e-15) of 2")
    assert html.words("-0.015") == "−0.015"


def test_the_markdown_and_the_page_show_all_figures():
    pictures = [dataclasses.replace(drawn(), key=f"drawn-{i}") for i in range(2)]
    made = Document("a title", ["of four words"], [Files("All", ["b.json"]), Details("More of it", pictures)])
    files = rendered(made)
    assert set(files) == {"report.md", "index.html", *(f"figures/drawn-{i}.svg" for i in range(2))}
    assert files["report.md"].count(b"![") == files["index.html"].count(b"<figure ") == 2
    assert b'href="b.json" download="b.json">' in files["index.html"]


def test_a_figure_is_as_wide_as_it_was_drawn():
    assert f"max-width:{216 * html.ENLARGED:.0f}px" in html.drawing(drawn(), {})


def broken() -> Picture:
    raise ZeroDivisionError("no such thing")


def test_a_part_that_fails_is_named_and_everything_else_is_written(tmp_path):
    blocks = attempt(
        ("the first", drawn), ("the second", broken), ("nothing", lambda: None), ("more", lambda: ["x"])
    )
    assert [type(block) for block in blocks] == [Picture, Failed, str]
    made = Document("t", [], [Section("s", blocks, "s")])
    assert [part.title for part in made.failed] == ["the second"]
    assert "broken" in made.failed[0].trace
    for path in write(made, tmp_path):
        text = path.read_text(encoding="utf-8")
        assert "the second" in text
        assert "ZeroDivisionError: no such thing" in text
    assert (tmp_path / "figures" / "drawn.svg").is_file()


def test_a_figure_of_a_campaign_that_fails_loses_no_other(tmp_path, monkeypatch, undrawn):
    store = made_up_run.write(Store(tmp_path), ["pendulum(p=1.0)"], 3)
    whole = document(store)
    drawn_over_time = problem.over_time
    monkeypatch.setattr(
        problem,
        "over_time",
        lambda cases, spec: (broken if spec.key == "energy" else partial(drawn_over_time, cases, spec))(),
    )
    made = document(store)
    assert [part.title for part in made.failed] == ["Energy error over time, pendulum(q=0.0, p=1.0)"]
    assert [p.key for p in made.pictures] == [p.key for p in whole.pictures if p.key != "energy"]
    monkeypatch.setattr("hbvm_bench.report.words.summary", lambda records: broken())
    assert "the summary of pendulum(q=0.0, p=1.0)" in [part.title for part in document(store).failed]


def test_the_goals_of_a_campaign_stand_in_its_report(tmp_path, undrawn):
    store = made_up_run.write(Store(tmp_path), ["pendulum(p=1.0)"], 3)
    assert "| goal |" not in markdown.markdown(document(store))
    index = store.index()
    asked = [Goal(metric="energy_max", at=1.0), Goal(metric="energy_max", at=0.0, method="nobody")]
    store.write_index(replace(index, campaign=replace(index.campaign, goals=asked)))
    text = markdown.markdown(document(store))
    rows = [line for line in text.splitlines() if line.startswith("| pendulum | energy error of ")]
    assert [row.split(" | ")[-1] for row in rows] == ["reached |", "missed |"]


def test_a_long_report_has_a_page_for_each_problem_that_links_back():
    made = html.pages(document(opened([REPORTS / "conservation" / "drift"])))
    problems = sorted(name for name in made if name != "index.html")
    assert len(problems) == 26
    assert all(f'href="{name}"' in made["index.html"] for name in problems)
    assert all('<a href="index.html">' in made[name] for name in problems)
    # 82,000 pixels high as one page; 1.07 MB. Rows stand on the problem's page alone.
    assert 'class="results"' not in made["index.html"]
    assert all(made[name].count('<table class="results">') == 1 for name in problems)
    assert [*html.pages(document(opened([REPORTS / "paper" / "sitnikov"])))] == ["index.html"]


def test_a_family_has_one_look_everywhere_and_shades_of_one_hue_differ():
    made = looks(["DOP853", "Radau", "HBVM", "DOP853"])
    assert [look.number for look in made.values()] == [1, 2, 3]
    assert len({look.light for look in made.values()}) == 3
    assert looks(["Radau"])["Radau"].light == made["Radau"].light
