"""The growth of the energy error: of each case, and how many cases of each family have which."""

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import median

import numpy as np
from msgspec.structs import replace

from hbvm_bench.measure import drift
from hbvm_bench.measure.measured import Series
from hbvm_bench.store.records import ErrorGrowth, Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.frame import Frame
from hbvm_bench.summaries.points import by_family as families
from hbvm_bench.summaries.points import number
from hbvm_bench.summaries.rows import reached, seconds
from hbvm_bench.summaries.table import NONE, Table
from integrators.protocol import Array

SHORT = {"bounded": "bounded", "power": "t^a", "exponential": "exp t", "drift": "drift"}
"""Every kind in a few signs, by the keys of `hbvm_bench.measure.drift.KINDS`; powers have exponents."""
NOT_CLEAR = "not clear"
COLUMNS = ("growth", "power of t", "mean", "per unit of time", "time", "× HBVM and Gauss")
FEWEST_STARTS = 16
"""Initial conditions from which a growth is reported: a root mean square over 16 is known to 18 %."""


def clear(growth: ErrorGrowth) -> ErrorGrowth:
    """Return a growth as it is reported: not clear from fewer than `FEWEST_STARTS` initial conditions."""
    if growth.kind is None or growth.starts >= FEWEST_STARTS:
        return growth
    from_few = f"{NOT_CLEAR} from {growth.starts} initial condition" + "s" * (growth.starts != 1)
    return replace(growth, kind=None, why=from_few)


def energy_errors(series: Series) -> tuple[Array, Array]:
    """Return the times (n,) and the signed relative energy errors (starts, n) of a case; empty without."""
    if not {"drift.t", "drift.energy"} <= {*series}:
        return np.empty(0), np.empty((0, 0))
    return series["drift.t"], np.atleast_2d(series["drift.energy"])


def energy_rms(series: Series) -> float:
    """Return the rms over the initial conditions of the energy error at the end."""
    _, errors = energy_errors(series)
    return float(drift.rms(errors)[-1])


def by_case(frame: Frame, series: Mapping[str, Series]) -> Table | None:
    """Return the growth of the energy error of each case; ``None`` where none was fitted.

    Parameters
    ----------
    frame : DataFrame
        The cases, see `hbvm_bench.summaries.frame.cases`.
    series : mapping of str to mapping
        Arrays by the id of the case: the rms over the initial conditions at powers of ten of time is of
        ``drift.t`` and ``drift.energy``, where they are stored.
    """
    errors_of = {record.id: energy_errors(series.get(record.id, {})) for record in frame.record}
    times = [t for t, _ in errors_of.values() if t.size]
    ends = {float(t[-1]) for t in times}
    at = sorted(
        {float(time) for t in times for time in t if np.log10(time) % 1 == 0 and time >= t[-1] / 1e2} | ends
    )
    several, rows, most = frame.title.nunique() > 1, [], 0
    for _, here in frame.groupby("place", sort=False):
        ours = standings.best(standings.among(list(here.record), ""), {})
        for record in here.record:
            starts = max(record.case.checks.starts, 1)
            t, errors = errors_of[record.id]
            if "energy" not in record.result.growth and not errors.size:
                continue
            found = clear(record.result.growth.get("energy", ErrorGrowth()))
            rms = dict(zip(t.tolist(), drift.rms(errors).tolist(), strict=True)) if errors.size else {}
            ran = len(errors) if errors.size else starts
            time, most = number(record, standings.TIME), max(most, starts)
            rows.append(
                (
                    *[here.iloc[0].title] * several,
                    record.case.method,
                    f"{ran}" + (f", {starts - ran} failed" if ran < starts else ""),
                    *(f"{rms[year]:.1e}" if year in rms else NONE for year in at),
                    _named(found),
                    power_of(found) if found.kind else NONE,
                    NONE if found.mean is None else _mean(found),
                    NONE if found.rate is None else _rate(found),
                    NONE if time is None else seconds(time),
                    _relative(ours, record),
                )
            )
    if not rows:
        return None
    heads = tuple(f"{time:g}" for time in at)
    first = 2 + several
    return Table(
        "Growth of the relative energy error",
        (*["problem"] * several, "method", "starts", *heads, *COLUMNS),
        rows,
        "rms over the initial conditions, after so much time. Mean: over the initial conditions at the end, "
        "with its standard error, after the offset of each was subtracted. "
        + (f"{drift.told(most)}, whatever the power of t. " if most > 1 else "")
        + "Power of t and drift with 95 % intervals over the initial conditions. Time: median of one "
        "trajectory." + drift.uncertainty(most),
        words=(*range(1 + several), first + len(heads)),
        groups=(("", first), *[("rms after", len(heads))] * bool(heads), ("", 2), ("drift", 2), ("", 2)),
        key="growth",
    )


def _relative(ours: Record | None, record: Record) -> str:
    ratio = standings.compare(ours, record, chosen=True).ratio
    return NONE if ratio is None else f"{ratio.median:.3g}"


def _named(growth: ErrorGrowth) -> str:
    if growth.kind is None:
        return growth.why or NONE
    return "grows" if growth.kind == "power" else drift.KINDS[growth.kind]


def _mean(growth: ErrorGrowth) -> str:
    """Return the mean over the initial conditions with its standard error and the count of signs."""
    spread = "" if growth.mean_error is None else f" ± {growth.mean_error:.1e}"
    return f"{growth.mean:+.1e}{spread} ({growth.positive} of {growth.starts} positive)"


def _rate(growth: ErrorGrowth) -> str:
    """Return the mean drift with its interval, which one start does not have."""
    bare = growth.rate_low is None or growth.rate_high is None
    return f"{growth.rate:+.1e}" + ("" if bare else f" ({growth.rate_low:+.1e} to {growth.rate_high:+.1e})")


def by_method(records: Sequence[Record]) -> dict[str, list[ErrorGrowth]]:
    """Return for each family the energy's error growth of its cases on their trajectory."""
    judged = [record for record in records if "energy" in record.result.growth and reached(record)]
    return {
        family: [clear(record.result.growth["energy"]) for record in each]
        for family, each in families(judged).items()
    }


def by_family(records: Sequence[Record]) -> Table | None:
    """Return how many cases of each method have which growth; ``None`` where none was fitted."""
    growths_of = by_method(records)
    if not growths_of:
        return None
    kinds = [*dict.fromkeys(SHORT.values()), NOT_CLEAR]
    rows = []
    for family, growths in growths_of.items():
        counted = Counter(SHORT[growth.kind] if growth.kind else NOT_CLEAR for growth in growths)
        powers = sorted(g.slope for g in growths if g.slope is not None and g.kind == "power")
        middle = f"{median(powers):.2f} ({powers[0]:.2f} to {powers[-1]:.2f})" if powers else NONE
        rows.append((family, *(str(counted.get(kind, NONE)) for kind in kinds), middle))
    starts = max(growth.starts for growths in growths_of.values() for growth in growths)
    return Table(
        "Growth of the energy error",
        ("method", *kinds, "a"),
        rows,
        "The number of cases of each method with each kind of growth; a: median of the exponents, in "
        "brackets the smallest and the largest. The interval of each exponent is given with its case."
        + drift.uncertainty(starts),
    )


def power_of(growth: ErrorGrowth) -> str:
    """Return the power of t with its interval, where it has one: ``"0.52 (0.41 to 0.63)"``."""
    if growth.slope is None:
        return NONE
    bare = growth.slope_low is None or growth.slope_high is None
    return f"{growth.slope:.2f}" + ("" if bare else f" ({growth.slope_low:.2f} to {growth.slope_high:.2f})")
