"""HBVM that chooses everything itself against heyoka's Taylor method: no setting on our side."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from hbvm_bench.campaign.file import Campaign, load
from hbvm_bench.campaign.shorter import chosen, with_rounds
from hbvm_bench.measure import machine
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.measure.timing import Spread
from hbvm_bench.report.document import Block, Note, Section, attempt
from hbvm_bench.report.page import Results, block
from hbvm_bench.store.kept import Kept
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import outcomes, standings
from hbvm_bench.summaries.goals import Verdict, verdicts
from hbvm_bench.summaries.points import accurate
from hbvm_bench.summaries.rows import format_metric, status_of
from hbvm_bench.summaries.table import NONE, Table
from problems.errors import InputError

NAME = "automatic"
AGAINST = "Taylor"
NO_WORSE = {"energy_max": 1.0, "position_mean": 1.0}
"""Our errors are at most so many times theirs where a ratio is compared."""


@dataclass(frozen=True)
class Duel:
    """What came out on one problem, against the goal on it, where there is one.

    Attributes
    ----------
    verdict : Verdict or None
        On the goal; ``None`` where none was declared.
    ours, theirs : Record
        Both cases, whether they are as accurate as was asked for or not.
    """

    verdict: Verdict | None
    ours: Record
    theirs: Record

    @property
    def problem(self) -> str:
        """The problem, as the campaign writes it."""
        return self.theirs.case.problem

    @property
    def goal(self) -> str:
        """How many times as long the Taylor method should take."""
        return NONE if self.verdict is None else self.verdict.asked

    @property
    def ratio(self) -> Spread | None:
        """The Taylor method's time relative to HBVM() within each round."""
        return standings.compare(self.ours, self.theirs).ratio

    @property
    def words(self) -> str:
        """``reached``, ``missed``, ``less accurate``, or why there is no ratio; ``""`` without a goal."""
        if self.ratio is None:
            return next(
                (status_of(one) for one in (self.ours, self.theirs) if not one.timing), "not compared"
            )
        if not accurate(self.ours, standings.no_worse(self.theirs, NO_WORSE)):
            return "less accurate"
        return "" if self.verdict is None else self.verdict.verdict


def campaign(names: Sequence[str], rounds: int | None = None) -> Campaign:
    """Return the campaign, or a part of it.

    Raises
    ------
    problems.errors.InputError
        For an unknown name, or fewer than two rounds.
    """
    if rounds is not None and rounds < 2:
        raise InputError(f"rounds must be at least 2, not {rounds}.")
    return with_rounds(chosen(load(NAME), list(names)), rounds)


def duels(run: Kept) -> list[Duel]:
    """Return what came out, problem by problem."""
    campaign, found = run.index.campaign, []
    judged = {verdict.entry.use: verdict for verdict in verdicts(campaign, run.records)}
    for entry, records in standings.entries(campaign, run.records):
        ours, theirs = standings.among(records, ""), standings.among(records, AGAINST)
        if ours and theirs:
            found.append(Duel(judged.get(entry.use), ours[0], theirs[0]))
    return found


METRICS = ("warm_seconds", "steps", "energy_max", "position_mean")


@block
def errors_are(results: Results) -> Note:
    """Return what a position error is here."""
    del results
    return Note(
        f"{POSITION} Here: the geometric mean over ten such times. One setting of each library is compared, "
        "the same on all problems. Neither is the fastest of its library: the Taylor method is faster with "
        "fast_math=True or a larger tolerance. The race compares many settings of both."
    )


@block
def ratios_by_kind(results: Results) -> Table:
    """Return the ratios, one column for each kind of processor."""
    return ratios(results.by_processor)


@block
def kinds(results: Results) -> list[Section]:
    """Return the numbers of each kind of processor."""
    return [
        Section(kind, [one for run in runs for one in _run(run)], key=kind, nav=kind)
        for kind, runs in results.by_processor.items()
    ]


def _run(run: Kept) -> list[Block]:
    libraries = ", ".join(f"{name} {number}" for name, number in run.versions.items())
    return [
        Note(
            " ".join(
                [
                    machine.sentence(run.machine),
                    *outcomes.compilations(run.records),
                    *outcomes.beside(run.records),
                ]
            )
        ),
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
        "Time of the Taylor method relative to HBVM()",
        ("problem", "against", "goal", *results),
        rows,
        "The median of the ratio within each round, and whether it reaches the goal declared before; less "
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
