"""The law that an error follows in time, as a record keeps it; the fit is `hbvm_bench.measure.drift`."""

import math

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure import drift
from hbvm_bench.store.records import Law

Array = NDArray[np.float64]


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


def curve(law: Law, t: Array) -> Array:
    """Return a law as it was fitted, at times since the start, shape (n,); for drawing."""
    slope = math.nan if law.slope is None else law.slope
    growth = math.nan if law.growth is None else law.growth
    fitted = drift.Drift(
        law=law.law,
        why=law.why,
        slope=slope,
        slope_low=math.nan,
        slope_high=math.nan,
        floor=law.floor,
        growth=growth,
        rate=math.nan,
        rate_low=math.nan,
        rate_high=math.nan,
        starts=law.starts,
        reached=law.reached,
    )
    return fitted.curve(t, law.end)


def _finite(number: float) -> float | None:
    return float(number) if math.isfinite(number) else None
