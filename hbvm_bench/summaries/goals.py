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
from hbvm_bench.summaries.standings import SettingComparison
from hbvm_bench.summaries.table import NONE, Table

TIMES = ("warm_seconds", "throughput")
"""Metrics that only the timing pass has."""

PLACE = ("position", "phase", "observable_error")
"""With what the metrics begin that say where a run is, not only on which level of energy."""


@dataclass(frozen=True)
class Verdict:
    """A goal, what was measured, and whether that reaches it."""

    goal: Goal
    entry: ProblemEntry  # the problem it is judged on
    words: str  # what it is about
    asked: str
    measured: str
    # excluded: energies are compared without positions; not judged: the machine had other work
    verdict: Literal["reached", "missed", "excluded", "not judged"]
    why: str  # why nothing was measured, or why it is excluded or not judged
    comparison: SettingComparison  # the cases that decide; for a goal without a peer it has only ours

    @property
    def declared(self) -> str:
        """When it was declared, and whether that was after the first measurement."""
        if not self.goal.declared:
            return "not recorded"
        late = self.goal.measured and is_after(self.goal.declared, self.goal.measured)
        return self.goal.declared[:10] + ", after the first measurement" * bool(late)


def verdicts(campaign: Campaign, records: Sequence[Record]) -> list[Verdict]:
    """Return the verdict on every goal, problem by problem."""
    return [
        _judged(goal, entry, here)
        for entry, here in standings.entries(campaign, records)
        for goal in (standings.goals_of(campaign, entry) if here else ())
    ]


def table(judged: Sequence[Verdict]) -> Table:
    """Return the goals as a table."""
    return Table(
        "Goals",
        ("problem", "goal", "declared", "asked", "measured", "verdict"),
        [
            (
                standings.title_of(verdict.entry),
                verdict.words,
                verdict.declared,
                verdict.asked,
                verdict.measured,
                said(verdict),
            )
            for verdict in judged
        ],
        words=(0, 1, 2, 5),
    )


def said(verdict: Verdict) -> str:
    """Return the verdict, with the reason where there is one."""
    return f"{verdict.verdict}: {verdict.why}" if verdict.why else verdict.verdict


def is_after(date: str, other: str) -> bool:
    """Whether one date is after another; where one has no time of the day, by their days."""
    length = min(len(date), len(other))
    return date[:length] > other[:length]


def other_work(records: Sequence[Record | None], metric: str = standings.TIME) -> str:
    """Return why a speed of cases is not judged: the share of a core of other work; else ``""``."""
    timings = [item.timing for item in records if item is not None and item.timing is not None]
    loads = [item.load for item in timings if item.load is not None and metric in TIMES]
    busy = max(loads, key=lambda load: load.most).verdict() if loads else ""
    return f"{busy} during the timing" if busy else ""


def _judged(goal: Goal, entry: ProblemEntry, records: Sequence[Record]) -> Verdict:
    for key in (goal.metric, *goal.within, *goal.no_worse):
        find(key)
    if goal.ratio is not None:
        return _against(goal, entry, records, goal.ratio)
    assert goal.at is not None
    metric, able = METRICS[goal.metric], standings.among(records, goal.method)
    ours = standings.best(able, goal.within, goal.metric)
    reached = ours is not None and (number(ours, goal.metric) or 0.0) <= goal.at
    busy = other_work([ours], goal.metric)
    missing = (
        record.result.metrics[goal.metric].why for record in able if goal.metric in record.result.metrics
    )
    return Verdict(
        goal=goal,
        entry=entry,
        words=goal.words or f"{metric.label} of {goal.method or 'HBVM and Gauss'}",
        asked=f"≤ {goal.at:g}",
        measured=NONE if ours is None else format_metric(ours, goal.metric),
        verdict="not judged" if busy else "reached" if reached else "missed",
        why=next(missing, "") if ours is None else busy,
        comparison=SettingComparison(ours, None),
    )


def _against(goal: Goal, entry: ProblemEntry, records: Sequence[Record], ratio: float) -> Verdict:
    within = goal.within if goal.within or goal.no_worse else entry.within
    able = standings.among(records, goal.method), standings.among(records, goal.against)
    theirs = standings.best(able[1], within, goal.metric)
    comparison = SettingComparison(None, None)
    if theirs is not None:
        allowed = standings.no_worse(theirs, goal.no_worse)
        allowed |= {key: min(bound, allowed.get(key, bound)) for key, bound in within.items()}
        ours = standings.best(able[0], allowed, goal.metric)
        comparison = standings.compare(ours, theirs, goal.metric, chosen=max(map(len, able)) > 1)
    blind = not goal.alone and not any(key.startswith(PLACE) for key in (*within, *goal.no_worse))
    reached = comparison.ratio is not None and comparison.ratio.median >= ratio
    verdict, why = "reached" if reached else "missed", ""
    if blind:
        verdict, why = "excluded", "energy is not ranked without position"
    elif comparison.ratio is None:
        why = (
            "no setting of the other library is as accurate"
            if theirs is None
            else "no setting of HBVM and Gauss is as accurate"
        )
    elif busy := other_work([comparison.ours, comparison.theirs], goal.metric):
        verdict, why = "not judged", busy
    elif comparison.chosen_by_them:
        why = "from the rounds that chose the settings: there are no others"
    label = METRICS[goal.metric].label
    return Verdict(
        goal=goal,
        entry=entry,
        words=goal.words or f"{label} of {goal.against} relative to HBVM and Gauss, {_bounds(goal, within)}",
        asked=f"≥ {ratio:g}",
        measured=ratio_text(comparison.ratio),
        verdict=verdict,
        why=why,
        comparison=comparison,
    )


def _bounds(goal: Goal, within: dict[str, float]) -> str:
    said = [f"{METRICS[key].short} ≤ {bound:.0e}" for key, bound in within.items()]
    for key, factor in goal.no_worse.items():
        said.append(
            f"{METRICS[key].short} "
            + ("no worse" if factor == 1.0 else (f"≤ {factor:g}× that of the other library"))
        )
    return ", ".join(said) or "at any accuracy"


def ratio_text(ratio: Spread | None) -> str:
    """Write a ratio with its quartiles."""
    if ratio is None:
        return NONE
    spread = f" ({digits(ratio.low)}–{digits(ratio.high)})" if ratio.low and ratio.high else ""
    return f"{digits(ratio.median)}×{spread}"


def digits(value: float) -> str:
    """Write a ratio with three digits."""
    return f"{value:.0f}" if value >= 99.5 else f"{value:.1f}" if value >= 9.95 else f"{value:.2f}"


def as_data(judged: Sequence[Verdict]) -> list[dict[str, object]]:
    """Return the verdicts as plain data for JSON."""
    return [
        {"problem": name_of(verdict.entry), "words": verdict.words, "goal": msgspec.to_builtins(verdict.goal)}
        | {
            "declared": verdict.declared,
            "verdict": verdict.verdict,
            "why": verdict.why,
            "measured": verdict.measured,
            **_ratio_data(verdict.comparison),
        }
        for verdict in judged
    ]


def _ratio_data(comparison: SettingComparison) -> dict[str, object]:
    """Return a comparison as plain data for JSON."""
    low, high = (comparison.ratio.low, comparison.ratio.high) if comparison.ratio else (None, None)
    data: dict[str, object] = {
        "ratio": comparison.ratio and comparison.ratio.median,
        "low": low,
        "high": high,
    }
    for name, record in (("ours", comparison.ours), ("theirs", comparison.theirs)):
        data[name] = record.case.method if record else None
        data[f"{name}_seconds"] = number(record, standings.TIME) if record else None
    return data
