"""Work and precision: errors of energy and position against time, one over the other, seven families."""

import math
from collections.abc import Mapping

import numpy as np

from hbvm_bench.report.figures.canvas import WIDTH, Picture, log_axis, new, picture, styled
from hbvm_bench.report.figures.direct import MOST, End, label
from hbvm_bench.report.figures.style import MUTED, looks
from hbvm_bench.store.records import Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.cost_ratio import ENERGY, POSITION
from hbvm_bench.summaries.frame import Frame
from hbvm_bench.summaries.points import accurate, number, pareto_front
from hbvm_bench.summaries.standings import TIME

FLOOR, TOP = 1e-17, 10.0  # smaller errors, exactly 0 among them, are drawn at the floor
PANELS = ((ENERGY, "energy error (relative)"), (POSITION, "position error at the end (relative)"))

BOTH, ALONE = ((0.12, 0.56, 0.64, 0.395), (0.12, 0.08, 0.64, 0.395)), ((0.12, 0.15, 0.64, 0.74),)


@styled
def work_precision(here: Frame, key: str, end: str = "") -> Picture | None:
    """Draw the Pareto front of each family on one problem; ``None`` with fewer than two cases.

    Parameters
    ----------
    here : DataFrame
        The cases of one problem, see `hbvm_bench.summaries.frame.cases`.
    key : str
        The name of the figure's file.
    end : str
        What time the integrations reach, for the caption: ``"12,000 years"``.
    """
    able = here[[accurate(record, {POSITION: math.inf, TIME: math.inf}) for record in here.record]]
    if len(able) < 2:
        return None
    conserved = all(number(record, ENERGY) is not None for record in able.record)
    within: Mapping[str, float] = here.iloc[0].within
    families = {family: list(of.record) for family, of in able.groupby("family", sort=False)}
    shown = sorted(families, key=lambda family: _rank(families[family], within))[:MOST]
    look = looks(shown)
    figure = new(WIDTH, 5.8 if conserved else 3.2)
    seconds = [_number(record, TIME) for family in shown for record in families[family]]
    places = BOTH if conserved else ALONE
    for place, (metric, title) in zip(places, PANELS[-len(places) :], strict=True):
        axes = figure.add_axes(place)
        errors = [_height(record, metric) for family in shown for record in families[family]]
        log_axis(axes, "x", math.floor(math.log10(min(seconds))), math.ceil(math.log10(max(seconds))))
        axes.set_xlim(min(seconds) / 1.3, max(seconds) * 1.3)
        log_axis(axes, "y", math.floor(math.log10(min(errors))), math.ceil(math.log10(max(errors))), most=9)
        axes.set_title(title, fontweight="normal")
        if place is places[-1]:
            axes.set_xlabel("seconds per integration" + (f" to {end}" if end else ""))
        if metric in within:
            axes.axhline(within[metric], color=MUTED, linewidth=0.8, linestyle=(0, (3, 3)))
        ends = []
        for family in shown:
            x, y = np.array(_front(families[family], metric)).T
            mine = look[family]
            axes.plot(x, y, color=mine.light, marker=mine.marker, markersize=3.6, label=family, clip_on=False)
            ends.append(End(family, y[-1], mine.light))
        label(axes, ends)
    left = len(families) - len(shown)
    return picture(
        figure,
        key,
        f"Work and precision: {here.iloc[0].title}",
        "Lower left is better. Lines: the Pareto front of each family's settings in time and this error."
        + " Dashed: the errors asked for." * bool(within)
        + f" {left} slower or less accurate families are in the table only." * (left > 0),
        "; ".join(f"{family}: {_said(families[family], within)}" for family in shown) + ".",
    )


def _front(records: list[Record], metric: str) -> list[tuple[float, float]]:
    """Return the seconds and errors of the settings that no other beats in both."""
    front = pareto_front(records, lambda record: (_number(record, TIME), _number(record, metric)))
    return [(_number(record, TIME), _height(record, metric)) for record in front]


def _rank(records: list[Record], within: Mapping[str, float]) -> tuple[float, float]:
    """Return the time at the errors asked for, infinite where not reached, and the smallest error."""
    best = standings.best(records, within or {POSITION: 1e-6})
    return _number(best, TIME) if best else math.inf, min(_number(record, POSITION) for record in records)


def _said(records: list[Record], within: Mapping[str, float]) -> str:
    best = standings.best(records, within)
    return "does not reach the errors asked for" if best is None else f"{_number(best, TIME):.3g} s"


def _height(record: Record, metric: str) -> float:
    return min(max(_number(record, metric), FLOOR), TOP)


def _number(record: Record, key: str) -> float:
    value = number(record, key)
    assert value is not None
    return value
