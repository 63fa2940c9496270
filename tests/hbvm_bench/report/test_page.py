"""A campaign names the blocks of its page, and a block is a function of results."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from hbvm_bench.campaign.file import Page, load, parse, shipped
from hbvm_bench.cli import main
from hbvm_bench.report import markdown
from hbvm_bench.report.page import DEFAULT, document, find
from hbvm_bench.store.store import Store
from problems.errors import InputError, UnknownNameError
from tests.hbvm_bench import made_up_run


@pytest.fixture
def store(tmp_path, undrawn):
    return made_up_run.write(Store(tmp_path / "run"), ["pendulum(p=1.0)"], 3)


def with_page(store, **said):
    index = store.index()
    campaign = replace(index.campaign, page=Page(**said))
    store.write_index(replace(index, campaign=campaign))
    return document(store)


def test_every_shipped_campaign_names_blocks_that_are_there():
    named = {(name, path.parent) for path in shipped().values() for name in load(str(path)).page.blocks}
    assert {"race.report:ratios", "./blocks.py:claims"} <= {name for name, _ in named}
    for name, folder in (*named, *((name, None) for name in DEFAULT)):
        assert callable(find(name, folder))


def test_a_campaign_has_blocks_of_its_own_beside_its_file(store, tmp_path):
    """What a file beside it names is run where its folder is given, and refused in a sentence elsewhere."""
    (tmp_path / "rows.py").write_text("def count(results):\n    return len(results.records)\n")
    (tmp_path / "blocks.py").write_text(
        "from .rows import count\n\n\ndef table(results):\n    return f'{count(results)} cases.'\n"
    )
    index = store.index()
    page_ = Page(blocks=["./blocks.py:table"])
    store.write_index(replace(index, campaign=replace(index.campaign, page=page_)))
    assert "3 cases." in markdown.markdown(document(store, tmp_path))
    with pytest.raises(InputError, match="--study FOLDER"):
        find("./blocks.py:table")
    for name, why in (("./blocks.py:tables", "did you mean"), ("./block.py:table", "no file block.py")):
        with pytest.raises(InputError, match=why):
            find(name, tmp_path)
    with pytest.raises(InputError, match=r"must be \./FILE\.py:NAME"):
        find("./../blocks.py:table", tmp_path)


def test_a_page_has_the_blocks_that_its_campaign_names_in_this_order(store):
    made = with_page(store, blocks=["sources", "what_came_out"], name="text.md", lead=["Two blocks."])
    assert made.name == "text.md"
    text = markdown.markdown(made)
    assert text.startswith("# A large campaign\n\nTwo blocks.\n\n## Sources")
    assert text.index("## Sources") < text.index("## Results")
    assert "Fairness" not in text


def test_a_block_that_is_not_there_is_refused_before_anything_is_measured(tmp_path, capsys):
    (tmp_path / "blocks.py").write_text("def table(results):\n    return []\n")
    (tmp_path / "study.toml").write_text(
        'name = "mine"\nproblems = ["kepler()"]\n[page]\nblocks = ["./blocks.py:tables"]\n'
        '[[methods]]\nuse = "HBVM()"\n'
    )
    assert main(["run", str(tmp_path), "--out", str(tmp_path / "run")]) == 2
    assert "did you mean 'table'" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("name", ["what_came_in", "race.report:ratio", "nosuch:block", "../x:y", "os:system"])
def test_an_unknown_block_is_refused_with_the_nearest_names(store, name):
    with pytest.raises(UnknownNameError, match="block of a page"):
        with_page(store, blocks=[name])


@pytest.mark.parametrize(
    ("said", "why"),
    [('blocs = ["sources"]', "blocs"), ('name = "../x"', "page.name"), ("colours = 1", "page")],
)
def test_a_page_that_is_written_wrong_is_refused(said, why):
    text = (
        f'name = "x"\nproblems = ["pendulum()"]\nmethods = [{{ use = "Gauss(s=2, h=0.1)" }}]\n[page]\n{said}'
    )
    with pytest.raises(InputError, match=why):
        parse(text)


def test_another_page_of_a_run_integrates_nothing(toys, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = (
        'name = "x"\nproblems = ["sitnikov(t_end=1.0)"]\nmethods = [{ use = "Waving(h=0.3)" }]\n'
        "[grid]\ncount = 4\n[timing]\nrounds = 0\n"
    )
    for more in ("", '[page]\nblocks = ["sources"]\n'):
        Path("x.toml").write_text(text + more)
        assert main(["run", "x.toml", "--report", "r"]) == 0
    assert "1, 1 already there" in capsys.readouterr().err
    Path("x.toml").write_text(text + '[page]\nblocks = ["source"]\n')
    assert main(["run", "x.toml", "--out", "nothing", "--report", "r"]) == 2
    assert "unknown block of a page 'source'; did you mean 'sources'" in capsys.readouterr().err
    assert not Path("nothing").exists()
    assert "## Results" not in Path("r/report.md").read_text(encoding="utf-8")
