"""Links of the documentation lead somewhere, and what its pages show runs."""

import matplotlib as mpl
import pytest

from tests.docs import pages

TUTORIALS = sorted(path for path in pages.sources() if pages.cells(path))
PEERS = ("heyoka", "rebound", "diffrax", "jax")


@pytest.mark.parametrize("page", pages.sources(), ids=lambda path: str(path.relative_to(pages.ROOT)))
def test_every_link_leads_to_a_file_and_to_a_heading_in_it(page):
    broken = []
    for target in pages.links(page):
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        if not path.exists() or (anchor and path.suffix == ".md" and anchor not in pages.anchors(path)):
            broken.append(target)
    assert not broken


def test_every_page_of_the_tables_of_contents_is_there():
    for page in pages.sources():
        for name in pages.listed(page):
            assert (page.parent / f"{name}.md").is_file(), f"{page}: {name}"


def test_every_tutorial_has_cells_and_says_what_next():
    named = pages.listed(pages.DOCS / "tutorials" / "index.md")
    assert len(named) == 9
    for name in named:
        page = pages.DOCS / "tutorials" / f"{name}.md"
        assert page in TUTORIALS
        last = page.read_text(encoding="utf-8").partition("\n## What next\n")[2]
        assert last.count("](") >= 2, name


@pytest.mark.filterwarnings("default::DeprecationWarning")  # of hosts, on their own
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda path: path.stem)
def test_the_cells_of_a_page_run(page, monkeypatch):
    import matplotlib.pyplot as plt

    monkeypatch.setattr(plt, "show", lambda: plt.close("all"))
    monkeypatch.chdir(page.parent)  # where a notebook runs
    with mpl.rc_context():
        mpl.use("Agg")
        try:
            pages.run(page)
        except ImportError as error:
            library = (error.name or str(error).split()[0]).partition(".")[0]
            if library not in PEERS:
                raise
            pytest.skip(f"{page.name} is NOT run: {library} is not installed (pip install 'hbvm-bench[peers]')")
        finally:
            plt.close("all")


def test_every_picture_is_described_in_words():
    for page in TUTORIALS:
        text = page.read_text(encoding="utf-8")
        drawn = sum("plt.show()" in cell for cell in pages.cells(page))
        assert drawn >= 1, page
        assert text.count("\n    alt: ") == drawn, page
