"""One file has what a report is made of: it comes back whole, and is refused where it is damaged."""

import lzma
import re
from pathlib import Path

import msgspec
import pytest

from hbvm_bench.cli import main
from hbvm_bench.measure import reading
from hbvm_bench.report import html, markdown
from hbvm_bench.report.archived import contents, pictures
from hbvm_bench.report.page import document
from hbvm_bench.store import archive
from hbvm_bench.store.records import ErrorGrowth, Load, Result, Value
from hbvm_bench.store.store import Store
from problems.errors import InputError
from tests.hbvm_bench import made_up_run

REPORTS = Path(__file__).parents[3] / "reports"
ARCHIVED = sorted(path.parent.name for path in REPORTS.glob(f"*/{archive.NAME}"))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    store = made_up_run.write(Store(tmp_path_factory.mktemp("run")), ["pendulum(p=1.0)"], 4, missing=1)
    return store, document(store)


@pytest.mark.parametrize(
    ("stored", "here"),
    [
        ({"value": 1.0, "void": True, "why": "left"}, Value(value=1.0, excluded=True, why="left")),
        ({"others": 0.1, "stolen": 0.2}, Load(others=0.1, steal=0.2)),
        ({"law": "exponential", "growth": 0.25}, ErrorGrowth(kind="exponential", exponential_rate=0.25)),
    ],
)
def test_stored_results_keep_the_names_of_their_fields(stored, here):
    """JSON output and archives are read by other programs, and by this one in later versions."""
    assert msgspec.convert(stored, type(here)) == here
    assert msgspec.to_builtins(here) == stored
    assert "laws" in msgspec.to_builtins(Result(outcome="ok"))


def test_a_former_head_of_a_figure_s_table_has_the_present_name():
    drawing = archive.Drawing(
        place="problem-1", key="drift", title="", caption="", summary="", svg="",
        numbers=[["case", "law"], ["Gauss(s=8, h=0.5)", "t^0.50"]],
    )  # fmt: skip
    (picture,) = pictures([drawing], "problem-1")
    assert picture.numbers is not None
    assert picture.numbers.head == ("case", "growth")


def test_a_page_from_an_archive_is_the_one_from_its_store(run, tmp_path):
    store, drawn = run
    path = tmp_path / archive.NAME
    path.write_bytes(archive.packed(contents(drawn, [store])))
    archives = archive.read(path)
    assert archives[0].records() == reading.records(store)
    assert archives[0].index() == store.index()
    again = document(archives)
    assert markdown.markdown(again) == markdown.markdown(drawn)
    assert html.page(again) == html.page(drawn)
    before = path.read_bytes()
    path.write_bytes(archive.packed(contents(again, archives)))
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "no archive"),
        (b"{}", "no archive"),
        (lzma.compress(b"{}"), "runs"),
        (lzma.compress(b"[" * 100_000), "no archive"),
        (lzma.compress(b'{"runs": [], "schema": 99}'), "another version"),
        (lzma.compress(b'{"runs": []}')[:-20], "no archive"),
    ],
)
def test_what_is_no_archive_is_refused_in_one_sentence(tmp_path, content, says):
    (tmp_path / archive.NAME).write_bytes(content)
    with pytest.raises(InputError, match=says):
        archive.read(tmp_path / archive.NAME)


def test_columns_of_different_lengths_are_refused(run, tmp_path):
    store, drawn = run
    whole = contents(drawn, [store])
    (table,) = whole.runs
    cut = msgspec.structs.replace(table, columns={**table.columns, "id": table.columns["id"][:-1]})
    (tmp_path / archive.NAME).write_bytes(archive.packed(msgspec.structs.replace(whole, runs=[cut])))
    with pytest.raises(InputError, match="no archive"):
        archive.read(tmp_path / archive.NAME)


def test_an_archive_makes_a_report_alone(run, tmp_path):
    store, drawn = run
    (tmp_path / archive.NAME).write_bytes(archive.packed(contents(drawn, [store])))
    with pytest.raises(InputError, match="by itself alone"):
        archive.opened([tmp_path, store.directory])


def rows(text):
    """Return the rows of the cases, which are numbers; words about them may have changed since."""
    return sorted(re.findall(r"^\| \d+ \| `.*$", text, re.MULTILINE))


STUDIES = {"paper", "chaos", "random", "costs"}  # without rows of cases
ROWS = [name for name in ARCHIVED if name not in STUDIES and (REPORTS / name / "report.md").is_file()]


@pytest.mark.parametrize("name", ROWS)  # the other pages are compared whole, in report/test_document.py
def test_a_committed_archive_has_the_numbers_of_its_text(name):
    folder = REPORTS / name
    made = document(archive.opened([folder]))
    assert made.failed == []
    found = rows(markdown.markdown(made))
    assert found == rows((folder / made.name).read_text(encoding="utf-8"))
    assert len(found) >= 28


def test_there_are_committed_archives_and_one_page_which_is_small():
    assert {"sitnikov", "drift", "general"} <= set(ARCHIVED)
    assert (REPORTS / "sitnikov" / "index.html").stat().st_size < 500_000


def test_an_archive_is_exported_as_a_table_and_has_no_series(tmp_path, capsys):
    out = tmp_path / "cases.csv"
    assert main(["export", str(REPORTS / "sitnikov"), "-o", str(out)]) == 0
    assert f"28 rows in {out}" in capsys.readouterr().out
    assert main(["export", str(REPORTS / "sitnikov"), "-o", str(out), "--table", "series"]) == 2
    assert "is an archive, which has no series" in capsys.readouterr().err
