"""What an interval far longer than any that was measured would take, at the same cost per step."""

import math
from collections.abc import Sequence

from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.cost_ratio import ENERGY, POSITION
from hbvm_bench.summaries.frame import Frame
from hbvm_bench.summaries.points import number
from hbvm_bench.summaries.rows import format_metric, seconds
from hbvm_bench.summaries.table import NONE, Table

DAY = 86400.0
ASSUMED = (
    "Not measured but in proportion to the longest interval: the same step size, iterations per step and "
    "processor throughout, and no output. It is a statement about time alone. Errors grow: the power of time "
    "is that of the position error between the two intervals, where the same setting ran on both, and holds "
    "as long as the motion is regular. A chaotic system, as the planets over many millions of years are, has "
    "no trajectory that a computation in double precision could follow to such an end: there is no guarantee "
    "of the phases, and a method can only be asked for a possible motion with small errors of the energy."
)


def longer(frame: Frame, end: float, unit: str) -> Table | None:
    """Return the time of each family's fastest setting on the longest interval, and its extrapolation.

    Parameters
    ----------
    frame : DataFrame
        The cases, see `hbvm_bench.summaries.frame.cases`: of problems that differ in their end times.
    end : float
        The far end, in units of the problem's time.
    unit : str
        The name of these units, in the plural.
    """
    rows, several, longest = [], frame.processor.nunique() > 1, 0.0
    for processor, here in frame.groupby("processor", sort=False):
        ends = {place: _end(of.record.iloc[0]) for place, of in here.groupby("place", sort=False)}
        last = max(ends, key=lambda place: ends[place])
        before, longest = here[here.place != last], ends[last]
        for family, settings in here[here.place == last].groupby("side", sort=False):
            best = standings.best(list(settings.record), settings.iloc[0].within)
            time = None if best is None else number(best, standings.TIME)
            if best is None or time is None:
                continue
            steps = number(best, "steps")
            rows.append(
                (
                    family,
                    *[processor] * several,
                    best.case.method,
                    NONE if not steps else seconds(time / steps),
                    seconds(time),
                    *(format_metric(best, key) for key in (ENERGY, POSITION)),
                    _power(best, list(before.record)),
                    f"{time / longest * end / DAY:.3g} days",
                )
            )
    if not rows:
        return None
    first = ("family", *["processor"] * several, "setting", "a step")
    errors = ("energy", "position", "grows as")
    return Table(
        f"The time of {end:.0e} {unit}, if every step costs the same",
        (*first, f"{longest:,.0f} {unit}", *errors, f"{end:.0e} {unit}"),
        rows,
        ASSUMED,
        words=range(2 + several),
        key="longer",
    )


def _end(record: Record) -> float:
    return float(parse_spec(record.case.problem).arguments["t_end"])


def _power(record: Record, others: Sequence[Record]) -> str:
    """Return the power of time by which a setting's position error has grown since a shorter interval."""
    for other in others:
        first, last = number(other, POSITION), number(record, POSITION)
        if other.case.method == record.case.method and first and last:
            return f"t^{math.log(last / first) / math.log(_end(record) / _end(other)):.1f}"
    return NONE
