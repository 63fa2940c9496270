"""HBVM with default settings against heyoka's Taylor method."""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hbvm_bench.campaign.file import Campaign, load
from hbvm_bench.campaign.shorter import chosen, with_rounds
from hbvm_bench.measure import machine
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.measure.timing import Spread
from hbvm_bench.report.document import Block, Note, Section, attempt
from hbvm_bench.report.figures.canvas import Picture, new, picture, styled
from hbvm_bench.report.figures.style import INK, MUTED, PAPER, base
from hbvm_bench.report.page import Results
from hbvm_bench.store.records import Record
from hbvm_bench.store.stored_run import StoredRun
from hbvm_bench.summaries import compilations, outcomes, standings
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
class HeadToHead:
    """The comparison of `HBVM()` with the Taylor method on one problem, with its goal, if there is one.

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
                (status_of(record) for record in (self.ours, self.theirs) if not record.timing),
                "not compared",
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


def head_to_heads(run: StoredRun) -> list[HeadToHead]:
    """Return the comparison on each problem."""
    campaign, result = run.index.campaign, []
    judged = {verdict.entry.use: verdict for verdict in verdicts(campaign, run.records)}
    for entry, records in standings.entries(campaign, run.records):
        ours, theirs = standings.among(records, ""), standings.among(records, AGAINST)
        if ours and theirs:
            result.append(HeadToHead(judged.get(entry.use), ours[0], theirs[0]))
    return result


METRICS = ("warm_seconds", "steps", "energy_max", "position_mean")


def errors_are(results: Results) -> Note:
    """Return what a position error is here."""
    del results
    return Note(
        f"{POSITION} Here: the geometric mean over ten such times. One setting of each library is compared, "
        "the same on all problems. Neither is the fastest of its library: the Taylor method is faster with "
        "fast_math=True or a larger tolerance. The race compares many settings of both."
    )


def ratios_by_kind(results: Results) -> list[Block]:
    """Return the ratios as a figure and as a table, one column for each kind of processor."""
    drawn = attempt(("the ratios", partial(ratios_drawn, results.by_processor)))
    return [*drawn, ratios(results.by_processor)]


def kinds(results: Results) -> list[Section]:
    """Return the numbers of each kind of processor."""
    return [
        Section(kind, [part for run in runs for part in _run(run)], key=kind, nav=kind)
        for kind, runs in results.by_processor.items()
    ]


def _run(run: StoredRun) -> list[Block]:
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
        *attempt(
            ("errors and times", partial(sides, head_to_heads(run))),
            ("the compilations", partial(compilations.table, run.index.campaign, run.records)),
        ),
        f"Measured on {run.started[:10]} with {libraries}: `{run.command}`",
    ]


def ratios(results: Mapping[str, Sequence[StoredRun]]) -> Table:
    """Return how many times as long the Taylor method takes, one column for each kind of processor."""
    by_problem = {
        kind: {pair.problem: pair for run in runs for pair in head_to_heads(run)}
        for kind, runs in results.items()
    }
    rows = []
    for key in dict.fromkeys(key for pairs_of in by_problem.values() for key in pairs_of):
        of_kind = [pairs_of.get(key) for pairs_of in by_problem.values()]
        known = [pair for pair in of_kind if pair is not None]
        goals = dict.fromkeys(pair.goal for pair in known)
        settings = dict.fromkeys(pair.theirs.case.method for pair in known)
        rows.append((key, " or ".join(settings), " or ".join(goals), *map(_cell, of_kind)))
    return Table(
        "Time of the Taylor method relative to HBVM()",
        ("problem", "against", "goal", *results),
        rows,
        "The median of the ratio within each round, and whether it reaches the goal declared before; less "
        "accurate: an error of HBVM() is larger than that of the Taylor method. " + machine.COLUMNS,
        words=(0, 1),
    )


@styled
def ratios_drawn(results: Mapping[str, Sequence[StoredRun]]) -> Picture:
    """Draw the ratios, a line for each problem, with the goals."""
    pairs_of = {kind: [pair for run in runs for pair in head_to_heads(run)] for kind, runs in results.items()}
    problems = list(dict.fromkeys(pair.problem for members in pairs_of.values() for pair in members))
    height = {problem: len(problems) - i for i, problem in enumerate(problems)}
    figure = new(8.6, 0.9 + 0.36 * len(problems))
    axes = figure.add_axes((0.36, 0.6 / figure.get_figheight(), 0.6, 1 - 0.95 / figure.get_figheight()))
    axes.set_xscale("log")
    said, handles = [], []
    for number, (kind, members) in enumerate(pairs_of.items(), 1):
        shade, marker = base("HBVM")[0], "os^D"[(number - 1) % 4]
        known = [pair for pair in members if pair.ratio is not None]
        x = np.array([pair.ratio.median for pair in known if pair.ratio is not None])
        y = np.array([float(height[pair.problem]) for pair in known])
        for pair, at, up in zip(known, x, y, strict=True):
            face = PAPER if pair.words == "less accurate" else shade
            look = {"color": shade, "markerfacecolor": face, "markersize": 6}
            axes.plot([at], [up], marker, label=f"{pair.problem}, {kind}", **look)
            said.append(f"{pair.problem}, {kind}: {at:.2f}")
        handles += axes.plot([], [], marker, color=shade, label=kind, linestyle="")
        for pair in members:
            goal = pair.verdict.goal.ratio if pair.verdict is not None else None
            if goal is not None:
                axes.plot([goal], [height[pair.problem]], "|", color=INK, markersize=13)
    handles += axes.plot([], [], "|", color=INK, label="goal", linestyle="")
    axes.axvline(1.0, color=MUTED, linewidth=0.9)
    ticks = [value for value in (0.5, 1.0, 2.0, 4.0, 8.0, 16.0) if value <= 2 * axes.get_xlim()[1]]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    named = ["\n".join(textwrap.wrap(problem, 44, break_on_hyphens=False)) for problem in problems]
    axes.set_yticks([height[problem] for problem in problems], named)
    axes.set_ylim(0.4, len(problems) + 0.6)
    axes.set_xlabel("time of the Taylor method relative to HBVM()")
    figure.legend(handles=handles, loc="upper right", ncols=len(pairs_of) + 1, fontsize=7)
    return picture(
        figure,
        "ratios",
        "Time of the Taylor method relative to HBVM()",
        "To the right of the line at 1 HBVM() is faster. A filled marker compares runs in which HBVM() is no "
        "less accurate in energy and position, an open one runs in which it is in one of them. A vertical "
        "bar is the goal that was declared before.",
        "; ".join(said) + ".",
    )


def _cell(pair: HeadToHead | None) -> str:
    if pair is None:
        return "not run"
    return pair.words if pair.ratio is None else f"{pair.ratio.median:.2f}× {pair.words}".strip()


def sides(pairs_: Sequence[HeadToHead]) -> Table:
    """Return both sides' errors and times."""
    rows = []
    for pair in pairs_:
        ratio = pair.ratio
        for first, side in ((True, pair.ours), (False, pair.theirs)):
            spread = ratio is not None and ratio.low is not None and f"{ratio.low:.2f} … {ratio.high:.2f}"
            rows.append(
                (
                    pair.problem if first else "",
                    pair.goal if first else pair.words,
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
