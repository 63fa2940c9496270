"""What a figure shows, as numbers, for the table beside it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.summaries.table import Table

Array = NDArray[np.float64]

NEAR = 0.02  # of a curve's length before its first point: a bin of an envelope may begin so late
TABLE_COLUMNS = 6  # places on the horizontal axis that the table of a curve shows


@dataclass(frozen=True)
class Axis:
    """One axis: its label, and whether it is logarithmic."""

    label: str
    log: bool = False


@dataclass(frozen=True)
class Trace:
    """One curve or one cloud of points."""

    case: int  # number of the case in the tables; 0 for what belongs to no case
    name: str  # of the case, or of what else it is
    x: Array  # shape (n,); what is not finite is a gap
    y: Array
    role: Literal["case", "fit", "reference"] = "case"  # a fit is thin, a reference grey
    note: str = ""  # what the fit says


@dataclass(frozen=True)
class Panel:
    """One pair of axes with what is drawn in it."""

    title: str
    x: Axis
    y: Axis
    traces: Sequence[Trace]


@dataclass(frozen=True)
class Plot:
    """All that a figure shows."""

    panels: Sequence[Panel] = field(default_factory=list)  # side by side
    # curves over x, one point per case, paths in a plane, or many points per case
    kind: Literal["lines", "points", "paths", "dots"] = "lines"


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
        fits = {(panel.title, trace.case): trace.note for panel, trace in traces if trace.role == "fit"}
        head = (*head, *(f"at {place:.3g}" for place in places), "largest", "growth")
        cells = [
            [(*(_at(trace, place) for place in places), _range(np.abs(trace.y))[1], fits.get(key, ""))]
            for key, trace in (((panel.title, trace.case), trace) for panel, trace in cases)
        ]
    elif plot.kind == "points":
        head = (*head, "x", "y")
        cells = [[(_text(x), _text(y)) for x, y in zip(t.x, t.y, strict=True)] for _, t in cases]
    else:
        head = (*head, "points", "x from", "to", "y from", "to")
        cells = [[(str(trace.x.size), *_range(trace.x), *_range(trace.y))] for _, trace in cases]
    rows = [(*first, *row_) for first, each in zip(firsts, cells, strict=True) for row_ in each]
    return Table("", head, rows, words=range(3))


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
