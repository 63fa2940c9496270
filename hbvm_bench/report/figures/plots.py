"""The numbers behind a figure, read from its labelled lines: a table to open beside it, and to save."""

import numpy as np
from matplotlib.figure import Figure

from hbvm_bench.summaries.table import NONE, Table

HEAD = ("line", "panel", "points", "x from", "to", "y from", "to", "last y")


def numbers(figure: Figure) -> Table | None:
    """Return a table of the lines that have a label and points; ``None`` where none has."""
    rows = []
    for axes in figure.axes:
        for line in axes.get_lines():
            label = str(line.get_label())
            x, y = (np.asarray(values, float) for values in line.get_data())
            if label.startswith("_") or not x.size:
                continue
            finite = y[np.isfinite(y)]
            last = f"{finite[-1]:.3g}" if finite.size else NONE
            rows.append((label, axes.get_title(loc="left"), str(x.size), *_range(x), *_range(y), last))
    return Table("", HEAD, rows, words=range(2)) if rows else None


def _range(values: np.ndarray) -> tuple[str, str]:
    finite = values[np.isfinite(values)]
    return (f"{finite.min():.3g}", f"{finite.max():.3g}") if finite.size else (NONE, NONE)
