"""Ratios of times as bars: the strongest other library on each problem; where it is faster, in red."""

from typing import Any

import numpy as np

from hbvm_bench.report.figures.canvas import WIDTH, Picture, new, picture, styled
from hbvm_bench.report.figures.style import INK, MUTED, look
from hbvm_bench.summaries.cost_ratio import strongest
from hbvm_bench.summaries.frame import Frame
from hbvm_bench.summaries.goals import digits

WON, LOST = look("HBVM")[0], look("Motion")[0]
ROW = 0.24  # inches
TICKS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


@styled
def ratios(found: Frame, key: str, level: str = "") -> Picture | None:
    """Draw the ratio of the strongest other family on each problem; ``None`` where there is none.

    Parameters
    ----------
    found : DataFrame
        Of `hbvm_bench.summaries.cost_ratio.ratios`.
    key : str
        The name of the figure's file.
    level : str
        The level of errors that is drawn; by default all. Of several processors that measured last is drawn.
    """
    found = found[found.processor == found.processor.iloc[-1]]
    best = strongest(found[found.level == level] if level else found)
    if best.empty:
        return None
    short = dict(zip(best.problem.unique(), shortened(list(best.problem.unique())), strict=True))
    names = [short[row.problem] for row in best.itertuples()]
    count = len(best)
    figure = new(WIDTH, 0.85 + ROW * count)
    height = figure.get_figheight()
    axes = figure.add_axes((0.5, 0.6 / height, 0.3, ROW * count / height))
    place = np.arange(count)[::-1]
    axes.set_xscale("log")
    for y, row, name in zip(place, best.itertuples(), names, strict=True):
        colour = WON if row.ratio > 1.0 else LOST
        axes.barh(y, row.ratio - 1.0, left=1.0, height=0.62, color=colour)
        edge: Any = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "xytext": (4, 0)}
        look_: Any = {"va": "center", "color": colour, "fontsize": 7.5}
        axes.annotate(f"{digits(row.ratio)}× {row.family}", (1.0, y), **edge, **look_)
        axes.plot([row.ratio], [y], label=f"{name}: {row.family}", alpha=0.0)
    axes.axvline(1.0, color=INK, linewidth=0.9)
    low, high = min(0.5, best.ratio.min() / 1.2), max(2.0, best.ratio.max() * 1.1)
    ticks = [tick for tick in TICKS if low <= tick <= high]
    axes.set_xlim(low, high)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_ylim(-0.6, count - 0.4)
    axes.set_yticks(place, names, fontsize=7.5)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("time relative to HBVM and Gauss", color=MUTED)
    lost = int((best.ratio < 1.0).sum())
    return picture(
        figure,
        key,
        "The fastest other library, relative to HBVM and Gauss",
        "Right of the line HBVM or Gauss is faster; red: the other library is. Measured on "
        f"{best.processor.iloc[0]}." + (f" Errors ≤ {level}." if level else ""),
        "; ".join(
            f"{name}: {row.family} {row.ratio:.2f}"
            for name, row in zip(names, best.itertuples(), strict=True)
        )
        + f". The other library is faster on {lost} of {count}.",
    )


def shortened(titles: list[str]) -> list[str]:
    """Return as much of every title as tells it from the others: what is before its first or second comma."""
    begun = [title.split(", ")[0] for title in titles]
    return [
        title_ if begun.count(title_) == 1 else ", ".join(title.split(", ")[:2])
        for title_, title in zip(begun, titles, strict=True)
    ]
