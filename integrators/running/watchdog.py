"""Detection of stalled integrations and of blow-up: the same rule for every method with adaptive steps."""

import math
from typing import Protocol

STALL_STEPS = 200_000
"""Steps after which a method must have got somewhere."""

STALL_SHARE = 1e-7
"""A method that covers less than this share of the way in `STALL_STEPS` steps has stalled."""

SMALL_SHARE, SLOWER = 2e-5, 1e-4
"""So has one that covers less than this share, 1e10 steps for all, and this part of its mean until then."""

LONGEST_WITHOUT_A_LOOK = 1 << 12
"""Steps between two looks at Ctrl-C."""

FIRST_LOOK, LOOKS = 1024, 4
"""Steps after which a blow-up is looked for first, and doublings of that at which it must show."""

NEARER, LARGER = 0.9, 1.05
"""Of the way covered, and of the state's size, from one doubling to the next where a solution blows up."""

STEADY = 0.7
"""Part of the last share that the next is at least where a solution blows up."""


def makes_no_progress(way: float, left: float, before: float, steps: float) -> bool:
    """Whether a method no longer gets anywhere.

    Parameters
    ----------
    way : float
        What its last `STALL_STEPS` steps covered, >= 0.
    left : float
        The way to the end from where they began.
    before : float
        What it covered until then.
    steps : float
        How many steps that took.
    """
    if way < STALL_SHARE * left:
        return True
    return way < SMALL_SHARE * left and way * steps < SLOWER * before * STALL_STEPS


class StallDetector:
    """Detects that an adaptive method has stalled or that the solution blows up, from the times of its steps.

    Twice as many steps cover twice the way where steps keep their length, and as much
    again where the solution oscillates exponentially faster. Where they cover less and less,
    and the state grows, there is a time that they do not pass: the solution blows up there.
    So it looks also on the way to a close approach, but there each doubling covers a still smaller
    share than the one before: either it is passed soon, or no step is short enough.

    Parameters
    ----------
    t, end : float
        Current time, and end of the integration.

    Attributes
    ----------
    steps_to_next_look : int
        Steps to take before the next look.
    """

    _count = _total = _seen = 0
    _way = _size = _share = 0.0
    _look = steps_to_next_look = FIRST_LOOK

    def __init__(self, t: float, end: float):
        self._start = self._mark = self._looked = t
        self._end = end

    def update(self, t: float, steps: int = 1, size: float = math.nan) -> str:
        """Record ``steps`` steps that reached ``t``, where the state has the size ``size``.

        Returns
        -------
        str
            The reason if the integration has stalled, else "".
        """
        self._total += steps
        self._count += steps
        if self._total >= self._look and (reason := self._blows_up(t, size)):
            return reason
        self.steps_to_next_look = min(max(self._look - self._total, 1), LONGEST_WITHOUT_A_LOOK)
        if self._count < STALL_STEPS:
            return ""
        mark, self._mark, count, self._count = self._mark, t, self._count, 0
        if not makes_no_progress(
            abs(t - mark), abs(self._end - mark), abs(mark - self._start), self._total - count
        ):
            return ""
        return f"{count} steps from t = {mark!r} only came to t = {t!r}: the steps have collapsed."

    def _blows_up(self, t: float, size: float) -> str:
        way, share = t - self._looked, abs(t - self._looked) / abs(self._way) if self._way else math.inf
        grows = STEADY * self._share <= share <= NEARER and size >= LARGER * self._size
        self._seen = self._seen + 1 if grows else 0
        self._look, self._looked, self._way, self._share, self._size = 2 * self._total, t, way, share, size
        if self._seen < LOOKS:
            return ""
        goal = t + way * share / (1.0 - share)
        if abs(goal - t) >= abs(self._end - t):
            return ""
        return (
            f"the solution seems to blow up at t = {goal:.9g}: {self._total} steps came to t = {t!r}, each "
            f"doubling of their number by less, while the state grew to {size:.1e}."
        )


class Watched(Protocol):
    """A stepper that is watched on its way.

    Attributes
    ----------
    destination : float or None
        As of `integrators.protocol.Destination`.
    detector : StallDetector or None
        Its detector, if it has a destination; kept here from piece to piece.
    """

    destination: float | None
    detector: StallDetector | None


def stall_detector(stepper: Watched, t: float, end: float) -> StallDetector:
    """Return the stall detector of a stepper on its way from ``t`` to ``end``.

    If the integration to its attribute ``destination`` is done in pieces, one detector is used for all of
    them, and progress is measured relative to the whole interval.
    """
    if stepper.destination is None:
        return StallDetector(t, end)
    if stepper.detector is None:
        stepper.detector = StallDetector(t, stepper.destination)
    return stepper.detector
