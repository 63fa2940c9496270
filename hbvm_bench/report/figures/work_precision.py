"""Work and precision: position error and energy error against time, side by side."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.report.figures.canvas import Picture, log_axis, new, picture, say
from hbvm_bench.report.figures.over_time import WIDTH, Drawn
from hbvm_bench.report.figures.plots import named
from hbvm_bench.report.figures.style import MUTED
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import accurate, family_of, number, pareto_front

MOST_NAMED = 30  # cases in the legend
# Where a number may stand beside its point, in points; the first that is free is taken.
SIDES = (
    *((7, 4), (7, -4), (-7, 4), (-7, -4), (0, 9), (0, -9), (9, 0), (-9, 0)),
    *((12, 9), (-12, 9), (12, -9), (-12, -9)),
)


def work_precision(cases: Sequence[Drawn]) -> Picture | None:
    """Draw position error and energy error against time, side by side; energy is not shown alone."""
    keys = ("position_end", "energy_max")
    needed: dict[str, float] = dict.fromkeys((*keys, "warm_seconds"), math.inf)
    shown = [case for case in cases if accurate(case.record, needed)]
    if len(shown) < 2:
        return None
    figure = new(WIDTH, 4.7)
    figure.subplots_adjust(left=0.06, right=0.99, top=0.94, bottom=0.11, wspace=0.2)
    left, right, side = figure.subplots(1, 3, width_ratios=[1, 1, 0.95])
    times = [_number(case.record, "warm_seconds") for case in shown]
    for axes, key in ((left, keys[0]), (right, keys[1])):
        values = [_number(case.record, key) for case in shown]
        floor = 10.0 ** math.floor(math.log10(min(value for value in values if value > 0)))
        top = min(max(values), 1e3)
        log_axis(axes, "x", math.floor(math.log10(min(times))), math.ceil(math.log10(max(times))))
        log_axis(axes, "y", round(math.log10(floor)), math.ceil(math.log10(top * 3)), most=9)
        axes.set_ylim(bottom=floor / 5)  # room for the numbers of the best
        spots = [(s, min(max(value, floor), top * 2)) for s, value in zip(times, values, strict=True)]
        for case, spot, value in zip(shown, spots, values, strict=True):
            marker = case.look.marker if value <= top else "^"
            look = {"color": case.look.light, "label": named(case.look.number, case.record.case.method)}
            axes.plot(*spot, marker, markersize=6.5, clip_on=False, **look)
        _number_points(axes, [(str(case.look.number), spot) for case, spot in zip(shown, spots, strict=True)])
        axes.set(xlabel="seconds per integration (median)", title=METRICS[key].label)
        _envelopes(axes, shown, spots)
    side.set_axis_off()
    handles = []
    for case in sorted(shown, key=lambda case: case.look.number)[:MOST_NAMED]:
        look, name = case.look, f"{case.look.number}  {case.record.case.method}"
        handles.append(Line2D([], [], ls="", color=look.light, marker=look.marker, ms=5.5, label=name))
    if len(shown) > MOST_NAMED:
        handles.append(Line2D([], [], ls="", label=f"and {len(shown) - MOST_NAMED} more, see the table"))
    side.legend(
        handles=handles, loc="center left", bbox_to_anchor=(-0.1, 0.5), borderaxespad=0, handlelength=1
    )
    best = min(shown, key=lambda case: _number(case.record, "position_end"))
    left_out = len(cases) - len(shown)
    return picture(
        figure,
        "work-precision",
        "Work and precision",
        "Lower left is better. The same cases in both panels: energy is never shown without position. "
        f"{left_out} {'case' if left_out == 1 else 'cases'} on another trajectory or ended early are not "
        "shown; points beyond the upper edge are drawn on it. A line is the Pareto front of a method's "
        "settings.",
        f"{len(shown)} cases. The smallest position error, {_number(best.record, 'position_end'):.1e}, "
        f"is that of {best.record.case.method}.",
    )


def _envelopes(axes: Axes, cases: Sequence[Drawn], spots: Sequence[tuple[float, float]]) -> None:
    """Join the settings of each method that none of its others beats in both work and error."""
    for name in dict.fromkeys(family_of(case.record) for case in cases):
        members = [(s, c) for s, c in zip(spots, cases, strict=True) if family_of(c.record) == name]
        best = pareto_front([spot for spot, _ in members], lambda spot: spot)
        if len(best) < 2:
            continue
        x, y = np.array(best).T
        look = members[0][1].look
        axes.plot(x, y, color=look.light, linewidth=0.8, zorder=1)


def _number_points(axes: Axes, points: Sequence[tuple[str, tuple[float, float]]]) -> None:
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
        arrow = {"arrowstyle": "-", "linewidth": 0.5, "color": MUTED, "shrinkA": 0, "shrinkB": 3}
        look = {"ha": align, "va": "center", "fontsize": 7.5, "arrowprops": arrow}
        say(axes, text, spot, offset, annotation_clip=False, **look)


def _crowding(x: float, y: float, taken: Sequence[tuple[float, float, float]]) -> float:
    return sum(max(0.0, 1.0 - math.hypot(x - a, y - b) / (reach + 4.0)) for a, b, reach in taken)


def _number(record: Record, key: str) -> float:
    value = number(record, key)
    assert value is not None
    return value
