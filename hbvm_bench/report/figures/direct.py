"""Lines that carry their names: at most seven in a panel, each labelled at its right end."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

MOST = 7  # lines in a panel: of more none can be followed by eye
GAP = 10.0  # points between two labels


class End(NamedTuple):
    """Where a line ends, and what it is called there."""

    label: str
    y: float
    colour: str


def label(axes: Axes, ends: Sequence[End]) -> None:
    """Write the names of lines right of the axes, each at the height of its end, pushed apart where needed.

    The axes must have their final limits and place in the figure.
    """
    if not ends:
        return
    figure = axes.get_figure(root=True)
    assert figure is not None
    points = 72.0 / figure.dpi
    box = axes.get_window_extent()
    heights = [float(axes.transData.transform((1.0, end.y))[1]) for end in ends]
    order = np.argsort(heights)
    places = np.clip(np.array(heights)[order], box.y0, box.y1) * points
    for _ in range(50):  # neighbours that are too close share the distance that is missing
        missing = np.maximum(GAP - np.diff(places), 0.0)
        if missing.max(initial=0.0) < 0.1:
            break
        places[:-1] -= missing / 2
        places[1:] += missing / 2
    for place, index in zip(places, order, strict=True):
        end = ends[index]
        share = (place / points - box.y0) / box.height
        look = {"color": end.colour, "fontsize": 8, "va": "center", "annotation_clip": False}
        axes.annotate(end.label, (1.0, share), xytext=(5, 0), xycoords="axes fraction",
                      textcoords="offset points", **look)  # fmt: skip
