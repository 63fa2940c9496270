"""When steps of varying length have collapsed: the same rule for every method, ours and the peers'."""

CRAWL_STEPS = 200_000
"""Steps after which a method must have got somewhere."""

CRAWL_SHARE = 1e-7
"""A method that covers less than this share of the way in `CRAWL_STEPS` steps has stalled."""


class Crawl:
    """Sees that an adaptive method no longer gets anywhere, from its own times.

    Parameters
    ----------
    t, end : float
        Where it is and where it shall go.
    """

    def __init__(self, t: float, end: float):
        self._mark, self._end, self._count = t, end, 0

    def sees(self, t: float, steps: int = 1) -> str:
        """Take note of ``steps`` steps that came to ``t``; return the reason if they crawl, else ""."""
        self._count += steps
        if self._count < CRAWL_STEPS:
            return ""
        mark, self._mark, self._count = self._mark, t, 0
        if abs(t - mark) >= CRAWL_SHARE * abs(self._end - mark):
            return ""
        return f"{CRAWL_STEPS} steps from t = {mark!r} only came to t = {t!r}: the steps have collapsed."
