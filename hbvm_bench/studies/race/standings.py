"""Who is how fast at which accuracy: read off the outcomes of a contest, the same way for every family."""

from dataclasses import dataclass
from statistics import median, quantiles

from hbvm_bench.studies.race.results import Goal, Outcome, Race
from hbvm_bench.studies.race.settings import OURS

LEVELS = tuple(10.0**-digits for digits in range(8, 15))
POSITION_OVER_ENERGY = 1e3
"""At each level the position error may be this much larger than the energy error, as in the targets."""


@dataclass(frozen=True)
class Ratio:
    """A peer's best time over our best time.

    Attributes
    ----------
    ours, theirs : Outcome or None
        The fastest settings that are accurate enough; ``None`` where none is.
    value : float or None
        Median of the ratios within each interleaved round.
    low, high : float or None
        Quartiles of the same.
    """

    ours: Outcome | None
    theirs: Outcome | None
    value: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Verdict:
    """A goal and what was measured."""

    goal: Goal
    ratio: Ratio
    reached: bool


def best(race: Race, family: str, energy: float, position: float) -> Outcome | None:
    """Return the fastest setting of a family with errors at most these; ``None`` if there is none."""
    able = [
        o
        for o in race.outcomes
        if o.setting.family == family
        and o.counts
        and o.energy is not None
        and o.position is not None
        and o.energy <= energy
        and o.position <= position
    ]
    return min(able, key=lambda o: o.median or 0.0, default=None)


def default(race: Race, family: str) -> Outcome | None:
    """Return the outcome of a family's own defaults, where they may be compared."""
    return next(
        (o for o in race.outcomes if o.setting.family == family and o.setting.default and o.counts), None
    )


def ratio(ours: Outcome | None, theirs: Outcome | None) -> Ratio:
    """Compare two outcomes of one contest."""
    if ours is None or theirs is None or not ours.median or not theirs.median:
        return Ratio(ours, theirs, None, None, None)
    pairs = [
        b / a for a, b in zip(ours.seconds, theirs.seconds, strict=True) if a is not None and b is not None
    ]
    low, high = (None, None) if len(pairs) < 2 else quantiles(pairs, n=4, method="inclusive")[::2]
    return Ratio(ours, theirs, median(pairs) if pairs else None, low, high)


def at(race: Race, family: str, energy: float, position: float, ours: str = OURS) -> Ratio:
    """Compare the best settings of a peer and of ours at one accuracy."""
    return ratio(best(race, ours, energy, position), best(race, family, energy, position))


def verdict(race: Race, goal: Goal) -> Verdict:
    """Compare with a goal."""
    if goal.position is None:
        theirs = best(race, goal.family, goal.energy, float("inf"))
        allowed = float("inf") if theirs is None or theirs.position is None else theirs.position
        found = ratio(best(race, OURS, goal.energy, allowed), theirs)
    else:
        found = at(race, goal.family, goal.energy, goal.position)
    return Verdict(goal, found, found.value is not None and found.value >= goal.ratio)


def untuned(race: Race, family: str) -> Ratio:
    """Compare a peer at its defaults with the fastest of ours that is as accurate, in both errors."""
    theirs = default(race, family)
    if theirs is None or theirs.energy is None or theirs.position is None:
        return Ratio(None, theirs, None, None, None)
    return ratio(best(race, OURS, theirs.energy, theirs.position), theirs)


def present(race: Race) -> list[str]:
    """Return the families of a contest in the order of declaration."""
    return list(dict.fromkeys(o.setting.family for o in race.outcomes))


def calibrated(race: Race) -> float | None:
    """Return the median of the calibration in seconds."""
    return median(race.calibration) if race.calibration else None
