"""How long a run still takes: a range, and nothing where nothing is known."""

import math
from collections.abc import Mapping, Sequence
from statistics import fmean, variance

FEWEST = 2  # finished cases before anything is said about one that never ran
SPREAD = 0.3  # relative standard deviation of a case whose seconds are known from before


class Estimate:
    """Learns from what finished what is still to come.

    Cases differ by orders of magnitude, so the answer is a range of two standard
    deviations: seconds known from an earlier run, scaled to how fast this one is, or
    else the mean of what finished, with the doubt that a small sample leaves.

    Parameters
    ----------
    known : mapping of str to float
        Seconds of cases by id, from an earlier run.
    limit : float
        Wall seconds after which a case is ended.
    """

    def __init__(self, known: Mapping[str, float], limit: float) -> None:
        self._known = dict(known)
        self._limit = limit
        self._taken: dict[str, float] = {}

    def learn(self, key: str, seconds: float) -> None:
        """Take note that a case took ``seconds``."""
        self._taken = {**self._taken, key: seconds}  # a copy, for another thread reads it

    def left(
        self, waiting: Sequence[str], running: Mapping[str, float], slots: int
    ) -> tuple[float, float] | None:
        """Return the range of seconds until all is done, ``None`` where too little is known.

        ``waiting`` has the ids of cases that have not begun, as often as each is to run; ``running`` the
        seconds of the others so far; ``slots`` run side by side.
        """
        means = {key: self._mean(key) for key in {*waiting, *running}}
        if slots < 1 or None in means.values():
            return None
        mean = {key: seconds or 0.0 for key, seconds in means.items()}
        rest = [self._rest(mean[key], ran) for key, ran in running.items()]
        total = sum(mean[key] for key in waiting) + sum(rest)
        doubt = 2 * math.sqrt(self._variance(waiting, mean))
        most = self._limit * math.ceil((len(waiting) + len(running)) / slots)
        low = max((total - doubt) / slots, 0.0)
        return low, max(min(max((total + doubt) / slots, max(rest, default=0.0)), most), low)

    def _rest(self, mean: float, ran: float) -> float:
        """Return the seconds left of a case; one that is overdue may take as long again."""
        return mean - ran if ran < mean else max(min(ran, self._limit - ran), 0.0)

    def _mean(self, key: str) -> float | None:
        if key in self._taken:
            return self._taken[key]
        if key in self._known:
            return self._known[key] * self._speed()
        if len(self._taken) < FEWEST:
            return None
        return fmean(self._taken.values())

    def _speed(self) -> float:
        """Return how much longer this run takes than the earlier one."""
        both = self._taken.keys() & self._known.keys()
        before = sum(self._known[key] for key in both)
        return sum(self._taken[key] for key in both) / before if before > 0 else 1.0

    def _variance(self, waiting: Sequence[str], mean: Mapping[str, float]) -> float:
        familiar = [key for key in waiting if key in self._known or key in self._taken]
        found = sum((SPREAD * mean[key]) ** 2 for key in familiar)
        if strangers := len(waiting) - len(familiar):
            taken = self._taken.values()
            found += variance(taken) * (strangers + strangers**2 / len(taken))
        return found


def in_words(left: tuple[float, float] | None) -> str:
    """Say a range of seconds: ``"2 to 5 min left"``, ``"about 40 s left"``, or that nothing is known."""
    if left is None:
        return "no estimate yet"
    low, high = left
    if high < 10:
        return "a few seconds left"
    for unit, size in (("s", 1.0), ("min", 60.0), ("h", 3600.0)):
        if high < 90 * size or unit == "h":
            first, last = _rounded(low / size), _rounded(high / size)
            return f"about {last} {unit} left" if first == last else f"{first} to {last} {unit} left"
    raise AssertionError


def _rounded(number: float) -> str:
    return f"{round(number, -1):.0f}" if number >= 30 else f"{number:.0f}" if number >= 3 else f"{number:.2g}"
