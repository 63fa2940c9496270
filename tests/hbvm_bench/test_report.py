"""The report says what the store says, whatever the names in it, and asks nothing of the network."""

import dataclasses
import re
from html.parser import HTMLParser

import msgspec
import numpy as np
import pytest

import problems
from hbvm_bench import reference
from hbvm_bench.campaign import Campaign, Case, Grid, MethodEntry
from hbvm_bench.identity import is_ours, resolve
from hbvm_bench.measure import measure
from hbvm_bench.metrics import GUARD_TOLERANCE, evaluate, guard_violation
from hbvm_bench.records import Compile, Record, Result, Timing, TimingRound
from hbvm_bench.report import words
from hbvm_bench.report.figures import BINS, envelope
from hbvm_bench.report.markdown import code, plain
from hbvm_bench.report.style import looks, panels
from hbvm_bench.report.write import write_report
from hbvm_bench.store import Index, Store
from integrators.integrate import Solution
from integrators.protocol import Stats, Status
from problems.errors import InputError

HOSTILE = '<script>alert("1")</script> | `code` *bold* \\ [x](javascript:1) ' + "very long " * 50 + "\n# head"
METHODS = (
    "HBVM(k=16, s=8, h=0.125)",
    "HBVM(k=18, s=2, h=0.5)",
    'IAS15(mode="global")',
    "IAS15()",
    "Leapfrog(h=0.02, order=8)",
    "Radau(rtol=1e-6, atol=1e-8)",
)


def made_up(method, number):
    """Return a record with the reference's own states, spoilt in a way that depends on the method."""
    problem = problems.load("sitnikov")
    known = reference.find(problem)
    assert known is not None
    resolved = resolve(Case(problem="sitnikov()", method=method))
    stalled, lost = method == "IAS15()", method.startswith("Radau")
    t = known.t[:3] if stalled else known.t
    y = known.high[: t.size].copy()
    y[1:, 0] += 1e-11 * 10.0**number
    y[1:, 7] = 3.0 if lost else 0.0
    status = Status.STALLED if stalled else Status.FINISHED
    history = np.array([[0.0, 1e-1], [8.0, 1e-9], [8.5, 1e-20]])
    stats = Stats(steps=100, evaluations=None, extra={"dt_history": history} if stalled else {})
    solution = Solution(
        t=t,
        y=y,
        status=status,
        reason="",
        t_stop=float(t[-1]),
        stats=stats,
        compile_seconds=0.1,
        from_cache=False,
        problem=problem,
        method=resolved.method,
    )
    measured = measure(solution, known)
    rounds = [
        TimingRound(samples=[0.01 * (number + 1), 0.02], repeats=2, compile=Compile(seconds=0.1, cached=True))
    ]
    timing = None if stalled else Timing(rounds=rounds)
    measured = dataclasses.replace(measured, timing=timing)
    result = Result(
        outcome="stalled" if stalled else "ok",
        status=status.value,
        reason=HOSTILE if stalled else "",
        t_stop=float(t[-1]),
        violation=guard_violation(measured),
        counters=measured.counters,
        metrics=evaluate(measured),
        compile=measured.compile,
    )
    record = Record(
        id=resolved.id, case=resolved.case, role="ours" if is_ours(resolved.method) else "peer",
        library=resolved.method.library, order=None, result=result, timing=timing,
        versions={"python": "3"}, machine={"cores": 2}, finished="2026-11-21T10:00:00+00:00",
    )  # fmt: skip
    return record, measured.series()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    store = Store(tmp_path_factory.mktemp("run"))
    store.prepare()
    ids = []
    for number, method in enumerate(METHODS):
        record, series = made_up(method, number)
        store.save(record, series)
        ids.append(record.id)
    notes = {4: HOSTILE}
    campaign = Campaign(
        name="x",
        title=HOSTILE,
        description=HOSTILE,
        problems=["sitnikov()"],
        methods=[MethodEntry(use=method, note=notes.get(n, "")) for n, method in enumerate(METHODS)],
        grid=Grid(step=25.0),
    )
    store.write_index(Index(campaign=campaign, ids=ids, version="0", command=f"hbvm-bench run {HOSTILE}"))
    return store


@pytest.fixture(scope="module")
def written(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write_report(run, folder)
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
            relative = target.startswith(("#", "figures/", "data/"))
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
    assert reader.tags.count("script") == 3  # the page's own, its data, the packed plotting library
    outside = re.sub(r"<script[ >].*?</script>", "", text, flags=re.DOTALL)
    assert "<script>alert" not in text
    assert "alert(" not in outside.replace("&lt;script&gt;alert(", "")
    assert "&lt;script&gt;alert" in text


def test_the_page_asks_nothing_of_the_network(page):
    text, reader = page
    assert reader.requests == []
    assert "@import" not in text
    ours = text[: text.index('id="library"')]
    assert re.findall(r"url\((?!#)", ours) == []
    assert set(re.findall(r"https?://([\w.]+)", ours)) <= {"www.w3.org"}
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
        "step-sizes",
    }
    for key in figures:
        assert {f"{key}-title", f"{key}-desc"} <= set(reader.ids)
        assert (written / "figures" / f"{key}.svg").read_text().startswith("<svg")
        assert (written / "figures" / f"{key}.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((written / "figures").iterdir())) == 2 * len(figures)


def test_the_same_store_gives_the_same_bytes(run, written, tmp_path):
    write_report(run, tmp_path)
    for path in written.rglob("*.*"):
        assert (tmp_path / path.relative_to(written)).read_bytes() == path.read_bytes(), path.name


def test_colours_of_the_page_are_variables_of_both_themes(page):
    text, _ = page
    assert "var(--m1)" in text
    used = set(re.findall(r"var\((--[\w]+)\)", text))
    light = set(re.findall(r"(--[\w]+):", text.split("</style>")[0].split("}", 1)[0]))
    dark = set(re.findall(r"(--[\w]+):", text.split(":root[data-theme=dark]{", 1)[1].split("}", 1)[0]))
    assert light == dark
    assert {f"--m{n}" for n in range(1, len(METHODS) + 1)} | {"--ink", "--paper"} <= light
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
    (row,) = [line for line in text.splitlines() if "`Radau(" in line and line.startswith("| ")]
    cells = [cell.strip() for cell in row.split("|")]
    assert "3.0e+00" in cells  # the guard itself
    assert sum(cell.startswith("(") for cell in cells) >= 4
    best = [sentence for sentence in words.summary(run.records()) if sentence.startswith("Smallest")]
    assert "Radau" not in best[0]
    assert best[0].index("HBVM(k=16") < best[0].index("HBVM(k=18")


def test_a_peer_that_wins_is_named_first(run):
    records = run.records()
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
    records = run.records()
    values = records[1].result.metrics
    worse = {"position_end": 4.7, "z_error": 1.8, "angular_momentum_max": 3.4e-3, "energy_max": 3.2e-14}
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
        "z wrong by 1.8",
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
        assert {(record.case.note, record.case.settings) for record in run.records()} == {("new", "default")}
    finally:
        run.write_index(index)


def test_a_report_without_a_finished_case_writes_nothing(tmp_path):
    store = Store(tmp_path / "run")
    store.prepare()
    campaign = Campaign(name="x", problems=["p()"], methods=[MethodEntry(use="m()")])
    store.write_index(Index(campaign=campaign, ids=["0" * 64], version="0", command="hbvm-bench run x"))
    with pytest.raises(InputError, match="has finished"):
        write_report(store, tmp_path / "report")
    assert not (tmp_path / "report").exists()


def test_cases_look_different_from_each_other(run):
    made = looks(run.records())
    assert len({look.light for look in made.values()}) == len(METHODS)
    assert [look.number for look in made.values()] == list(range(1, len(METHODS) + 1))


def test_panels_hold_all_cases_and_few_each(run):
    records = run.records()
    grouped = panels(records * 3)
    assert sum(len(members) for _, members in grouped) == 3 * len(records)
    assert ("IAS15 · rebound" in dict(grouped)) == (
        len([r for r in records if r.library == "rebound"]) * 3 > 6
    )


def test_an_envelope_keeps_the_largest_values():
    t = np.linspace(0, 1, 5000)
    values = np.abs(np.sin(40 * t)) * t
    thin_t, thin = envelope(t, values)
    assert thin.size <= BINS
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


def test_without_a_reference_nothing_is_ranked(run):
    record = run.records()[0]
    metrics = {k: v for k, v in record.result.metrics.items() if not k.startswith("position")}
    bare = msgspec.structs.replace(record, result=msgspec.structs.replace(record.result, metrics=metrics))
    said = words.summary([bare, bare])
    assert any("no stored reference" in sentence for sentence in said)
    assert not any(sentence.startswith(("Smallest", "Fastest")) for sentence in said)


def test_times_taken_on_a_busy_machine_say_so(run):
    def with_share(record, share):
        if record.timing is None:
            return record
        rounds = [msgspec.structs.replace(one, share=share) for one in record.timing.rounds]
        return msgspec.structs.replace(record, timing=Timing(rounds=rounds))

    def said(share):
        return [s for s in words.summary([with_share(r, share) for r in run.records()]) if "disturbed" in s]

    assert said(0.99) == []
    assert "60% of a core" in said(0.6)[0]
