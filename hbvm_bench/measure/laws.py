"""The law that an error follows in time, as a record keeps it; the fit is `hbvm_bench.measure.drift`."""

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure import drift

Array = NDArray[np.float64]


class Law(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The law of an invariant's error; numbers that do not exist are ``None``.

    Attributes
    ----------
    law : str or None
        A key of `hbvm_bench.measure.drift.LAWS`; ``None`` where the samples do not say.
    why : str
        Why there is no law.
    slope, slope_low, slope_high : float or None
        Power of t, with its 95 % interval.
    floor : float
        What is there before the growth.
    growth : float or None
        Rate of an exponential, in 1/t.
    rate, rate_low, rate_high : float or None
        Mean signed drift per unit of time, with its 95 % interval over the starts;
        for the energy only, the other invariants' errors have no sign.
    mean, mean_error : float or None
        Mean over the starts at the end, without the offset of each, and its standard
        error (`hbvm_bench.measure.drift.Mean`); for the energy of several starts only.
    positive : int or None
        How many of the starts end above 0.
    reached : float
        What the growth alone reached at the end.
    end : float
        The end of the span, from the start on.
    starts : int
        Trajectories it was found from.
    """

    law: str | None = None
    why: str = ""
    slope: float | None = None
    slope_low: float | None = None
    slope_high: float | None = None
    floor: float = 0.0
    growth: float | None = None
    rate: float | None = None
    rate_low: float | None = None
    rate_high: float | None = None
    mean: float | None = None
    mean_error: float | None = None
    positive: int | None = None
    reached: float = 0.0
    end: float = 0.0
    starts: int = 0

    def curve(self, t: Array) -> Array:
        """Return the law as it was fitted, at times since the start, shape (n,); for drawing."""
        slope = math.nan if self.slope is None else self.slope
        growth = math.nan if self.growth is None else self.growth
        fitted = drift.Drift(
            law=self.law,
            why=self.why,
            slope=slope,
            slope_low=math.nan,
            slope_high=math.nan,
            floor=self.floor,
            growth=growth,
            rate=math.nan,
            rate_low=math.nan,
            rate_high=math.nan,
            starts=self.starts,
            reached=self.reached,
        )
        return fitted.curve(t, self.end)


def find(t: Array, errors: Array, *, signed: bool) -> Law:
    """Fit the law of errors, shape (starts, n), at times since the start, shape (n,).

    Samples that are not finite end the series; fewer than two leave no law.
    """
    good = np.isfinite(errors).all(axis=0)
    size = good.size if good.all() else int(np.argmin(good))
    if size < 2:
        return Law(why="the error is not finite from the first samples on", starts=len(errors))
    found = drift.fit(t[:size], errors[:, :size], signed=signed)
    several = found.mean if found.starts > 1 else None
    cut = "" if size == good.size else f"only to t = {t[size - 1]:.4g}, where the error is last finite"
    return Law(
        law=found.law,
        why=found.why or cut,
        slope=_finite(found.slope),
        slope_low=_finite(found.slope_low),
        slope_high=_finite(found.slope_high),
        floor=found.floor,
        growth=_finite(found.growth) if found.law == "exponential" else None,
        rate=_finite(found.rate),
        rate_low=_finite(found.rate_low),
        rate_high=_finite(found.rate_high),
        mean=several.value if several else None,
        mean_error=several.error if several else None,
        positive=several.positive if several else None,
        reached=found.reached,
        end=float(t[size - 1]),
        starts=len(errors),
    )


def _finite(number: float) -> float | None:
    return float(number) if math.isfinite(number) else None
