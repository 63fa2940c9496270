"""The pictures of a race: work against precision, energy and position side by side."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hbvm_bench.report.figures.canvas import Picture, log_axis, new, picture, styled
from hbvm_bench.report.figures.plots import named
from hbvm_bench.report.figures.style import MUTED, PAPER, Look
from hbvm_bench.store.records import Record
from hbvm_bench.studies.race.families import FAMILIES, FIXED, OURS, OWN, FamilyRow
from hbvm_bench.studies.race.results import ENERGY, POSITION, Race, counts
from hbvm_bench.studies.race.tables import power
from hbvm_bench.summaries.points import family_of, number, pareto_front
from hbvm_bench.summaries.standings import TIME

FLOOR = -17  # power of ten: smaller errors, exactly 0 among them, are drawn here
TOP = 1
DOTTED = (0, (1, 1.2))
SECONDS = "seconds per integration (median)"


@styled
def work_precision(race: Race, look: Mapping[str, Look]) -> Picture | None:
    """Draw errors against time; ``None`` without a setting that may be compared."""
    counted = ((row, [record for record in records if counts(record)]) for row, records in race.rows.items())
    rows = {row: records for row, records in counted if records}
    if not rows:
        return None
    figure = new(7.6, 5.0)  # narrow enough that its labels can be read on a phone
    left, right = figure.subplots(1, 2)
    figure.subplots_adjust(left=0.07, right=0.98, top=0.94, bottom=0.31, wspace=0.22)
    for axes, title, level, key in (
        (left, "energy error", race.asked[0], ENERGY),
        (right, "position error at the end", race.asked[1], POSITION),
    ):
        _panel(axes, f"{title}, relative", level, key, rows, look)
    _legend(figure, list(dict.fromkeys(row.family for row in rows)), look)
    energy, position = map(power, race.asked)
    return picture(
        figure,
        f"work-precision-{race.key}",
        f"Work and precision: {race.title}",
        "Every marker is a setting; lower left is better. A filled marker has a fixed step size, an open "
        "one an adaptive step size. A line is the Pareto front of a row in time and this error, dotted "
        f"where the step size is adaptive. Dashed: the required accuracy, {energy} and {position}. Settings "
        "that left the trajectory are not drawn.",
        _summary(race),
    )


def _panel(
    axes: Axes,
    title: str,
    level: float,
    key: str,
    rows: Mapping[FamilyRow, Sequence[Record]],
    look: Mapping[str, Look],
) -> None:
    """Draw one error against time."""
    shown = [record for records in rows.values() for record in records]
    times = [_seconds(record) for record in shown]
    low, high = math.floor(math.log10(min(times))), math.ceil(math.log10(max(times)))
    worst = max(_height(record, key) for record in shown)
    log_axis(axes, "x", low, max(high, low + 1))
    log_axis(axes, "y", FLOOR, max(math.ceil(math.log10(worst)), round(math.log10(level)) + 1), most=9)
    axes.axhline(level, color=MUTED, linewidth=0.8, linestyle=(0, (3, 3)))
    for row, records in rows.items():
        line = pareto_front(records, lambda o: (_seconds(o), _error(o, key)))
        x, y = np.array([(_seconds(o), _height(o, key)) for o in line]).T
        colour, own = look[family_of(records[0])].light, row.steps == OWN
        axes.plot(x, y, color=colour, linewidth=1.1, linestyle=DOTTED if own else "solid")
        for record in records:
            mark = look[family_of(record)]
            axes.plot(
                [_seconds(record)],
                [_height(record, key)],
                mark.marker,
                color=mark.light,
                markerfacecolor=PAPER if own else mark.light,
                markersize=5.0 if record in line else 3.6,
                clip_on=False,
                label=named(mark.number, record.case.method),
            )
    axes.set(xlabel=SECONDS, title=title)


def _height(record: Record, key: str) -> float:
    return min(max(_error(record, key), 10.0**FLOOR), 10.0**TOP)


def _seconds(record: Record) -> float:
    return number(record, TIME) or 1.0


def _error(record: Record, key: str) -> float:
    return number(record, key) or 0.0


def _legend(figure: Figure, families: Sequence[str], look: Mapping[str, Look]) -> None:
    handles: list[Line2D] = []
    for family in families:
        for name in ("HBVM", "Gauss") if family == OURS else (family,):
            if name in look:
                label = name if family == OURS else FAMILIES[family].title
                own = look[name]
                handles.append(Line2D([], [], color=own.light, marker=own.marker, markersize=5, label=label))
    mark = {"color": MUTED, "marker": "o", "markersize": 5}
    handles.append(Line2D([], [], linestyle="solid", label=FIXED, **mark))
    handles.append(Line2D([], [], linestyle=DOTTED, label=OWN, mfc=PAPER, **mark))
    figure.legend(handles=handles, loc="lower center", ncols=3, frameon=False, fontsize=8.5)


def _summary(race: Race) -> str:
    energy, position = race.asked
    said = []
    for row in race.rows:
        best = race.best(row, energy, position)
        said.append(
            f"{row.title}, does not reach it"
            if best is None
            else f"{row.title}, takes {_seconds(best):.3g} s"
        )
    return f"With an energy error of {energy:.0e} and a position error of {position:.0e}: {'; '.join(said)}."
