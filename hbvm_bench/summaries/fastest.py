"""The fastest setting of each family at an error, with what it takes."""

from collections.abc import Mapping
from typing import Any

from hbvm_bench.measure.timing import Spread
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.cost_ratio import ENERGY, OURS, POSITION, level_text, of_families
from hbvm_bench.summaries.frame import Frame
from hbvm_bench.summaries.goals import ratio_text
from hbvm_bench.summaries.rows import format_metric, seconds
from hbvm_bench.summaries.table import NONE, Table

SHOWN = (ENERGY, POSITION, "steps", "evaluations")


def fastest(frame: Frame, within: Mapping[str, float] | None = None) -> Table | None:
    """Return the fastest setting of each family and kind of step size; ``None`` where none was timed.

    Parameters
    ----------
    frame : DataFrame
        The cases, see `hbvm_bench.summaries.frame.cases`.
    within : mapping of str to float, optional
        The errors that a setting may have at most, by metric; by default those of each problem's ``within``.
    """
    rows: list[tuple[Any, ...]] = []
    frame = frame[["processor", "place", "title", "within", "side", "step_size", "record"]]
    several = frame.processor.nunique() > 1
    for (processor, _), here in frame.groupby(["processor", "place"], sort=False):
        errors = within or here.iloc[0].within
        if not errors:
            continue
        ours = standings.best(of_families(here).get(OURS, []), errors)
        for (side, steps), settings in here.groupby(["side", "step_size"], sort=False):
            best = standings.best(list(settings.record), errors)
            label = (here.iloc[0].title, *[processor] * several, level_text(errors), f"{side}, {steps}")
            if best is None:
                rows.append((*label, "not reached", *[NONE] * (2 + len(SHOWN))))
                continue
            ratio = "1" if best is ours else ratio_text(standings.compare(ours, best, chosen=True).ratio)
            numbers = (format_metric(best, key) for key in SHOWN)
            rows.append((*label, best.case.method, time_of(best), *numbers, ratio))
    if all(row[-1] == NONE for row in rows):
        return None
    heads = ("problem", *["processor"] * several, "errors ≤", "family", "setting")
    return Table(
        "The fastest setting of each family",
        (*heads, "time", "energy", "position", "steps", "evaluations", "× HBVM and Gauss"),
        rows,
        "Time: median of a run, with its quartiles. × HBVM and Gauss: over the fastest of their settings.",
        words=range(len(heads)),
        key="fastest-settings",
    )


def time_of(record: Record) -> str:
    """Write the median time of a run with its quartiles."""
    taken = record.timing.samples if record.timing is not None else []
    if not taken:
        return NONE
    time = Spread.from_samples(taken)
    spread = "" if time.low is None or time.high is None else f" ({seconds(time.low)} – {seconds(time.high)})"
    return f"{seconds(time.median)}{spread}"
