"""The pages on problems, engines and compile times are those that the code writes."""

import importlib
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from docs.problem_pages import compile_times, pages, pictures
from hbvm_bench.campaign.spec import parse_spec
from problems import registry
from problems.analysis import structure
from problems.errors import InputError

DOCS = Path(__file__).parents[3] / "docs"
STALE = "it is out of date: run python -m docs.problem_pages --no-pictures"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("docs")
    for name in ("problems.md", "engines.md"):
        shutil.copy(DOCS / name, directory)
    pages.write(directory, with_pictures=False)
    return directory


def test_the_pages_are_those_that_the_code_writes(written):
    generated = sorted(path.relative_to(written) for path in written.rglob("*.md"))
    committed = [DOCS / "engines.md", DOCS / "problems.md", *(DOCS / "problems").glob("*.md")]
    assert generated == sorted(path.relative_to(DOCS) for path in committed)
    for name in generated:
        assert (DOCS / name).read_bytes() == (written / name).read_bytes(), STALE


def test_the_problem_that_the_page_shows_does_what_it_says(written, tmp_path, monkeypatch):
    text = (written / "problems.md").read_text(encoding="utf-8").partition("\n## A problem with a name\n")[2]
    (tmp_path / "quartic.py").write_text(text.partition("```python\n")[2].partition("```")[0])
    monkeypatch.syspath_prepend(tmp_path)
    quartic = importlib.import_module("quartic").quartic
    assert repr(quartic()) == "quartic(k=1.0)"
    assert structure.degree(quartic().system, quartic().par) == 4
    with pytest.raises(InputError, match="k=0 of quartic must be a positive number"):
        quartic(k=0)


def test_every_problem_has_its_page_with_formula_source_and_picture(written):
    text = (written / "problems.md").read_text(encoding="utf-8")
    assert "](problems/expression.svg)" in text.partition("\n## A system of your own\n")[2]
    for name in set(registry.built_in()) - {"expression"}:
        assert f"| [{name}](problems/{name}.md) |" in text
        page = (written / "problems" / f"{name}.md").read_text(encoding="utf-8")
        for part in (f"# {name}\n", "$$H = ", "Tests ", "- source: ", "nvariant", f"]({name}.svg)"):
            assert part in page, (name, part)


@pytest.mark.parametrize("name", registry.built_in())
def test_every_problem_has_a_picture_with_something_in_it(name):
    path = DOCS / "problems" / f"{name}.svg"
    root = ET.fromstring(path.read_text(encoding="utf-8"))
    curves = max(len(e.get("d", "")) for e in root.iter() if e.tag.endswith("path"))
    images = sum(e.tag.endswith("image") for e in root.iter())
    assert curves > 1000 or images  # measured at least 1396 characters (cluster)
    assert path.stat().st_size < 200_000


def test_a_picture_is_drawn_from_a_run():
    for name in ("kepler", "morse", "expression"):
        assert pictures.draw(name).endswith("</svg>\n")


def test_a_problem_that_does_not_say_how_it_is_drawn_has_no_picture(monkeypatch):
    monkeypatch.setattr(registry, "entry", lambda name: None)
    with pytest.raises(InputError, match="kepler has no picture"):
        pictures.draw("kepler")


def test_what_is_written_by_hand_stays_and_a_page_without_a_place_is_refused(tmp_path):
    page = tmp_path / "engines.md"
    page.write_text(f"# Mine\n\n{pages.BEGIN}\nold\n{pages.END}\n\nafter\n", encoding="utf-8")
    pages.write(tmp_path, with_pictures=False)
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# Mine\n")
    assert text.endswith("\nafter\n")
    assert "old" not in text
    page.write_text("# Mine\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"around 1 places, not 0"):
        pages.write(tmp_path, with_pictures=False)


def test_pages_are_written_all_or_none(tmp_path, monkeypatch):
    def failing(name):
        raise InputError("it cannot be drawn.")

    monkeypatch.setattr(pictures, "draw", failing)
    with pytest.raises(InputError, match="cannot be drawn"):
        pages.write(tmp_path / "docs")
    assert list(tmp_path.iterdir()) == []


def test_the_page_on_compile_times_has_every_case():
    rows = [line for line in (DOCS / "compile_times.md").read_text().splitlines() if line.startswith("| `")]
    assert [parse_spec(row.split("`")[1]).name for row in rows] == [
        parse_spec(case).name for case in compile_times.CASES
    ]


def test_the_steps_to_machine_code_are_measured():
    found = compile_times.measure("pendulum()")
    assert found.problem == "pendulum(q=0.0, p=1.9)"
    assert found.unknowns == 2
    assert found.lines > 2
    assert min(found.trace, found.emit, found.scalar, found.lanes) > 0.0
