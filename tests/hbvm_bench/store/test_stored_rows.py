"""One file has what a report is made of: it comes back whole, and is refused where it is damaged."""

import lzma
import sqlite3
from pathlib import Path

import msgspec
import pytest

from hbvm_bench.cli import main
from hbvm_bench.measure import reading
from hbvm_bench.report import html, markdown
from hbvm_bench.report.page import document, gather
from hbvm_bench.report.stored import contents
from hbvm_bench.store.records import ErrorGrowth, Load, Result, Value
from hbvm_bench.store.store import PACKED, TABLES, VERSION, Store, opened
from problems.errors import InputError
from tests.hbvm_bench import made_up_run

REPORTS = Path(__file__).parents[3] / "reports"
SITNIKOV = REPORTS / "paper" / "sitnikov"


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
    """JSON output and stores are read by other programs, and by this one in later versions."""
    assert msgspec.convert(stored, type(here)) == here
    assert msgspec.to_builtins(here) == stored
    assert "laws" in msgspec.to_builtins(Result(outcome="ok"))


def test_a_page_from_stored_rows_is_the_one_from_its_run(run, tmp_path):
    store, drawn = run
    path = tmp_path / PACKED
    path.write_bytes(contents(gather([store]), [store]).packed())
    stored = opened([tmp_path])
    assert stored[0].records() == reading.records(store)
    assert stored[0].index() == store.index()
    again = document(stored)
    assert markdown.markdown(again) == markdown.markdown(drawn)
    assert html.page(again) == html.page(drawn)
    before = path.read_bytes()
    assert contents(gather(stored), stored).packed() == before


def database(*statements):
    """Return the bytes of a database."""
    with sqlite3.connect(":memory:") as made:
        made.executescript(";".join(statements))
        content = made.serialize()
    made.close()
    return content


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "no store of results"),
        (b"{}", "no store of results"),
        (lzma.compress(b"{}" * 1000), "no store of results: file is not a database"),
        (lzma.compress(database("CREATE TABLE x (y)")), "has no table of them"),
        (lzma.compress(database(TABLES, "PRAGMA user_version=99")), "another version"),
        (lzma.compress(database(TABLES, f"PRAGMA user_version={VERSION}"))[:-20], "no store of results"),
    ],
)
def test_what_is_no_store_is_refused_in_one_sentence(tmp_path, content, says):
    (tmp_path / PACKED).write_bytes(content)
    with pytest.raises(InputError, match=says):
        opened([tmp_path])


def test_no_more_is_unpacked_than_memory_is_allowed(tmp_path, monkeypatch):
    (tmp_path / PACKED).write_bytes(lzma.compress(bytes(10**7)))
    monkeypatch.setenv("HBVM_BENCH_MAX_GIB", "0.005")
    with pytest.raises(InputError, match="it is cut, or has more than"):
        opened([tmp_path])


def test_a_report_is_exported_as_a_table_and_has_no_series(tmp_path, capsys):
    out = tmp_path / "cases.csv"
    assert main(["export", str(SITNIKOV), "-o", str(out)]) == 0
    assert f"28 rows in {out}" in capsys.readouterr().out
    assert main(["export", str(REPORTS / "many" / "ensemble"), "-o", str(out), "--table", "series"]) == 2
    assert "is a report, which has no series" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["campaign.json", "results.json.xz"])
def test_results_of_version_0_1_are_told_from_no_results(tmp_path, name, capsys):
    (tmp_path / name).write_bytes(b"{}")
    assert main(["show", str(tmp_path)]) == 2
    assert "has results of hbvm-bench 0.1; read them with that version" in capsys.readouterr().err
