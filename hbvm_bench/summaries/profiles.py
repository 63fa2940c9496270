"""Performance profiles: how often a family is within a factor of the best, over all problems.

For each problem the cost of a family is the least work of those of its settings that
reach an accuracy in position and energy. The profile of a family at tau is the share of the
problems on which its cost is at most tau times the least cost of all families.

E. D. Dolan, J. J. More, "Benchmarking optimization software with performance profiles",
Mathematical Programming 91 (2002) 201-213.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import by_family, by_problem, family_of, number
from hbvm_bench.summaries.rows import group_of


@dataclass(frozen=True)
class Accuracy:
    """What a setting must reach to count as a solution.

    Attributes
    ----------
    position : float
        Error at the end; see `hbvm_bench.measure.measured.POSITION`.
    energy : float
        Largest relative error.
    """

    position: float
    energy: float = math.inf

    @property
    def words(self) -> str:
        """The accuracy in words."""
        text = f"position to {self.position:g}"
        return text if math.isinf(self.energy) else f"{text}, energy to {self.energy:g}"


ACCURACIES = (Accuracy(1e-4), Accuracy(1e-8), Accuracy(1e-8, 1e-13))
"""Loose, accurate, and accurate with the energy at round-off."""


@dataclass(frozen=True)
class Profile:
    """The profiles of all families for one accuracy.

    Attributes
    ----------
    accuracy : Accuracy
        What was asked.
    work : str
        Key of the metric of cost.
    problems : list of str
        Those with a reference at the end that any family solves; the shares are of these.
    unsolved : list of str
        Those with a reference that no family solves.
    best : dict of (str, Record)
        By problem: the family with the least work, and its case.
    ratios : dict of list of float
        By family: its work over the least, problem by problem; infinite where it does not
        reach the accuracy.
    """

    accuracy: Accuracy
    work: str
    problems: list[str]
    unsolved: list[str]
    best: dict[str, tuple[str, Record]]
    ratios: dict[str, list[float]]

    def share(self, family: str, tau: float) -> float:
        """Return the share of the problems on which a family is within a factor ``tau`` of the best."""
        ratios = self.ratios[family]
        return sum(ratio <= tau for ratio in ratios) / len(ratios) if ratios else 0.0

    def curve(self, family: str) -> tuple[list[float], list[float]]:
        """Return the steps of a family's profile: factors, ascending from 1, and shares from there on."""
        taus = sorted({1.0, *(ratio for ratio in self.ratios[family] if math.isfinite(ratio))})
        return taus, [self.share(family, tau) for tau in taus]

    def solved(self, family: str) -> int:
        """Return on how many problems a family reaches the accuracy."""
        return sum(math.isfinite(ratio) for ratio in self.ratios[family])

    def wins(self, family: str) -> int:
        """Return on how many problems a family has the least work."""
        return sum(winner == family for winner, _ in self.best.values())


def reaches(record: Record, accuracy: Accuracy) -> bool:
    """Whether a case is as accurate."""
    if group_of(record) != "on" or record.case.ensemble:
        return False
    position, energy = number(record, "position_end"), number(record, "energy_max")
    if position is None or position > accuracy.position:
        return False
    return math.isinf(accuracy.energy) or (energy is not None and energy <= accuracy.energy)


def profile(records: Sequence[Record], accuracy: Accuracy, work: str) -> Profile:
    """Return the profiles of all families for an accuracy.

    Parameters
    ----------
    records : sequence of Record
        Of a run.
    accuracy : Accuracy
        What a setting must reach.
    work : str
        Key of the metric of cost; a family without it (a Taylor method has no count of
        evaluations) has no ratio there.
    """
    families = list(by_family([record for record in records if record.case.ensemble is None]))
    solved: list[str] = []
    unsolved: list[str] = []
    best: dict[str, tuple[str, Record]] = {}
    ratios: dict[str, list[float]] = {family: [] for family in families}
    for problem, here in by_problem(records).items():
        if not any(number(record, "position_end") is not None for record in here):
            continue
        cheapest: dict[str, tuple[float, Record]] = {}
        for record in here:
            cost = number(record, work)
            if not cost or not reaches(record, accuracy):
                continue
            family = family_of(record)
            if family not in cheapest or cost < cheapest[family][0]:
                cheapest[family] = (cost, record)
        if not cheapest:
            unsolved.append(problem)
            continue
        winner = min(cheapest, key=lambda family: cheapest[family][0])
        least = cheapest[winner][0]
        solved.append(problem)
        best[problem] = (winner, cheapest[winner][1])
        for family in families:
            ratios[family].append(cheapest[family][0] / least if family in cheapest else math.inf)
    return Profile(accuracy, work, solved, unsolved, best, ratios)
