"""Numbers beside points, where they cover the least."""

import math
from collections.abc import Sequence

from matplotlib.axes import Axes

from hbvm_bench.report.figures.style import INK, MUTED

# Where a number may stand beside its point, in points; the first that is free is taken.
SIDES = (
    (7, 4),
    (7, -4),
    (-7, 4),
    (-7, -4),
    (0, 9),
    (0, -9),
    (9, 0),
    (-9, 0),
    (12, 9),
    (-12, 9),
    (12, -9),
    (-12, -9),
)


def number_points(axes: Axes, points: Sequence[tuple[str, tuple[float, float]]]) -> None:
    """Write a number beside each point, on the side where it covers the fewest points and numbers."""
    scale = axes.get_figure(root=True).dpi / 72  # pyright: ignore[reportOptionalMemberAccess]
    spots = axes.transData.transform([spot for _, spot in points]) / scale
    taken = [(x, y, 7.0) for x, y in spots]
    for (text, spot), (x, y) in zip(points, spots, strict=True):
        width = 4.9 * len(text)
        offset = min(
            SIDES, key=lambda side: _crowding(x + side[0] + side[0] / 9 * width / 2, y + side[1], taken)
        )
        taken.append((x + offset[0] + offset[0] / 9 * width / 2, y + offset[1], 6.0 + width / 2))
        align = "left" if offset[0] > 0 else "right" if offset[0] < 0 else "center"
        axes.annotate(
            text,
            spot,
            xytext=offset,
            textcoords="offset points",
            ha=align,
            va="center",
            fontsize=7.5,
            color=INK,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "linewidth": 0.5, "color": MUTED, "shrinkA": 0, "shrinkB": 3},
        )


def _crowding(x: float, y: float, taken: Sequence[tuple[float, float, float]]) -> float:
    return sum(max(0.0, 1.0 - math.hypot(x - a, y - b) / (reach + 4.0)) for a, b, reach in taken)
