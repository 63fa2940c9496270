"""What the figures of studies share: colours, sizes, what their sheets have in common."""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Concatenate, ParamSpec

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from hbvm_bench.report.figures.canvas import Picture, new, picture, styled
from hbvm_bench.report.figures.style import looks
from integrators.protocol import Array

# What is a property of the motion, not of a method, has a look of its own; the reference solution is neutral.
LOOKS = tuple(looks(("Gauss", "HBVM", "Motion")).values())
COLOURS: dict[str, str] = dict(zip(("gauss", "hbvm", "motion"), (look.light for look in LOOKS), strict=True))
SEQUENTIAL = LinearSegmentedColormap.from_list(
    "dusk", ["#f2d9b8", "#d98f4e", "#ab4a3f", "#6b2f5e", "#3a2c66"]
)
WIDTH = 10.4  # inches, of a whole line
P = ParamSpec("P")
Said = tuple[str, str]  # a caption, and a summary for those who do not see the picture


def number(value: float | None, digits: int = 2) -> str:
    """Write a number for a sentence: ``3.4e-3``, ``0.25``, ``–`` for none."""
    if value is None or value != value:
        return "–"
    if value == 0:
        return "0"
    if 1e3 <= abs(value) < 1e6:
        return f"{value:,.0f}"
    if 1e-2 <= abs(value) < 1e3:
        return f"{value:.{max(digits, 3)}g}"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def drawn(
    key: str, title: str, width: float, height: float, *, values: bool = False
) -> Callable[[Callable[Concatenate[Figure, P], Said]], Callable[P, Picture]]:
    """Have a function draw on an empty sheet, of which a picture is made; the same gives the same bytes.

    The sheet is ``width`` times ``height`` inches and makes room for its labels; ``values`` says whether
    colours mean values.
    """

    def decorate(draw: Callable[Concatenate[Figure, P], Said]) -> Callable[P, Picture]:
        @styled
        @wraps(draw)
        def draw_picture(*args: P.args, **kwargs: P.kwargs) -> Picture:
            figure = new(width, height)
            figure.set_layout_engine("constrained")
            caption, summary = draw(figure, *args, **kwargs)
            return picture(figure, key, title, caption, summary, values=values)

        return draw_picture

    return decorate


def heat(
    axes: Axes, x: Sequence[float] | Array, y: Sequence[float], values: Array, low: float, high: float
) -> QuadMesh:
    """Colour cells by the logarithm of their value, from ``low`` to ``high``; blank are those without."""
    axes.grid(visible=False)
    logs = np.ma.masked_invalid(np.log10(values))
    look = {"cmap": SEQUENTIAL.reversed(), "shading": "nearest", "rasterized": True}
    return axes.pcolormesh(x, y, logs, vmin=low, vmax=high, **look)


def legend_above(axes: Axes) -> None:
    """Name the curves in a line above the axes, as wide as can be seen."""
    for line in axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.02), ncols=2).get_lines():
        line.set_linewidth(1.6)
