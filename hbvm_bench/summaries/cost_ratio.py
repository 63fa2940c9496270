"""Time of each family's fastest setting relative to that of HBVM and Gauss, at equal errors.

Both functions take the results table, `hbvm_bench.summaries.frame.cases`: a row for each case.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hbvm_bench.measure import machine
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.measure.timing import Spread
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.frame import OURS, Frame
from hbvm_bench.summaries.goals import ratio_text
from hbvm_bench.summaries.points import PROJECTION, accurate
from hbvm_bench.summaries.rows import seconds
from hbvm_bench.summaries.table import NONE, Table

ENERGY, POSITION = "energy_max", "position_end"
POSITION_ERRORS = (1e-3, 1e-6, 1e-9, 1e-12)
ENERGY_AND_POSITION = tuple((10.0**-digits, 10.0 ** (3 - digits)) for digits in range(8, 15))
"""From loose to tight; the position error may be a thousand times the energy error."""
LEVELS = {"position error": POSITION_ERRORS, "energy and position error": ENERGY_AND_POSITION}
OUTSIDE = "outside its domain"
LESS_ACCURATE = "less accurate"
COLUMNS = (
    *("processor", "place", "problem", "level", "family", "setting", "seconds"),
    *("ratio", "low", "high", "why", "ours", "ours_seconds"),
)


def ratios(
    frame: Frame,
    at: str = "",
    *,
    no_worse: Sequence[str] = (),
) -> Frame:
    """Return a row for each processor, problem, level of errors and family but HBVM and Gauss.

    Settings that the campaign calls outside of their method's domain take no part.

    ``ratio`` is the median, within the interleaved rounds, of the family's time over that of HBVM and Gauss,
    ``low`` and ``high`` are its quartiles; NaN where there is none, and ``why`` says so.

    Parameters
    ----------
    frame : DataFrame
        The cases, see `hbvm_bench.summaries.frame.cases`.
    at : {"", "position error", "energy and position error"}
        The levels of errors, see `LEVELS`; by default the errors that each problem's ``within`` asks for.
    no_worse : sequence of str
        The errors in which HBVM and Gauss must be no worse than the family's setting, instead of a level.
    """
    import pandas as pd

    rows: list[tuple[Any, ...]] = []
    frame = frame[[record.case.settings != OUTSIDE for record in frame.record]]
    frame = frame[["processor", "place", "title", "within", "side", "step_size", "record"]]
    for (processor, place), here in frame.groupby(["processor", "place"], sort=False):
        problem, within = here.title.iloc[0], here.within.iloc[0]
        families = of_families(here)
        ours = families.pop(OURS, [])
        levels = {NONE: {}} if no_worse else dict(_levels(at, within))
        for level, errors in levels.items():
            for family, records in families.items():
                row = _compared(ours, records, errors, no_worse)
                rows.append((processor, place, problem, level, family, *row))
    found = pd.DataFrame(rows, columns=list(COLUMNS))
    found["text"] = [_text(row) for row in found.to_dict("records")]
    return found


def table(found: Frame, title: str, level: str = "") -> Table | None:
    """Return `ratios` as a table, a column for each family; ``None`` where no family has a time.

    ``level`` is the head of the column of levels, which have none without one.
    """
    found = found[found.seconds.notna().groupby([found.processor, found.place, found.level]).transform("any")]
    families = [name for name, of in found.groupby("family", sort=False) if of.seconds.notna().any()]
    if not families:
        return None
    several = found.processor.nunique() > 1
    rows = []
    for (processor, _, at), here in found.groupby(["processor", "place", "level"], sort=False):
        problem = here.problem.iloc[0]
        ours = here[here.ours != ""]
        first = (NONE, NONE) if ours.empty else (ours.iloc[0].ours, seconds(ours.iloc[0].ours_seconds))
        text = here.set_index("family").text
        labels = (problem, *[processor] * several, *[at] * bool(level))
        rows.append((*labels, *first, *(text.get(family, NONE) for family in families)))
    heads = ("problem", *["processor"] * several, *[level] * bool(level), "fastest of HBVM and Gauss", "time")
    return Table(
        title,
        (*heads, *families),
        rows,
        "Median of the ratio within each interleaved round, in brackets its quartiles; below 1 the other "
        "library is faster. A time, alone: only this library is as accurate. –: no setting of the library is "
        "as accurate, or it does not take the problem." + f" {machine.COLUMNS}" * several,
        words=(*range(len(heads) - 1),),
        key="times-at-" + (level.split(" ≤")[0].replace(", ", "-").replace(" ", "-") or "equal-errors"),
    )


def strongest(found: Frame) -> Frame:
    """Return of each processor, problem and level the other library's family that takes least time."""
    compared = found[found.ratio.notna() & (found.why == "") & (found.family != PROJECTION)]
    return compared.loc[compared.groupby(["processor", "place", "level"], sort=False).ratio.idxmin()]


def of_families(here: Frame) -> dict[str, list[Record]]:
    """Return the records of one problem by family; HBVM and Gauss are one."""
    return here.groupby("side", sort=False).record.agg(list).to_dict()


def power(value: float) -> str:
    """Write an error level: ``1e-13``."""
    return f"{value:.0e}"


def level_text(within: Mapping[str, float]) -> str:
    """Write the errors that times are compared at: ``1e-13, 1e-10``, or with their names."""
    if [*within] == [ENERGY, POSITION]:
        return ", ".join(map(power, within.values()))
    return ", ".join(f"{METRICS[key].short} ≤ {power(bound)}" for key, bound in within.items())


def _levels(at: str, within: Mapping[str, float]) -> Iterator[tuple[str, dict[str, float]]]:
    if not at and within:
        yield level_text(within), dict(within)
    for errors in LEVELS[at] if at else ():
        if isinstance(errors, tuple):
            yield ", ".join(map(power, errors)), dict(zip((ENERGY, POSITION), errors, strict=True))
        else:
            yield f"{errors:g}", {POSITION: errors}


def _compared(
    ours: Sequence[Record], theirs: Sequence[Record], within: Mapping[str, float], no_worse: Sequence[str]
) -> tuple[Any, ...]:
    """Return the columns of `ratios` from ``setting`` on."""
    them = standings.best(theirs, {**within, **dict.fromkeys(no_worse, math.inf)})
    wanted = standings.no_worse(them, dict.fromkeys(no_worse, 1.0)) if them else {}
    us = standings.best(ours, {**within, **wanted})
    why = ""
    if them is None:
        why = _why_none(theirs)
    elif us is None and no_worse and len(ours) == 1:
        us, why = ours[0], LESS_ACCURATE
    elif us is None:
        why = "alone"
    spread = standings.compare(us, them, chosen=not no_worse or len(ours) > 1).ratio
    numbers = (
        (math.nan,) * 3
        if spread is None
        else (spread.median, spread.low or math.nan, spread.high or math.nan)
    )
    return (*_setting(them), *numbers, why, *_setting(us))


def _setting(record: Record | None) -> tuple[str, float]:
    if record is None:
        return "", math.nan
    times = [*standings.by_round(record).values()]
    return record.case.method, Spread.from_samples(times).median if times else math.nan


def _why_none(records: Sequence[Record]) -> str:
    if records and all(record.result.outcome == "refused" for record in records):
        return "does not apply"
    return "not reached" if any(accurate(record, {}) for record in records) else "no valid run"


def _text(row: Mapping[str, Any]) -> str:
    if row["why"] == "alone":
        return f"{seconds(row['seconds'])}, alone"
    if math.isnan(row["ratio"]):
        return NONE
    ends = (None if math.isnan(row[end]) else row[end] for end in ("low", "high"))
    text = ratio_text(Spread(row["ratio"], *ends))
    return f"{text.partition(' (')[0]} {row['why']}" if row["why"] else text
