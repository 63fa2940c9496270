"""Who is how fast at which accuracy: read off the outcomes of a contest, the same way for every family."""

from dataclasses import dataclass
from statistics import median

from hbvm_bench.measure.timing import Spread, ratios
from hbvm_bench.studies.race.results import Goal, Outcome, Race
from hbvm_bench.studies.race.settings import OURS

LEVELS = tuple(10.0**-digits for digits in range(8, 15))
POSITION_OVER_ENERGY = 1e3
"""At each level the position error may be this much larger than the energy error, as in the targets."""


@dataclass(frozen=True)
class Comparison:
    """A peer's best time over our best time.

    Attributes
    ----------
    ours, theirs : Outcome or None
        The fastest settings that are accurate enough; ``None`` where none is.
    ratio : Spread or None
        Of their time over ours within each interleaved round.
    """

    ours: Outcome | None
    theirs: Outcome | None
    ratio: Spread | None = None


@dataclass(frozen=True)
class Verdict:
    """A goal and what was measured."""

    goal: Goal
    comparison: Comparison
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


def compare(ours: Outcome | None, theirs: Outcome | None) -> Comparison:
    """Compare two outcomes of one contest."""
    found = [] if ours is None or theirs is None else ratios(theirs.seconds, ours.seconds)
    return Comparison(ours, theirs, Spread.of(found) if found else None)


def at(race: Race, family: str, energy: float, position: float, ours: str = OURS) -> Comparison:
    """Compare the best settings of a peer and of ours at one accuracy."""
    return compare(best(race, ours, energy, position), best(race, family, energy, position))


def verdict(race: Race, goal: Goal) -> Verdict:
    """Compare with a goal."""
    if goal.position is None:
        theirs = best(race, goal.family, goal.energy, float("inf"))
        allowed = float("inf") if theirs is None or theirs.position is None else theirs.position
        found = compare(best(race, OURS, goal.energy, allowed), theirs)
    else:
        found = at(race, goal.family, goal.energy, goal.position)
    return Verdict(goal, found, found.ratio is not None and found.ratio.median >= goal.ratio)


def untuned(race: Race, family: str) -> Comparison:
    """Compare a peer at its defaults with the fastest of ours that is as accurate, in both errors."""
    theirs = default(race, family)
    if theirs is None or theirs.energy is None or theirs.position is None:
        return Comparison(None, theirs)
    return compare(best(race, OURS, theirs.energy, theirs.position), theirs)


def present(race: Race) -> list[str]:
    """Return the families of a contest in the order of declaration."""
    return list(dict.fromkeys(o.setting.family for o in race.outcomes))


def calibrated(race: Race) -> float | None:
    """Return the median of the calibration in seconds."""
    return median(race.calibration) if race.calibration else None
