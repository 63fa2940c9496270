"""The report of `automatic`, from stored results alone."""

from collections.abc import Mapping, Sequence
from functools import partial

from hbvm_bench.measure import machine
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.report.document import Block, Document, Files, Note, Section, attempt
from hbvm_bench.store.kept import Kept
from hbvm_bench.studies.automatic.runs import Duel, duels
from hbvm_bench.summaries import fairness
from hbvm_bench.summaries.rows import format_metric
from hbvm_bench.summaries.table import Table

METRICS = ("warm_seconds", "steps", "energy_max", "position_mean")


def document(results: Mapping[str, Sequence[Kept]]) -> Document:
    """Return the report: the ratios by kind of processor, then each kind's numbers."""
    return Document(
        "HBVM() against heyoka's Taylor method",
        [
            "HBVM() chooses k, s and its steps by itself; heyoka's Taylor method likewise has no step to "
            "set. The ratio is the Taylor method's time over ours within each round, of one core's time, "
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


def _run(run: Kept) -> list[Block]:
    libraries = ", ".join(f"{name} {number}" for name, number in run.versions.items())
    return [
        Note(" ".join([machine.sentence(run.machine), *fairness.beside(run.records)])),
        *attempt(("errors and times", partial(sides, duels(run)))),
        f"Measured on {run.started[:10]} with {libraries}: `{run.command}`",
    ]


def ratios(results: Mapping[str, Sequence[Kept]]) -> Table:
    """Return how many times as long the Taylor method takes, one column for each kind of processor."""
    by_problem = {
        kind: {duel.problem: duel for run in runs for duel in duels(run)} for kind, runs in results.items()
    }
    rows = []
    for key in dict.fromkeys(key for found in by_problem.values() for key in found):
        of_kind = [found.get(key) for found in by_problem.values()]
        known = [duel for duel in of_kind if duel is not None]
        goals = dict.fromkeys(duel.goal for duel in known)
        settings = dict.fromkeys(duel.theirs.case.method for duel in known)
        rows.append((key, " or ".join(settings), " or ".join(goals), *map(_cell, of_kind)))
    return Table(
        "How many times as long as HBVM() the Taylor method takes",
        ("problem", "against", "goal", *results),
        rows,
        "The median of the ratio within each round, and whether it reaches the goal declared before; not as "
        "accurate: one of our errors is larger than the Taylor method's. " + machine.COLUMNS,
        words=(0, 1),
    )


def _cell(duel: Duel | None) -> str:
    if duel is None:
        return "not run"
    return duel.words if duel.ratio is None else f"{duel.ratio.median:.2f}× {duel.words}".strip()


def sides(found: Sequence[Duel]) -> Table:
    """Return both sides' errors and times."""
    rows = []
    for duel in found:
        ratio = duel.ratio
        for first, side in ((True, duel.ours), (False, duel.theirs)):
            spread = ratio is not None and ratio.low is not None and f"{ratio.low:.2f} … {ratio.high:.2f}"
            rows.append(
                (
                    duel.problem if first else "",
                    duel.goal if first else duel.words,
                    f"{ratio.median:.2f}" if first and ratio is not None else "",
                    spread if first and spread else "",
                    side.case.method,
                    *(format_metric(side, key) for key in METRICS),
                )
            )
    return Table(
        "Errors and times",
        ("problem", "goal", "Taylor / HBVM", "quartiles", "method", "time", "steps", "energy", "position"),
        rows,
        words=(0, 4),
    )
