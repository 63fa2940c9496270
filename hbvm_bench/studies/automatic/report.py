"""The report of `automatic`, from stored results alone."""

from collections.abc import Mapping, Sequence
from functools import partial
from statistics import median

from hbvm_bench.measure import machine
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.report.document import Block, Document, Files, Note, Section, attempt
from hbvm_bench.studies.automatic.runs import GOALS, THEIRS, Duel, Result
from hbvm_bench.summaries.table import Table


def document(results: Mapping[str, Sequence[Result]]) -> Document:
    """Return the report: the ratios by kind of processor, then each kind's numbers."""
    return Document(
        "HBVM() against heyoka's Taylor method",
        [
            f"HBVM() chooses k, s and its steps by itself; heyoka's `{THEIRS}` likewise has no step to set. "
            "The ratio is the Taylor method's time over ours within each round, of one core's time, "
            "alternating: the median over the rounds.",
        ],
        [
            Note(POSITION + " Here: the geometric mean over ten such times."),
            *attempt(("the ratios", partial(ratios, results))),
            *(
                Section(
                    kind,
                    [block for run in runs for block in _run(run)],
                    key=kind,
                    nav=kind,
                )
                for kind, runs in results.items()
            ),
            Section(
                "Raw data",
                [Files("With all timing samples", {f"{kind}.json": None for kind in results})],
                "data-files",
                nav="Data",
            ),
        ],
    )


def _run(run: Result) -> list[Block]:
    libraries = ", ".join(f"{name} {number}" for name, number in run.versions.items())
    return [
        Note(machine.sentence(run.machine)),
        *attempt(("errors and times", partial(sides, run.duels))),
        f"Measured on {run.started[:10]} with {libraries}: `{run.command}`",
    ]


def ratios(results: Mapping[str, Sequence[Result]]) -> Table:
    """Return how many times as long the Taylor method takes, one column for each kind of processor."""
    rows = []
    for key in GOALS:
        found = [
            next((duel for run in runs for duel in run.duels if duel.problem == key), None)
            for runs in results.values()
        ]
        duels = [duel for duel in found if duel is not None]
        if duels:
            goals = dict.fromkeys(f"≥ {duel.goal:g}" for duel in duels)
            settings = dict.fromkeys(duel.theirs.method for duel in duels)
            cells = ("not run" if one is None else f"{one.ratio.median:.2f}× {one.verdict}" for one in found)
            rows.append((key, " or ".join(settings), " or ".join(goals), *cells))
    return Table(
        "How many times as long as HBVM() the Taylor method takes",
        ("problem", "against", "goal", *results),
        rows,
        "The median of the ratio within each round, and whether it reaches the goal declared before; not as "
        "accurate: one of our errors is larger than the Taylor method's. " + machine.COLUMNS,
        words=(0, 1),
    )


def sides(found: Sequence[Duel]) -> Table:
    """Return both sides' errors and times."""
    rows = []
    for duel in found:
        ratio = duel.ratio
        for first, side in ((True, duel.ours), (False, duel.theirs)):
            rows.append(
                (
                    duel.problem if first else "",
                    f"≥ {duel.goal:g}" if first else duel.verdict,
                    f"{ratio.median:.2f}" if first else "",
                    f"{ratio.low:.2f} … {ratio.high:.2f}" if first else "",
                    side.method,
                    f"{1e3 * median(side.seconds):.3g} ms",
                    str(side.steps),
                    f"{side.energy:.1e}",
                    f"{side.position:.1e}",
                )
            )
    return Table(
        "Errors and times",
        ("problem", "goal", "Taylor / HBVM", "quartiles", "method", "time", "steps", "energy", "position"),
        rows,
        words=(0, 4),
    )
