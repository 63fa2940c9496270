"""Which integrator for which need: the answers of a run, in rows of text.

A need is an accuracy and a number to be small. On every problem the settings that reach the
accuracy are compared, and each family stands for its best; families are then ordered by on
how many problems they come near the best, and among equals by how far they are from it
in the median.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

from hbvm_bench.measure.metrics import find
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import by_problem, family_of, number, work_of
from hbvm_bench.summaries.profiles import Accuracy, reaches
from hbvm_bench.summaries.rows import group_of

SHOWN = 3
ROUND_OFF = 1e-15  # an error below this is as good as any other


@dataclass(frozen=True)
class Need:
    """What somebody wants of an integrator.

    Attributes
    ----------
    title : str
        For readers.
    serves : callable
        Whether a case serves the need.
    cost : str
        Key of the metric that is then to be small.
    near : float
        Up to this factor a cost is near the best.
    floor : float
        Costs below it are equal.
    """

    title: str
    serves: Callable[[Record], bool]
    cost: str
    near: float = 2.0
    floor: float = 0.0


@dataclass(frozen=True)
class Candidate:
    """How a family serves a need.

    Attributes
    ----------
    family : str
        Name of the method.
    serves, near, best : int
        On how many problems it serves the need at all, comes near the best, is the best.
    behind : float
        Its cost over the best family's, the median over the problems it serves.
    """

    family: str
    serves: int
    near: int
    best: int
    behind: float


@dataclass(frozen=True)
class Answer:
    """A need and who serves it.

    Attributes
    ----------
    title, cost : str
        Of the need; the cost is the label of its metric.
    problems : int
        On how many problems any family serves it.
    candidates : list of Candidate
        The first are the ones to take.
    """

    title: str
    cost: str
    problems: int
    candidates: list[Candidate]

    @property
    def text(self) -> str:
        """Return the first candidates: how often near the best, and their median factor behind it."""
        parts = [
            f"{c.family} ({c.near} of {self.problems}"
            + (f", {c.behind:.3g} times the best)" if c.behind > 1.005 else ")")
            for c in self.candidates[:SHOWN]
        ]
        return "; ".join(parts) or "none"


def answers(records: Sequence[Record]) -> list[Answer]:
    """Return the answers that a run has data for, in the order of `needs_of`."""
    found = [_answer(records, need) for need in needs_of(records)]
    return [answer for answer in found if answer.candidates]


def needs_of(records: Sequence[Record]) -> list[Need]:
    """Return the needs, with the measure of work that the run has."""
    work = work_of(records)
    right, accurate, there = _reaching(Accuracy(1e-4)), _reaching(Accuracy(1e-8)), _reaching(Accuracy(1.0))
    exact = _reaching(Accuracy(1e-8, 1e-13))
    timed = work == "warm_seconds"
    cheaply = "in little time" if timed else "with few evaluations (a method that counts none takes no part)"
    wanted = [
        Need(f"a position right to 1e-4, {cheaply}", right, work),
        Need(f"a position right to 1e-8, {cheaply}", accurate, work),
        Need(f"position to 1e-8 and energy to 1e-13, {cheaply}", exact, work),
        Need("the most accurate position at the end", there, "position_end", 10.0, ROUND_OFF),
        Need("the most accurate phase at the end", there, "phase_end", 10.0, ROUND_OFF),
        Need("the least energy error, position right to 1e-4", right, "energy_max", 10.0, ROUND_OFF),
        Need("other invariants, position right to 1e-4", right, "invariants_max", 10.0, ROUND_OFF),
        Need("an energy error bounded or as t^1/2", _without_drift, "energy_max", 10.0, ROUND_OFF),
        Need("the way back to the start", _on, "reversal", 10.0, ROUND_OFF),
        Need("little memory", _on, "peak_memory", 1.25),
    ]
    # seconds taken while other cases ran say nothing
    return (
        [*wanted, Need("a first result soon: little to compile", right, "compile_seconds")]
        if timed
        else wanted
    )


def _reaching(accuracy: Accuracy) -> Callable[[Record], bool]:
    return lambda record: reaches(record, accuracy)


def _on(record: Record) -> bool:
    return group_of(record) == "on" and record.case.ensemble is None


def _without_drift(record: Record) -> bool:
    law = record.result.laws.get("energy")
    return _on(record) and law is not None and law.law in ("bounded", "square root")


def _answer(records: Sequence[Record], need: Need) -> Answer:
    behind: dict[str, list[float]] = {}
    wins: dict[str, int] = {}
    served = 0
    for here in by_problem(records).values():
        costs: dict[str, float] = {}
        for record in here:
            cost = number(record, need.cost)
            if cost is None or not need.serves(record):
                continue
            family = family_of(record)
            costs[family] = min(costs.get(family, math.inf), max(cost, need.floor))
        if not costs:
            continue
        served += 1
        least = min(costs.values())
        for family, cost in costs.items():
            behind.setdefault(family, []).append(cost / least if least > 0.0 else 1.0)
            wins[family] = wins.get(family, 0) + (cost == least)
    made = [
        Candidate(
            family=family,
            serves=len(ratios),
            near=sum(ratio <= need.near for ratio in ratios),
            best=wins[family],
            behind=median(ratios),
        )
        for family, ratios in behind.items()
    ]
    ordered = sorted(made, key=lambda c: (-c.near, c.behind))
    return Answer(need.title, find(need.cost).label, served, ordered)
