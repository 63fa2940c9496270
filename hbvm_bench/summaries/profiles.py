"""Performance profiles: how often a family is within a factor of the best, over all problems.

For each problem the cost of a family is the least work of those of its settings that
reach an accuracy in position and energy. The profile of a family at tau is the share of the
problems on which its cost is at most tau times the least cost of all families.

E. D. Dolan, J. J. More, "Benchmarking optimization software with performance profiles",
Mathematical Programming 91 (2002) 201-213.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hbvm_bench.store.records import Record
from hbvm_bench.summaries.needs import Need, factors
from hbvm_bench.summaries.points import accurate, by_family, number

ACCURACIES = (
    {"position_end": 1e-4},
    {"position_end": 1e-8},
    {"position_end": 1e-8, "energy_max": 1e-13},
)
"""Errors by metric: loose, accurate, and accurate with the energy at round-off."""


@dataclass(frozen=True)
class Profile:
    """The profiles of all families for one accuracy."""

    words: str  # the accuracy that was asked for
    # of each family its work over the least, by problem that any family solves; infinite where it does not
    ratios: dict[str, list[float]]

    @property
    def problems(self) -> int:
        """On how many problems any family reaches the accuracy; the shares are of these."""
        return len(next(iter(self.ratios.values()), ()))

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
        """Return on how many problems a family has the least work, the first of several that have it."""
        first = [min(self.ratios, key=lambda name: self.ratios[name][i]) for i in range(self.problems)]
        return first.count(family)


def profile(records: Sequence[Record], within: Mapping[str, float], work: str) -> Profile:
    """Return the profiles of all families for an accuracy.

    Parameters
    ----------
    records : sequence of Record
        Of a run.
    within : mapping of str to float
        The errors that a setting may have at most, by metric.
    work : str
        Key of the metric of cost; a family without it (a Taylor method has no count of
        evaluations) has no ratio there.
    """
    need = Need("", lambda record: bool(number(record, work)) and accurate(record, within), work)
    found = factors(records, need)
    solved = len(next(iter(found.values()), ()))
    families = by_family([record for record in records if record.case.ensemble is None])
    words = ", ".join(f"{key.partition('_')[0]} to {bound:g}" for key, bound in within.items())
    return Profile(words, {family: list(found.get(family, [math.inf] * solved)) for family in families})
