"""What is read off the trajectories of `endure`: errors, laws, times, and whether the goals are met."""

from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure import drift
from hbvm_bench.store.records import Law
from hbvm_bench.studies.endure.runs import DECADES, OURS, Endurance, of_method

# The goals declared for a million years.
RMS_GOAL = 1e-13
RATE_GOAL = 1e-19  # per year
SPEED_GOAL = 12.0  # times heyoka's
COMPARABLE = 3.0  # times our rms


@dataclass(frozen=True)
class Line:
    """One method.

    Attributes
    ----------
    method : str
        As it prints.
    starts, failed : int
        Trajectories that finished and that did not.
    rms : dict of float to float
        Root mean square over the starts of the relative energy error, by time in years.
    drift : Law or None
        Of its error; ``None`` without a finished trajectory.
    seconds : float or None
        Median of the trajectories.
    times_ours : float or None
        Seconds over ours.
    """

    method: str
    starts: int
    failed: int
    rms: dict[float, float]
    drift: Law | None
    seconds: float | None
    times_ours: float | None


@dataclass(frozen=True)
class Goal:
    """A goal, what was measured, and whether it was reached."""

    words: str
    measured: str
    reached: bool


def lines(result: Endurance) -> list[Line]:
    """Return one line per method, in the order of declaration."""
    ours = _seconds(result, OURS)
    made = []
    for method in result.methods:
        runs = of_method(result, method)
        errors = np.array([run.errors for run in runs])
        t = np.array(result.t)
        seconds = _seconds(result, method)
        failed = sum(one.method == method and one.status != "finished" for one in result.trajectories)
        made.append(
            Line(
                method=method,
                starts=len(runs),
                failed=failed,
                rms=_rms_at(t, errors, result.years) if runs else {},
                drift=drift.fit(t, errors) if runs else None,
                seconds=seconds,
                times_ours=seconds / ours if seconds and ours else None,
            )
        )
    return made


def goals(result: Endurance) -> list[Goal]:
    """Return the goals with what was measured; none for a span short of a million years."""
    if result.years < DECADES[-1]:
        return []
    by_method = {line.method: line for line in lines(result)}
    ours = by_method.get(OURS)
    if ours is None or (law := ours.drift) is None or law.mean is None:
        return []
    rms = ours.rms[DECADES[-1]]
    made = [
        Goal(f"rms of dE/E at 1e6 years at most {RMS_GOAL:.0e}", f"{rms:.1e}", rms <= RMS_GOAL),
        Goal(
            f"mean drift at most {RATE_GOAL:.0e} per year, within its interval",
            rate_in_words(law),
            (law.rate_low is None or law.rate_low <= RATE_GOAL)
            and (law.rate_high is None or law.rate_high >= -RATE_GOAL),
        ),
        Goal(
            f"no drift: mean within {drift.limit(law.starts):.3g} of its standard errors"
            if law.starts > 1
            else "no drift",
            mean_in_words(law)
            + (f", {abs(law.mean) / law.mean_error:.1f} standard errors" if law.mean_error else ""),
            drift.drifts(law) is False,
        ),
    ]
    for line in by_method.values():
        if line.method.startswith("Taylor") and line.times_ours is not None:
            theirs = line.rms[DECADES[-1]]
            made.append(
                Goal(
                    f"at least {SPEED_GOAL:g} times as fast as {line.method} at comparable error",
                    f"{line.times_ours:.1f} times; its rms {theirs:.1e}",
                    line.times_ours >= SPEED_GOAL and rms <= COMPARABLE * theirs,
                )
            )
    return made


def mean_in_words(law: Law) -> str:
    """Return the mean over the starts with its standard error and the count of signs."""
    spread = "" if law.mean_error is None else f" ± {law.mean_error:.1e}"
    return f"{law.mean:+.1e}{spread}; {law.positive} of {law.starts} positive"


def rate_in_words(law: Law) -> str:
    """Return the mean drift per year with its interval, which one start does not have."""
    bare = law.rate_low is None or law.rate_high is None
    return f"{law.rate:+.1e}" + ("" if bare else f" ({law.rate_low:+.1e} to {law.rate_high:+.1e})")


def _seconds(result: Endurance, method: str) -> float | None:
    values = [run.seconds for run in of_method(result, method) if run.seconds is not None]
    return median(values) if values else None


def _rms_at(t: NDArray[np.float64], errors: NDArray[np.float64], years: float) -> dict[float, float]:
    values = drift.rms(errors)
    wanted = sorted({*(decade for decade in DECADES if decade <= years), years})
    return {year: float(values[int(np.flatnonzero(t == year)[0])]) for year in wanted}
