"""What a campaign asked for before it was run, what was measured, and whether that reaches it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import msgspec

from hbvm_bench.campaign.file import Campaign, Goal, ProblemEntry, name_of
from hbvm_bench.measure.metrics import METRICS, find
from hbvm_bench.measure.timing import Spread
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.points import number
from hbvm_bench.summaries.rows import format_metric
from hbvm_bench.summaries.standings import Comparison
from hbvm_bench.summaries.table import NONE, Table

PLACE = ("position", "phase", "z_error")
"""With what the metrics begin that say where a run is, not only on which level of energy."""


@dataclass(frozen=True)
class Verdict:
    """A goal, what was measured, and whether that reaches it."""

    goal: Goal
    entry: ProblemEntry  # the problem it is judged on
    words: str  # what it is about
    asked: str
    measured: str
    verdict: Literal["reached", "missed", "void"]  # void: energies are compared without positions
    why: str  # why nothing was measured, or why it is void
    comparison: Comparison  # the cases that decide; for a goal without a peer it has only ours
    records: Sequence[Record]  # of all cases on the problem

    @property
    def reached(self) -> bool:
        """Whether it is."""
        return self.verdict == "reached"


def verdicts(campaign: Campaign, records: Sequence[Record]) -> list[Verdict]:
    """Return the verdict on every goal, problem by problem.

    Raises
    ------
    problems.errors.UnknownNameError
        For a metric that there is not.
    """
    return [
        _judged(goal, entry, here)
        for entry, here in standings.entries(campaign, records)
        for goal in campaign.goals
        if here and name_of(entry) in (goal.only or [name_of(entry)])
    ]


def table(found: Sequence[Verdict]) -> Table:
    """Return the goals as a table."""
    return Table(
        "Goals declared before the run",
        ("problem", "goal", "asked", "measured", "verdict"),
        [(standings.title_of(one.entry), one.words, one.asked, one.measured, said(one)) for one in found],
        words=(0, 1, 4),
    )


def said(found: Verdict) -> str:
    """Return the verdict, with the reason where there is one."""
    return f"{found.verdict}: {found.why}" if found.why else found.verdict


def _judged(goal: Goal, entry: ProblemEntry, records: Sequence[Record]) -> Verdict:
    for key in (goal.metric, *goal.within, *goal.no_worse):
        find(key)
    if goal.ratio is not None:
        return _against(goal, entry, records, goal.ratio)
    assert goal.at is not None
    metric, able = METRICS[goal.metric], standings.among(records, goal.method)
    ours = standings.best(able, goal.within, goal.metric)
    reached = ours is not None and (number(ours, goal.metric) or 0.0) <= goal.at
    missing = (one.result.metrics[goal.metric].why for one in able if goal.metric in one.result.metrics)
    return Verdict(
        goal=goal,
        entry=entry,
        words=goal.words or f"{metric.label} of {goal.method or 'ours'}",
        asked=f"≤ {goal.at:g}",
        measured=NONE if ours is None else format_metric(ours, goal.metric),
        verdict="reached" if reached else "missed",
        why=next(missing, "") if ours is None else "",
        comparison=Comparison(ours, None),
        records=records,
    )


def _against(goal: Goal, entry: ProblemEntry, records: Sequence[Record], ratio: float) -> Verdict:
    within = goal.within if goal.within or goal.no_worse else entry.within
    theirs = standings.best(standings.among(records, goal.against), within, goal.metric)
    found = Comparison(None, None)
    if theirs is not None:
        allowed = standings.no_worse(theirs, goal.no_worse)
        allowed |= {key: min(bound, allowed.get(key, bound)) for key, bound in within.items()}
        ours = standings.best(standings.among(records, goal.method), allowed, goal.metric)
        found = standings.compare(ours, theirs, goal.metric)
    blind = not goal.alone and not any(key.startswith(PLACE) for key in (*within, *goal.no_worse))
    reached = found.ratio is not None and found.ratio.median >= ratio
    why = ""
    if blind:
        why = "energy is not ranked without position"
    elif found.ratio is None:
        why = "the peer has no setting as accurate" if theirs is None else "none of ours is as accurate"
    label = METRICS[goal.metric].label
    return Verdict(
        goal=goal,
        entry=entry,
        words=goal.words or f"{label} of {goal.against} over ours, {_bounds(goal, within)}",
        asked=f"≥ {ratio:g}",
        measured=ratio_text(found.ratio),
        verdict="void" if blind else "reached" if reached else "missed",
        why=why,
        comparison=found,
        records=records,
    )


def _bounds(goal: Goal, within: dict[str, float]) -> str:
    said = [f"{METRICS[key].short} ≤ {bound:.0e}" for key, bound in within.items()]
    for key, factor in goal.no_worse.items():
        said.append(f"{METRICS[key].short} " + ("no worse" if factor == 1.0 else f"≤ {factor:g}× theirs"))
    return ", ".join(said) or "at any accuracy"


def ratio_text(ratio: Spread | None) -> str:
    """Write a ratio with its quartiles."""
    if ratio is None:
        return NONE
    spread = f" ({_number(ratio.low)}–{_number(ratio.high)})" if ratio.low and ratio.high else ""
    return f"{_number(ratio.median)}×{spread}"


def _number(value: float) -> str:
    return f"{value:.0f}" if value >= 99.5 else f"{value:.1f}" if value >= 9.95 else f"{value:.2f}"


def as_data(found: Sequence[Verdict]) -> list[dict[str, object]]:
    """Return the verdicts as plain data for JSON."""
    return [
        {"problem": name_of(one.entry), "words": one.words, "goal": msgspec.to_builtins(one.goal)}
        | {"verdict": one.verdict, "why": one.why, "measured": one.measured, **ratio_data(one.comparison)}
        for one in found
    ]


def ratio_data(found: Comparison) -> dict[str, object]:
    """Return a comparison as plain data for JSON."""
    low, high = (found.ratio.low, found.ratio.high) if found.ratio else (None, None)
    data: dict[str, object] = {"ratio": found.ratio and found.ratio.median, "low": low, "high": high}
    for name, record in (("ours", found.ours), ("theirs", found.theirs)):
        data[name] = record.case.method if record else None
        data[f"{name}_seconds"] = number(record, standings.TIME) if record else None
    return data
