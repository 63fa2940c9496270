"""What a figure shows, as numbers: for interaction in the page, for its table and for its CSV file."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.store.files import csv_of
from hbvm_bench.summaries.table import Table

Array = NDArray[np.float64]

DIGITS = 4  # significant ones of what is drawn; the store has them all
NEAR = 0.02  # of a curve's length before its first point: a bin of an envelope may begin so late
TABLE_COLUMNS = 6  # places on the horizontal axis that the table of a curve shows


@dataclass(frozen=True)
class Axis:
    """One axis: its label, whether it is logarithmic, and whether the page offers to change that.

    What lies beyond ``low`` or ``high`` (powers of ten) is out of the first view.
    """

    label: str
    log: bool = False
    both: bool = False
    low: int | None = None
    high: int | None = None


@dataclass(frozen=True)
class Trace:
    """One curve or one cloud of points."""

    case: int  # number of the case in the tables; 0 for what belongs to no case
    name: str  # of the case, or of what else it is
    x: Array  # shape (n,); what is not finite is a gap
    y: Array
    role: Literal["case", "law", "truth"] = "case"  # a law is drawn thin over its case; the truth is neutral
    note: str = ""  # what the law says
    joined: bool = True  # whether a line goes through the points


@dataclass(frozen=True)
class Panel:
    """One pair of axes with what is drawn in it."""

    title: str
    x: Axis
    y: Axis
    traces: Sequence[Trace]
    square: bool = False


@dataclass(frozen=True)
class Plot:
    """All that a figure shows."""

    panels: Sequence[Panel] = field(default_factory=list)  # side by side
    # curves over x, one point per case, paths in a plane, or many points per case
    kind: Literal["lines", "points", "paths", "dots"] = "lines"


def as_json(plot: Plot) -> dict[str, Any]:
    """Return a plot for the page; numbers have `DIGITS` digits, gaps are null."""
    return {
        "kind": plot.kind,
        "panels": [
            vars(panel)
            | {
                "x": vars(panel.x),
                "y": vars(panel.y),
                "traces": [
                    vars(trace) | {"x": list(map(short, trace.x)), "y": list(map(short, trace.y))}
                    for trace in panel.traces
                    if trace.x.size
                ],
            }
            for panel in plot.panels
        ],
    }


def as_csv(plot: Plot) -> bytes:
    """Return a plot as text: one line per point."""
    rows: list[tuple[object, ...]] = [("panel", "case", "name", "kind", "x", "y")]
    for panel in plot.panels:
        for trace in panel.traces:
            of = (panel.title, trace.case or "", trace.name, trace.role)
            points = zip(map(short, trace.x.tolist()), map(short, trace.y.tolist()), strict=True)
            rows += [(*of, *("" if v is None else repr(v) for v in point)) for point in points]
    return csv_of(rows)


def numbers(plot: Plot) -> Table:
    """Return a table of what a figure shows, short enough to be read aloud."""
    traces = [(panel, trace) for panel in plot.panels for trace in panel.traces]
    cases = [(panel, trace) for panel, trace in traces if trace.role == "case"]
    many = len(plot.panels) > 1
    firsts = [(str(trace.case or ""), trace.name, panel.title * many) for panel, trace in cases]
    head: tuple[str, ...] = ("#", "case", "panel")
    if plot.kind == "lines":
        ends = [trace.x[np.isfinite(trace.x)] for _, trace in cases if trace.x.size]
        places = _places(ends, log=bool(plot.panels) and plot.panels[0].x.log)
        laws = {(panel.title, trace.case): trace.note for panel, trace in traces if trace.role == "law"}
        head = (*head, *(f"at {place:.3g}" for place in places), "largest", "law")
        found = [
            [(*(_at(trace, place) for place in places), _range(np.abs(trace.y))[1], laws.get(key, ""))]
            for key, trace in (((panel.title, trace.case), trace) for panel, trace in cases)
        ]
    elif plot.kind == "points":
        head = (*head, "x", "y")
        found = [[(_text(x), _text(y)) for x, y in zip(t.x, t.y, strict=True)] for _, t in cases]
    else:
        head = (*head, "points", "x from", "to", "y from", "to")
        found = [[(str(trace.x.size), *_range(trace.x), *_range(trace.y))] for _, trace in cases]
    rows = [(*first, *one) for first, each in zip(firsts, found, strict=True) for one in each]
    return Table("", head, rows, words=range(3))


def short(value: float) -> float | None:
    """Return a number with `DIGITS` digits; ``None`` for what is not finite."""
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def _places(xs: Sequence[Array], *, log: bool) -> list[float]:
    every = np.concatenate([np.empty(0), *xs])
    if not every.size:
        return []
    space = np.geomspace if log and every.min() > 0 else np.linspace
    return space(every.min(), every.max(), TABLE_COLUMNS).tolist()


def _at(trace: Trace, place: float) -> str:
    """Return the value at the point nearest to a place; curves are not extended."""
    known = np.isfinite(trace.x)
    x, y = trace.x[known], trace.y[known]
    if x.size == 0 or place > x[-1] * (1 + 1e-3) + 1e-12 or place < x[0] - NEAR * (x[-1] - x[0]):
        return "–"
    return _text(float(y[np.argmin(np.abs(x - place))]))


def _range(values: Array) -> tuple[str, str]:
    values = values[np.isfinite(values)]
    return (_text(float(values.min())), _text(float(values.max()))) if values.size else ("–", "–")


def _text(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "–"
