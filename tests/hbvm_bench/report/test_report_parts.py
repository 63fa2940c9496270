"""Parts of the reports: numbers behind figures, packing, sections, merging, the list of reports."""

import base64
import gzip
import re

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hbvm_bench.campaign.file import Campaign, MethodEntry, shipped
from hbvm_bench.commands.publishing import report_on
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.report import html
from hbvm_bench.report.blocks import all_cases
from hbvm_bench.report.document import Details
from hbvm_bench.report.figures.canvas import new, numbers
from hbvm_bench.report.index import CHECKS, not_measured, write_index, write_pages
from hbvm_bench.report.markdown import markdown
from hbvm_bench.report.page import document, gather, page_of
from hbvm_bench.report.write import TEXT, rendered
from hbvm_bench.store.merge import merge
from hbvm_bench.store.records import Load, Result, Timing
from hbvm_bench.store.store import Index, Store, StoredRun
from problems.errors import InputError
from tests.hbvm_bench import made_up_run


@settings(max_examples=25, deadline=None)
@given(st.dictionaries(st.text(max_size=30), st.text(max_size=3000)))
def test_what_is_packed_can_be_unpacked_and_cannot_end_a_script(drawings):
    text = html.packed(drawings)
    assert msgspec.json.decode(gzip.decompress(base64.b64decode(text))) == drawings
    assert not set(text) & set("<'\"\\\n ")
    assert html.packed(drawings) == text


def test_the_numbers_of_a_figure_are_those_of_its_labelled_lines():
    figure, x = new(3.0, 2.0), np.linspace(0.0, 10.0, 101)
    axes = figure.subplots()
    assert numbers(figure) is None
    axes.plot(x, np.where(x > 9.0, np.nan, x**2), label='a "b", c')
    axes.plot(x, x)
    axes.plot([], [], label="in the legend alone")
    table = numbers(figure)
    assert table.rows == [('a "b", c', "", "101", "0", "10", "0", "81", "81")]


def test_runs_are_merged_and_of_two_alike_the_later_is_taken(tmp_path):
    first = made_up_run.write(Store(tmp_path / "a"), ["pendulum(p=1.0)"], 4, missing=1)
    second = made_up_run.write(Store(tmp_path / "b"), ["pendulum(p=1.0)", "pendulum(p=1.2)"], 3)
    newer = second.records()[1]
    second.save(msgspec.structs.replace(newer, finished="2026-11-22T10:00:00+00:00", seconds=7.0))
    content = gather([first, second])
    assert len(content.records) == 4 + 3  # the case that the first run lacks is in the second
    assert [record.seconds for record in content.records if record.id == newer.id] == [7.0]
    assert content.missing(content.runs[0]) == []
    made = document([first, second])
    assert made.title.startswith("2 runs together")
    assert "Measured on 2026-01-02 to 2026-11-22" in markdown(made)
    assert [look.number for look in made.looks] == [1, 2, 3, 4, 5]  # of four families, and of the motion


def test_a_report_keeps_of_a_case_what_merge_keeps(tmp_path):
    """A later failure does not stand for what an earlier run measured."""
    first = made_up_run.write(Store(tmp_path / "a"), ["pendulum(p=1.0)"], 3)
    second = made_up_run.write(Store(tmp_path / "b"), ["pendulum(p=1.0)"], 3)
    measured = first.records()[0]
    failed = msgspec.structs.replace(
        measured, finished="2026-11-23T10:00:00+00:00", result=Result(outcome="timeout"), timing=None
    )
    second.save(failed)
    (kept,) = (record for record in gather([first, second]).records if record.id == measured.id)
    out = Store(tmp_path / "out")
    merge([first, second], out)
    assert kept.result.outcome == "ok"
    assert kept == out.load(measured.id)


def test_a_report_explains_the_columns_that_it_has_and_has_a_file_for_every_picture_that_it_names(tmp_path):
    content = gather([made_up_run.write(Store(tmp_path), ["pendulum(p=1.0)"], 4)])
    table, meaning = all_cases(content)
    assert [row[0] for row in meaning.blocks[0].rows] == [metric.short for metric in table.columns]
    assert 3 < len(table.columns) < len(METRICS) / 2
    files = rendered(page_of(content))
    named = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", files[TEXT].decode())
    assert named
    assert {*named} == {name for name in files if name.endswith(".svg")}


def test_a_picture_that_lies_in_a_report_is_drawn_anew_with_its_page(tmp_path):
    store = made_up_run.write(Store(tmp_path / "run"), ["pendulum(p=1.0)"], 3)
    report_on([store], tmp_path / "reports" / "one")
    pictures = [*(tmp_path / "reports" / "one" / "figures").glob("*.svg")]
    drawn = {path: path.read_bytes() for path in pictures}
    assert drawn
    for path in pictures:
        path.write_text("<svg/>")  # as of code that has changed since
    assert len([*write_pages(tmp_path / "reports")]) == 1
    assert {path: path.read_bytes() for path in pictures} == drawn


def test_what_is_missing_is_named(tmp_path):
    store = made_up_run.write(Store(tmp_path), ["pendulum(p=1.0)"], 3, missing=1)
    content = gather([store])
    assert [case.method for case in content.missing(content.runs[0])] == [made_up_run.methods(3)[0]]
    folded = [block.summary for block in document(store).walk() if isinstance(block, Details)]
    assert "1 cases on this problem have no result yet" in folded


def test_the_list_of_reports_says_what_each_is_with_a_picture_and_its_command(tmp_path):
    folder = tmp_path / "one"
    folder.mkdir()
    (folder / "report.md").write_text(
        "# A title\n\nWhat it is about.\n\n![x](figures/x.png)\n\n    hbvm-bench run one\n", encoding="utf-8"
    )
    (tmp_path / "unwritten").mkdir()
    text = write_index(tmp_path).read_text(encoding="utf-8")
    for part in ("A title", "What it is about.", 'src="one/figures/x.png"', "one/report.md"):
        assert part in text
    assert "unwritten" not in text
    (folder / "index.html").write_text("", encoding="utf-8")  # a page that is drawn changes no list
    assert write_index(tmp_path).read_text(encoding="utf-8") == text


def test_the_list_of_reports_says_when_and_where_each_was_measured(tmp_path):
    def timed(**load):
        return Timing(rounds=made_up_run.timed([1.0]), load=Load(**load), machine=machine)

    machine: dict[str, str | int] = {"processor": "A", "llvm_processor": "znver5", "vector_bits": 512}
    ours = made_up_run.record(
        "HBVM()", problem="pendulum()", timing=timed(others=0.02, steal=0.0), kernel="0123456789abcdef"
    )
    peer = made_up_run.record("IAS15()", problem="pendulum()", timing=timed(others=0.3, steal=0.01))
    campaign = Campaign(name="one", problems=["pendulum()"], methods=[MethodEntry(use=["HBVM()", "IAS15()"])])
    index = Index(campaign=campaign, ids=[ours.id, peer.id], version="0", command="")
    made_up_run.archived(tmp_path / "one", StoredRun(index=index, records=[ours, peer]))
    (tmp_path / "one" / "report.md").write_text("# A title\n", encoding="utf-8")
    row = "| one | 2026-01-02 | A, znver5-512bit | 0123456789ab | 2% to 30% | 0% to 1% |"
    assert row in write_index(tmp_path).read_text(encoding="utf-8")


def test_the_list_names_the_campaigns_without_results_and_follows_its_template(tmp_path):
    campaign = Campaign(name="x", problems=["pendulum()"], methods=[MethodEntry(use="HBVM()")])
    one = made_up_run.record("HBVM()", problem="pendulum()")
    index = Index(campaign=campaign, ids=[one.id], version="0", command="")
    for name in {*shipped()} - {"drift", "large", *CHECKS}:
        made_up_run.archived(tmp_path / "all" / name, StoredRun(index=index, records=[one]))
    assert not_measured(tmp_path) == ["drift: Conservation in long integrations", "large: Large systems"]
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "report.md").write_text(f"# Title {name}\n", encoding="utf-8")
    text = write_index(tmp_path).read_text(encoding="utf-8")
    assert text.index("Title a") < text.index("Title b")
    assert "## Not measured\n\n- drift: Conserv" in text
    assert "| all/race | 2026-01-02 |" in text
    (tmp_path / "page.md").write_text('# Mine\n\n{{ entry("b") }}\n\n{{ entry("a") }}\n')
    text = write_index(tmp_path).read_text(encoding="utf-8")
    assert text.startswith("# Mine")
    assert text.index("Title b") < text.index("Title a")
    (tmp_path / "page.md").write_text('{{ entry("c") }}')
    with pytest.raises(InputError, match="cannot be made"):
        write_index(tmp_path)


def test_a_directory_without_reports_has_no_list(tmp_path):
    with pytest.raises(InputError, match="holds no report"):
        write_index(tmp_path)
    with pytest.raises(InputError, match="does not exist"):
        write_index(tmp_path / "nowhere")
