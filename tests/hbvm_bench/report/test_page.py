"""A page is a template that says which blocks stand where, and a block is a function of results."""

import re
from pathlib import Path

import pytest

from hbvm_bench.campaign.file import STUDY, parse, shipped
from hbvm_bench.cli import main
from hbvm_bench.commands.publishing import report_on
from hbvm_bench.report import markdown, template
from hbvm_bench.report.document import Details, Links, Note, Picture, Section
from hbvm_bench.report.page import check, document, find, page_file, page_in
from hbvm_bench.report.template import NAME, parsed
from hbvm_bench.report.write import TEXT
from hbvm_bench.store.store import Store
from problems.errors import InputError, UnknownNameError
from tests.hbvm_bench import made_up_run

REPORTS = Path(__file__).parents[3] / "reports"
COMMITTED = sorted(path.parent.name for path in REPORTS.glob(f"*/{TEXT}"))
MOST_WORDS = 5000  # before anything is unfolded; measured 382 to 1,678


@pytest.fixture
def store(tmp_path, undrawn):
    return made_up_run.write(Store(tmp_path / "run"), ["pendulum(p=1.0)"], 3)


def made(folder, text, store):
    (folder / NAME).write_text(text, encoding="utf-8")
    return document(store, folder)


def test_every_page_that_comes_with_the_package_or_lies_in_the_reports_names_blocks_that_are_there():
    folders = {path.parent for path in shipped().values()} | {REPORTS / name for name in COMMITTED}
    named = {
        (name, results) for folder in folders for name, results in template.named_blocks(page_file(folder))
    }
    assert {("./blocks.py:claims", "paper"), ("cost_ratio", "race"), ("cost_ratio", None)} <= named
    for folder in folders:
        check(folder)
    for name in {name for name, _ in named if not name.startswith("./")}:
        assert callable(find(name))


def test_a_campaign_has_blocks_of_its_own_beside_its_file(store, tmp_path):
    """What a file beside it names is run where its folder is given, and refused in a sentence elsewhere."""
    (tmp_path / "rows.py").write_text("def count(results):\n    return len(results.frame)\n")
    (tmp_path / "blocks.py").write_text(
        "from .rows import count\n\n\ndef table(results, words='cases'):\n"
        "    return f'{count(results)} {words}.'\n"
    )
    text = '# T\n\n{{ block("./blocks.py:table") }} Of {{ value("./blocks.py:table") }}\n\n'
    text += '{{ block("./blocks.py:table", words="rows") }}\n'
    assert markdown.markdown(made(tmp_path, text, store)) == "# T\n\n3 cases. Of 3 cases.\n\n3 rows.\n"
    with pytest.raises(InputError, match="--study FOLDER"):
        find("./blocks.py:table")
    for name, why in (("./blocks.py:tables", "did you mean"), ("./block.py:table", "no file block.py")):
        with pytest.raises(InputError, match=why):
            find(name, tmp_path)
    with pytest.raises(InputError, match=r"must be \./FILE\.py:NAME"):
        find("./../blocks.py:table", tmp_path)


def test_a_page_has_what_its_template_says_in_this_order(store, tmp_path):
    text = (
        '# Mine\n\nTwo {{ frame().family.nunique() }}.\n\n{{ block("sources") }}\n{{ block("all_cases") }}\n'
    )
    said = markdown.markdown(made(tmp_path, text, store))
    assert said.startswith("# Mine\n\nTwo 3.\n\n## Sources")
    assert said.index("## Sources") < said.index("| # | method")
    assert "Fairness" not in said


def test_a_run_is_reported_in_a_folder_whose_page_has_results_of_folders_in_it(store, tmp_path):
    whole = tmp_path / "report"
    part = whole / "part"
    part.mkdir(parents=True)
    (part / NAME).write_text('# Part\n\n{{ block("sources") }}\n', encoding="utf-8")
    report_on([store], part)
    text = '# Whole\n\n{{ frame("").index.size }} and {{ frame("part").index.size }}.\n'
    (whole / NAME).write_text(text + '\n{{ block("sources", "part") }}\n', encoding="utf-8")
    report_on([store], whole)
    written = (whole / TEXT).read_text(encoding="utf-8")
    assert written.startswith("# Whole\n\n3 and 3.\n\n## Sources")
    assert markdown.markdown(page_in(whole)) == written


def test_markdown_of_a_template_is_blocks():
    text = (
        "# T\n\nLead.\n\n## A part\n\nWords of it\nin lines.\n### Below\n- one\n- two\n\n> small\n> print\n\n"
        "<details><summary>More</summary>\n## Inside\n\nText\n\n</details>\n\n"
        "## Last\n\n- [A](a.html) page\n\n    make it\n"
    )
    title, lead, blocks = parsed(text, [])
    assert (title, lead) == ("T", ["Lead."])
    part, last = blocks
    assert isinstance(part, Section)
    assert isinstance(last, Section)
    assert [part.title, part.key, part.nav, part.blocks[0]] == [
        "A part",
        "a-part",
        "A part",
        "Words of it\nin lines.",
    ]
    below = part.blocks[1]
    assert isinstance(below, Section)
    items, note, folded = below.blocks
    assert isinstance(folded, Details)
    assert (items.items, note) == (["one", "two"], Note("small print"))
    assert [(block.title, block.blocks) for block in folded.blocks] == [("Inside", ["Text"])]
    assert last.blocks[0] == Links([("A", "page", "a.html")])
    assert last.blocks[1].text == "make it"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{{ nothing }}", "'nothing' is undefined"),
        ("{% for %}", "cannot read the page|cannot be made"),
        ('{{ block("sources", "elsewhere") }}', "results of the page 'elsewhere'"),
    ],
)
def test_a_template_that_cannot_be_made_is_refused_in_a_sentence(store, tmp_path, text, why):
    with pytest.raises(InputError, match=why):
        made(tmp_path, text, store)


@pytest.mark.parametrize(
    ("block", "why"), [("./blocks.py:tables", "did you mean 'table'"), ("what_came_in", "what_came_out")]
)
def test_a_block_that_is_not_there_is_refused_before_anything_is_measured(tmp_path, capsys, block, why):
    (tmp_path / "blocks.py").write_text("def table(results):\n    return []\n")
    (tmp_path / NAME).write_text(f'{{{{ block("{block}") }}}}')
    (tmp_path / STUDY).write_text('name = "mine"\nproblems = ["kepler()"]\n[[methods]]\nuse = "HBVM()"\n')
    assert main(["run", str(tmp_path), "--out", str(tmp_path / "run")]) == 2
    assert why in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("name", ["what_came_in", "race.report:ratio", "nosuch:block", "../x:y", "os:system"])
def test_an_unknown_block_is_refused_with_the_nearest_names(name):
    with pytest.raises(UnknownNameError, match="block of a page"):
        find(name)


@pytest.mark.parametrize(
    ("said", "why"),
    [('blocks = ["sources"]', "blocks"), ('name = "x"', "name"), ("by_processor = 1", "page")],
)
def test_a_page_that_cannot_be_is_refused_where_the_campaign_is_read(said, why):
    text = f'name = "x"\nproblems = ["kepler()"]\n[page]\n{said}\n[[methods]]\nuse = "HBVM()"\n'
    with pytest.raises(InputError, match=why):
        parse(text)


def test_the_list_of_reports_is_in_the_order_of_its_template():
    listed = re.findall(r"^## \[[^]]+\]\((\w+)/report\.md\)$", (REPORTS / "README.md").read_text(), re.M)
    assert listed[:2] == ["speed", "conservation"]
    assert sorted(listed) == COMMITTED


def unfolded(blocks):
    """Yield what is seen before anything is unfolded."""
    for block in blocks:
        if isinstance(block, Section):
            yield from unfolded(block.blocks)
        elif not isinstance(block, Details):
            yield block


@pytest.mark.parametrize("name", COMMITTED)
def test_a_committed_report_is_the_one_drawn_from_its_results(name, undrawn):
    """Short before it is unfolded, with its result first; the figures beside it are those of its text."""
    drawn = page_in(REPORTS / name)
    assert drawn.failed == []
    text = (REPORTS / name / TEXT).read_text(encoding="utf-8")
    assert markdown.markdown(drawn) == text
    assert len(re.sub("<details>.*</details>", "", text, flags=re.DOTALL).split()) <= MOST_WORDS
    assert len(drawn.lead[0].split()) <= 160
    figures = {path.name for path in (REPORTS / name).glob("figures/*.svg")}
    assert figures == {Path(figure.file).name for figure in drawn.pictures}
    assert len([block for block in unfolded(drawn.blocks) if isinstance(block, Picture)]) <= 2
    assert all(isinstance(figure, Picture) and figure.summary for figure in drawn.pictures)
