"""Figures as deterministic SVG, which takes the colours of a page: the one way in which pages are drawn."""

import io
import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from numpy.typing import NDArray

from hbvm_bench.report.figures.style import GRID, INK, MUTED, PAPER
from hbvm_bench.summaries.table import NONE, Table

P = ParamSpec("P")
T = TypeVar("T")

FONT = "DejaVu Sans"
WIDTH = 5.6  # inches: legible in a column of a page and on a phone
SETTINGS: Any = {
    "svg.fonttype": "none",  # text stays text: it can be read aloud, searched and selected
    "svg.hashsalt": "hbvm-bench",
    "font.family": FONT,
    "font.size": 9,
    **dict.fromkeys(("text.color", "axes.labelcolor"), INK),
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), MUTED),
    **dict.fromkeys(("figure.facecolor", "axes.facecolor", "savefig.facecolor"), PAPER),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right"), False),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize"), 8),
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.linewidth": 0.7,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "legend.handlelength": 2.6,
    "path.simplify": True,
    "path.simplify_threshold": 0.4,
}
NUMBERS = ("line", "panel", "points", "x from", "to", "y from", "to", "last y")
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


@dataclass(frozen=True)
class Picture:
    """A figure of a report."""

    key: str  # its file name without the ending, and its anchor
    title: str
    caption: str
    summary: str  # what it shows, for those who do not see it
    svg: str
    numbers: Table | None = None  # what it shows
    values: bool = False  # whether its colours mean values, so that no theme may brighten them

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[\w-]+", self.key):
            raise ValueError(f"{self.key!r} can be no anchor and no file name")

    @property
    def file(self) -> str:
        """Its path beside a report."""
        return f"figures/{self.key}.svg"


def styled(draw: Callable[P, T]) -> Callable[P, T]:
    """Have a function draw in the style of the reports, so that all figures look alike."""

    @wraps(draw)
    def in_style(*args: P.args, **kwargs: P.kwargs) -> T:
        with mpl.rc_context(SETTINGS):
            return draw(*args, **kwargs)

    return in_style


def picture(
    figure: Figure, key: str, title: str, caption: str, summary: str, *, values: bool = False
) -> Picture:
    """Render a figure; the same figure gives the same bytes."""
    svg = io.StringIO()
    with mpl.rc_context(SETTINGS | {"svg.hashsalt": f"hbvm-bench-{key}"}):
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    text = svg.getvalue()
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    # Verdana is as wide as DejaVu Sans, so that labels keep their places where that is missing
    text = text.replace(f"'{FONT}'", f"'{FONT}', Verdana, sans-serif")
    return Picture(key, title, caption, summary, text, numbers(figure), values=values)


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
    return Table("", NUMBERS, rows, words=range(2)) if rows else None


def _range(values: NDArray[np.float64]) -> tuple[str, str]:
    finite = values[np.isfinite(values)]
    return (f"{finite.min():.3g}", f"{finite.max():.3g}") if finite.size else (NONE, NONE)


def new(width: float, height: float) -> Figure:
    """Return an empty figure of ``width`` × ``height`` inches."""
    return Figure(figsize=(width, height))


def say(
    axes: Axes, text: str, at: tuple[float, float], offset: tuple[float, float] = (0, 0), **look: object
) -> None:
    """Write beside a point, so many points to the right and up."""
    given = {"fontsize": 8.5, "color": INK, **look}
    axes.annotate(text, at, xytext=offset, textcoords="offset points", **given)  # type: ignore[arg-type]


def log_axis(axes: Axes, which: str, low: int, high: int, *, most: int = 7) -> None:
    """Give an axis powers of ten from 10^low to 10^high, a decade at least, and at most so many labels."""
    high = max(high, low + 1)
    stride = max(1, -(-(high - low) // most))
    ticks = [10.0**power for power in range(low, high + 1) if (power - high) % stride == 0]
    axis = axes.xaxis if which == "x" else axes.yaxis
    (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    (axes.set_xlim if which == "x" else axes.set_ylim)(10.0**low, 10.0**high)
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_label(value)))


def power_range(values: Iterable[NDArray[np.float64]], low: int, high: int) -> tuple[int, int]:
    """Return the powers of ten between which positive values lie, within ``low`` and ``high``."""
    together = np.concatenate([np.empty(0), *values])
    logs = np.log10(together[(together > 0) & np.isfinite(together)])
    if not logs.size:
        return low, high
    bottom, top = max(low, math.floor(logs.min())), min(high, math.ceil(logs.max()))
    return min(bottom, high - 1), max(top, min(bottom, high - 1) + 1)


def power_label(value: float) -> str:
    """Write a power of ten: ``10⁻¹⁵``."""
    exponent = round(math.log10(value))
    return "1" if exponent == 0 else "10" if exponent == 1 else "10" + str(exponent).translate(_SUPERSCRIPT)
