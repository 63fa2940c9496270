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
        taken = self._taken
        means = {key: seconds * self._speed() for key, seconds in self._known.items()} | taken
        strangers = [key for key in waiting if key not in means]
        if slots < 1 or (len(taken) < FEWEST and (strangers or not running.keys() <= means.keys())):
            return None
        usual = fmean(taken.values()) if taken else 0.0
        mean = {key: means.get(key, usual) for key in {*waiting, *running}}
        rest = [  # one that is overdue may take as long again
            mean[key] - ran if ran < mean[key] else max(min(ran, self._limit - ran), 0.0)
            for key, ran in running.items()
        ]
        scatter = sum((SPREAD * mean[key]) ** 2 for key in waiting if key in means)
        if strangers:
            scatter += variance(taken.values()) * (len(strangers) + len(strangers) ** 2 / len(taken))
        total, doubt = sum(mean[key] for key in waiting) + sum(rest), 2 * math.sqrt(scatter)
        most = self._limit * math.ceil((len(waiting) + len(running)) / slots)
        low = max((total - doubt) / slots, 0.0)
        return low, max(min(max((total + doubt) / slots, max(rest, default=0.0)), most), low)

    def _speed(self) -> float:
        """Return how much longer this run takes than the earlier one."""
        both = self._taken.keys() & self._known.keys()
        before = sum(self._known[key] for key in both)
        return sum(self._taken[key] for key in both) / before if before > 0 else 1.0


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
