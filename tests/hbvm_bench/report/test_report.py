"""The report says what the store says, whatever the names in it, and asks nothing of the network."""

import re
from html.parser import HTMLParser

import msgspec
import numpy as np
import pytest

from hbvm_bench.campaign.file import Campaign, Ensemble, MethodEntry, TimingPlan
from hbvm_bench.measure import reading
from hbvm_bench.measure.metrics import GUARD_TOLERANCE
from hbvm_bench.report import words
from hbvm_bench.report.curves import POINTS, envelope
from hbvm_bench.report.markdown import code, plain
from hbvm_bench.report.page import document
from hbvm_bench.report.problem import summary
from hbvm_bench.report.write import write
from hbvm_bench.store.records import Load, Timing, Value
from hbvm_bench.store.store import PACKED, Index, Store
from hbvm_bench.summaries.rows import Task
from problems.errors import InputError
from tests.hbvm_bench import made_up_run
from tests.hbvm_bench.made_up_run import HOSTILE, METHODS


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return made_up_run.sitnikov(Store(tmp_path_factory.mktemp("run")))


@pytest.fixture(scope="module")
def written(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write(document(run), folder)
    return folder


class Reader(HTMLParser):
    """Collects tags, and what would leave the page."""

    def __init__(self):
        super().__init__()
        self.tags, self.requests, self.ids, self.open = [], [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        given = dict(attrs)
        self.ids += [given["id"]] if "id" in given else []
        for name in ("src", "href", "xlink:href", "data", "srcset", "action"):
            target = given.get(name) or ""
            relative = target.startswith("#") or target == PACKED
            if name in given and not (relative and (tag in ("a", "use") or target.startswith("#"))):
                self.requests.append((tag, target))
        assert not [name for name in given if name.startswith("on")]


@pytest.fixture(scope="module")
def page(written):
    text = (written / "index.html").read_text(encoding="utf-8")
    reader = Reader()
    reader.feed(text)
    return text, reader


def test_hostile_names_cannot_break_the_page(page):
    text, reader = page
    assert reader.tags.count("script") == 2  # the page's own and its data
    outside = re.sub(r"<script[ >].*?</script>", "", text, flags=re.DOTALL)
    assert "<script>alert" not in text
    assert "alert(" not in outside.replace("&lt;script&gt;alert(", "")
    assert "&lt;script&gt;alert" in text


def test_the_page_asks_nothing_of_the_network(page):
    text, reader = page
    assert reader.requests == []
    assert "@import" not in text
    assert re.findall(r"url\((?!#)", text) == []
    assert set(re.findall(r"https?://([\w.]+)", text)) <= {"www.w3.org"}
    assert "default-src 'none'" in text


def test_ids_are_unique_in_the_page(page):
    _, reader = page
    assert len(set(reader.ids)) == len(reader.ids)


def test_every_case_is_a_row_and_the_table_comes_first(page):
    text, _ = page
    assert len(re.findall(r'<tr id="case-1-\w+"', text)) == len(METHODS)
    assert text.index("<table") < text.index("<figure")


def test_every_figure_has_a_title_a_summary_and_its_files(page, written):
    text, reader = page
    figures = re.findall(r'<figure id="([\w-]+)"', text)
    assert set(figures) >= {
        "work-precision",
        "energy",
        "position",
        "angular-momentum",
        "symmetry",
    }
    for key in figures:
        assert {f"{key}-title", f"{key}-desc"} <= set(reader.ids)
    shown = [path.stem for path in (written / "figures").iterdir()]
    assert sorted(shown) == sorted(figures)


def test_the_same_store_gives_the_same_bytes(run, written, tmp_path):
    write(document(run), tmp_path)
    for path in written.rglob("*.*"):
        assert (tmp_path / path.relative_to(written)).read_bytes() == path.read_bytes(), path.name


def test_colours_of_the_page_are_variables_of_both_themes(page):
    text, _ = page
    assert "var(--m1)" in text
    used = set(re.findall(r"var\((--[\w]+)\)", text))
    light = set(re.findall(r"(--[\w]+):", text.split("</style>")[0].split("}", 1)[0]))
    dark = set(re.findall(r"(--[\w]+):", text.split(":root[data-theme=dark]{", 1)[1].split("}", 1)[0]))
    assert light == dark
    assert {"--m1", "--ink", "--paper"} <= light
    assert {name for name in used if name.startswith("--m")} - {"--muted", "--mono"} <= light


def test_markdown_has_the_same_rows_and_no_raw_html(written):
    text = (written / "report.md").read_text(encoding="utf-8")
    assert len(re.findall(r"^\| \d+ \| `", text, re.M)) == len(METHODS)
    assert "<script>" not in re.sub(r"^    .*$|`[^`]*`", "", text, flags=re.M)
    for target in re.findall(r"\]\((figures/[^)]+)\)", text):
        assert (written / target).is_file()
    heads = [line for line in text.splitlines() if line.startswith("#")]
    assert "# head" not in heads


def test_void_numbers_are_in_brackets_and_in_no_summary(run, written):
    text = (written / "report.md").read_text(encoding="utf-8")
    (row,) = [line for line in text.splitlines() if re.match(r"\| \d+ \| `Radau\(", line)]
    cells = [cell.strip() for cell in row.split("|")]
    assert "3.0e+00" in cells  # the guard itself
    assert sum(cell.startswith("(") for cell in cells) >= 4
    best = [sentence for sentence in words.summary(reading.records(run)) if sentence.startswith("Smallest")]
    assert "Radau" not in best[0]
    assert best[0].index("HBVM(k=16") < best[0].index("IAS15(mode")


def test_a_peer_that_wins_is_named_first(run):
    records = reading.records(run)
    better = msgspec.structs.replace(
        records[2],
        result=msgspec.structs.replace(
            records[2].result,
            metrics=records[2].result.metrics | {"position_end": msgspec.structs.replace(
                records[2].result.metrics["position_end"], value=1e-15)},
        ),
    )  # fmt: skip
    sentence = words.summary([better if r is records[2] else r for r in records])[1]
    assert sentence.startswith("Smallest position error at the end: IAS15(mode='global') (1.0e-15")


def test_our_own_weaknesses_are_said_with_their_numbers(run):
    records = reading.records(run)
    values = records[1].result.metrics
    worse = {"position_end": 4.7, "observable_error": 1.8}
    worse |= {"angular_momentum_max": 3.4e-3, "energy_max": 3.2e-14}
    metrics = values | {key: msgspec.structs.replace(values[key], value=v) for key, v in worse.items()}
    record = msgspec.structs.replace(
        records[1], result=msgspec.structs.replace(records[1].result, metrics=metrics)
    )
    said = " ".join(words.shortcomings([record]))
    for text in (
        "not symplectic",
        "implicit",
        "angular momentum",
        "4.7",
        "an error of the observable of 1.8",
        "3.4e-03",
        "3.2e-14",
    ):
        assert text in said


def test_words_about_a_case_are_the_campaigns_present_ones(run):
    index = run.index()
    renamed = [
        msgspec.structs.replace(entry, note="new", settings="default") for entry in index.campaign.methods
    ]
    run.write_index(
        msgspec.structs.replace(index, campaign=msgspec.structs.replace(index.campaign, methods=renamed))
    )
    try:
        assert {(record.case.note, record.case.settings) for record in reading.records(run)} == {
            ("new", "default")
        }
    finally:
        run.write_index(index)


def test_a_report_without_a_finished_case_writes_nothing(tmp_path):
    store = Store(tmp_path / "run")
    store.prepare()
    campaign = Campaign(name="x", problems=["p()"], methods=[MethodEntry(use="m()")])
    store.write_index(Index(campaign=campaign, ids=["0" * 64], version="0", command="hbvm-bench run x"))
    with pytest.raises(InputError, match="has finished"):
        write(document(store), tmp_path / "report")
    assert not (tmp_path / "report").exists()


def test_an_envelope_keeps_the_largest_values():
    t = np.linspace(0, 1, 5000)
    values = np.abs(np.sin(40 * t)) * t
    thin_t, thin = envelope(t, values)
    assert thin.size <= POINTS
    assert thin.max() == values.max()
    assert np.all(np.diff(thin_t) > 0)
    assert set(thin_t) <= set(t)


@pytest.mark.parametrize("text", [HOSTILE, "a|b", "`", "``x", "<i>", "$x$"])
def test_text_in_markdown_stays_in_its_cell(text):
    for made in (plain(text), code(text)):
        assert "\n" not in made
        assert not re.search(r"(?<!\\)\|", made)
    assert not re.search(r"(?<!\\)<", plain(text))


def test_the_rules_name_the_tolerance_that_is_used():
    assert any(f"{GUARD_TOLERANCE:g}" in rule for rule in words.RULES)


@pytest.mark.parametrize(
    ("plan", "said", "not_said"),
    [
        (TimingPlan(rounds=1), ["in turn, in one round", "at least 20 ms"], ["rounds", "for this thread"]),
        (
            TimingPlan(rounds=5, clock="thread", shortest=0.5),
            ["in turn, in 5 rounds", "CPU time of this thread", "at least 500 ms"],
            ["in one round"],
        ),
    ],
)
def test_the_rules_say_how_this_campaign_takes_times(plan, said, not_said):
    rule = words.timing(plan)
    assert all(text in rule for text in said)
    assert not any(text in rule for text in not_said)


def test_without_a_reference_nothing_is_ranked(run):
    record = reading.records(run)[0]
    metrics = {k: v for k, v in record.result.metrics.items() if not k.startswith("position")}
    bare = msgspec.structs.replace(record, result=msgspec.structs.replace(record.result, metrics=metrics))
    said = words.summary([bare, bare])
    unknown = "o stored reference for this problem: positions are not compared"
    assert any(unknown in sentence for sentence in said)
    assert not any("follow the trajectory" in sentence for sentence in said)
    assert not any(sentence.startswith(("Smallest", "Fastest")) for sentence in said)


def test_where_the_reference_ends_early_it_is_compared_up_to_there(run):
    record = reading.records(run)[0]
    away = Value(why="the reference ends at t = 120; nothing was compared after it")
    said = []
    for error in (1e-9, 0.4):
        metrics = {**record.result.metrics, "position_end": away, "position_max": Value(value=error)}
        result = msgspec.structs.replace(record.result, metrics=metrics)
        said.append(msgspec.structs.replace(record, result=result))
    first, second, best = words.summary(said)
    assert first == "2 cases: 2 reach the end, where there is no reference solution."
    assert second == (
        "The reference ends at t = 120; nothing was compared after it. "
        "Up to there, 1 of 2 have a position error below 0.1."
    )
    assert best.startswith("Smallest position error up to there: ")
    assert "1.0e-09" in best


def test_of_an_ensemble_it_is_said_how_many_ends_are_known(run):
    record = reading.records(run)[0]
    case = msgspec.structs.replace(record.case, ensemble=Ensemble(count=100))
    record = msgspec.structs.replace(record, case=case)
    away = msgspec.structs.replace(record, result=msgspec.structs.replace(record.result, metrics={}))
    for one, said in ((record, True), (away, False)):
        assert ("the largest of 32 trajectories" in str(summary(Task.from_case(case), [one]))) == said


def test_times_taken_on_a_busy_machine_say_so(run):
    def said(others):
        timing = Timing(rounds=made_up_run.timed([1.0]), load=Load(others=others, steal=0.0))
        records = [msgspec.structs.replace(record, timing=timing) for record in reading.records(run)]
        return [sentence for sentence in words.summary(records) if "doubtful" in sentence]

    assert said(0.01) == []
    assert "used 60% of a core" in said(0.6)[0]
