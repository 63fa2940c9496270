"""The numbers of a figure, read off its drawing: what its curves and points are."""

import re
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from hbvm_bench.report.figures.plots import Axis, Panel, Plot, Trace

Array = NDArray[np.float64]

MOST = 360  # points of one curve that a page carries
MOST_AROUND = 1000  # and of one that turns back, whose corners show
FEWEST = 2  # points that say something


def read_off(figure: Figure, numbers: Mapping[str, int], names: Mapping[int, str]) -> Plot | None:
    """Return what the lines and markers of a finished figure show; ``None`` where it has none.

    Maps, bars and level curves are not among them. ``numbers`` are those of the looks by colour, other
    curves belong to none; ``names`` say by that number what a curve without a label is called. An
    underscore before a label keeps it out of the figure's own legend.
    """
    panels = [_panel(axes, numbers, names) for axes in figure.axes if axes.axison]
    panels = [panel for panel in panels if panel.traces]
    if not panels:
        return None
    curves = all(np.all(np.diff(trace.x) >= 0) for panel in panels for trace in panel.traces)
    return Plot(panels, "lines" if curves else "paths")


def _panel(axes: Axes, numbers: Mapping[str, int], names: Mapping[int, str]) -> Panel:
    traces = []
    for line in axes.get_lines():
        x, y = (np.asarray(values, dtype=np.float64).ravel() for values in line.get_data())
        if line.get_transform() != axes.transData or x.size < FEWEST:
            continue
        if np.all(np.diff(x) <= 0):
            x, y = x[::-1], y[::-1]
        colour = to_hex(line.get_color() if _joined(line) else line.get_markeredgecolor())
        number = numbers.get(colour, 0)
        label = str(line.get_label())
        if not re.fullmatch(r"_child\d+", label):
            name = label.removeprefix("_")  # with it, a legend leaves a curve out
        else:
            name = names.get(number, "reference")
        traces.append(Trace(number, name, *_thinned(x, y), joined=_joined(line)))
    return Panel(
        axes.get_title(loc="left"), _axis(axes, "x"), _axis(axes, "y"), traces, axes.get_aspect() == 1.0
    )


def _axis(axes: Axes, which: str) -> Axis:
    shared = (axes.get_shared_x_axes() if which == "x" else axes.get_shared_y_axes()).get_siblings(axes)
    labels = [getattr(one, f"get_{which}label")() for one in (axes, *shared)]
    return Axis(next(filter(None, labels), which), log=getattr(axes, f"get_{which}scale")() == "log")


def _joined(line: Line2D) -> bool:
    return line.get_linestyle() not in ("None", "none", "", " ")


def _thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """Return at most about `MOST` points; of a curve over x, the least and largest of each stretch."""
    if x.size <= MOST:
        return x, y
    if np.any(np.diff(x) < 0) or not np.isfinite(y).all():
        every = -(-x.size // MOST_AROUND)
        return x[::every], y[::every]
    pieces = np.array_split(np.arange(x.size), MOST // 2)
    kept = np.unique([piece[at] for piece in pieces for at in (y[piece].argmin(), y[piece].argmax())])
    return x[kept], y[kept]
