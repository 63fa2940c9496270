"""What is read off the trajectories of `endure`: errors, laws, times, and whether the goals are met."""

from dataclasses import dataclass

import numpy as np

from hbvm_bench.measure import drift
from hbvm_bench.store.records import Law
from hbvm_bench.studies.endure.runs import DECADES, Endurance
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.goals import Verdict, verdicts
from hbvm_bench.summaries.points import number


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


def lines(result: Endurance) -> list[Line]:
    """Return one line per method, in the order of declaration."""
    ours = standings.best(standings.among(result.run.records, ""), {})
    wanted = sorted({*(decade for decade in DECADES if decade <= result.years), result.years})
    places = [int(np.flatnonzero(result.t == year)[0]) for year in wanted if year in result.t]
    made = []
    for record in result.run.records:
        errors = result.errors.get(record.case.method, np.empty((0, 0)))
        ratio = standings.compare(ours, record).ratio
        made.append(
            Line(
                method=record.case.method,
                starts=len(errors),
                failed=max(result.starts, 1) - len(errors),
                rms={
                    float(result.t[place]): float(drift.rms(errors[:, [place]])[0])
                    for place in places
                    if errors.size
                },
                drift=record.result.laws.get("energy") if errors.size else None,
                seconds=number(record, standings.TIME),
                times_ours=ratio.median if ratio else None,
            )
        )
    return made


def goals(result: Endurance) -> list[Verdict]:
    """Return the verdicts on what was asked for; none for a span short of a million years."""
    return verdicts(result.run.index.campaign, result.run.records)


def mean_in_words(law: Law) -> str:
    """Return the mean over the starts with its standard error and the count of signs."""
    spread = "" if law.mean_error is None else f" ± {law.mean_error:.1e}"
    return f"{law.mean:+.1e}{spread} ({law.positive} of {law.starts} positive)"


def rate_in_words(law: Law) -> str:
    """Return the mean drift per year with its interval, which one start does not have."""
    bare = law.rate_low is None or law.rate_high is None
    return f"{law.rate:+.1e}" + ("" if bare else f" ({law.rate_low:+.1e} to {law.rate_high:+.1e})")
