"""Which integrator for which need, in rows of text.

A need is an accuracy and a number to be small. On every problem the settings that reach the
accuracy are compared, and each family stands for its best; families are then ordered by on
how many problems they come near the best, and among equals by how far they are from it
in the median.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from statistics import median
from typing import NamedTuple

from hbvm_bench.store.records import ErrorGrowth, Record
from hbvm_bench.summaries.growth import clear
from hbvm_bench.summaries.points import accurate, by_family, by_problem, family_of, number, work_of
from hbvm_bench.summaries.table import Table

SHOWN = 3  # families
NEAR, NEAR_ERROR, NEAR_MEMORY = 2.0, 10.0, 1.25  # factors to the best cost that count as near it
_WORSE = {"warm_seconds": "slower", "evaluations": "more", "peak_memory": "more"}
ROUND_OFF = 1e-15  # an error below this is as good as any other


class Need(NamedTuple):
    """A requirement: an accuracy and a cost to be small."""

    title: str
    serves: Callable[[Record], bool]
    cost: str  # key of the metric that is then to be small
    near: float = NEAR  # up to this factor a cost counts as near the best
    floor: float = 0.0  # costs below it are equal


def table(records: Sequence[Record]) -> Table | None:
    """Return which families serve which need best; ``None`` where the run has data for none."""
    rows: list[tuple[str, ...]] = []
    for need in needs(records):
        behind = factors(records, need)
        problems = len(next(iter(behind.values()), ()))
        near = {family: sum(factor <= need.near for factor in values) for family, values in behind.items()}
        typical = {family: median(filter(math.isfinite, values)) for family, values in behind.items()}
        first = sorted(behind, key=lambda family: (-near[family], typical[family]))[:SHOWN]
        said = [
            f"{family} ({near[family]} of {_ran(behind[family])}"
            + (
                f", {typical[family]:.3g}× {_WORSE.get(need.cost, 'larger')})"
                if typical[family] > 1.005
                else ")"
            )
            for family in first
        ]
        rows += [(need.title, "; ".join(said), str(problems))] if said else []
    if not rows:
        return None
    head = ("need", "first choices", "problems")
    note = (
        f"In brackets: on how many of the problems that it ran on its result is within a factor of {NEAR:g} "
        f"of the best one ({NEAR_ERROR:g} for errors, {NEAR_MEMORY:g} for memory), and its median factor to "
        "it."
    )
    return Table("Which integrator for which need", head, rows, note, words=(0, 1))


def needs(records: Sequence[Record]) -> list[Need]:
    """Return the needs, with the measure of work that the run has."""
    work = work_of(records)
    cheaply = (
        "least time"
        if work == "warm_seconds"
        else "fewest evaluations (methods that do not count them are left out)"
    )
    small = partial(Need, near=NEAR_ERROR, floor=ROUND_OFF)
    right, right_8 = _within(position_end=1e-4), _within(position_end=1e-8)
    exact, there = _within(position_end=1e-8, energy_max=1e-13), _within(position_end=1.0)
    return [
        Need(f"position error ≤ 1e-4, {cheaply}", right, work),
        Need(f"position error ≤ 1e-8, {cheaply}", right_8, work),
        Need(f"position error ≤ 1e-8 and energy error ≤ 1e-13, {cheaply}", exact, work),
        small("smallest position error at the end", there, "position_end"),
        small("smallest phase error at the end", there, "phase_end"),
        small("smallest energy error, with position error ≤ 1e-4", right, "energy_max"),
        small("smallest error of other invariants, with position error ≤ 1e-4", right, "invariants_max"),
        small("smallest energy error among those bounded or growing as t^1/2", _without_drift, "energy_max"),
        small("smallest time-reversal error", _within(), "reversal"),
        Need("least memory", _within(), "peak_memory", NEAR_MEMORY),
    ]


def factors(records: Sequence[Record], need: Need) -> Mapping[str, list[float]]:
    """Return each family's cost over the best one's, problem by problem that any family serves.

    Infinite where it does not serve, and NaN where it did not run, or has no such cost (a Taylor method
    counts no evaluations); families that serve nowhere are left out.
    """
    served: list[dict[str, float]] = []
    families: dict[str, None] = {}
    for here in by_problem(records).values():
        costs: dict[str, float] = {}
        families |= dict.fromkeys(map(family_of, here))
        for family, members in by_family(here).items():
            able = [record for record in members if need.serves(record)]
            known = [cost for record in able if (cost := number(record, need.cost)) is not None]
            if known:
                costs[family] = max(min(known), need.floor)
            elif not able and any(record.result.outcome != "refused" for record in members):
                costs[family] = math.inf
        least = min(costs.values(), default=math.inf)
        if math.isfinite(least):
            served.append({family: _factor(cost, least) for family, cost in costs.items()})
    ratios_of = {family: [costs.get(family, math.nan) for costs in served] for family in families}
    return {family: ratios for family, ratios in ratios_of.items() if any(map(math.isfinite, ratios))}


def _factor(cost: float, least: float) -> float:
    return cost / least if least > 0.0 else 1.0 if cost == 0.0 else math.inf


def _ran(factors: Sequence[float]) -> int:
    """Return on how many problems a family ran."""
    return sum(not math.isnan(factor) for factor in factors)


def _within(**errors: float) -> Callable[[Record], bool]:
    return partial(accurate, within=errors)


def _without_drift(record: Record) -> bool:
    """Whether the energy is bounded, or grows no faster than unbiased rounding: the interval has 1/2."""
    growth = clear(record.result.growth.get("energy", ErrorGrowth()))
    slow = growth.kind == "power" and growth.slope_low is not None and growth.slope_low <= 0.5
    return accurate(record, {}) and (growth.kind == "bounded" or slow)
