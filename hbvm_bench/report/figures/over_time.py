"""Errors over time, and what the figures of cases share: their panels and legends."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from hbvm_bench.report.figures.canvas import Picture, log_axis, new, picture
from hbvm_bench.report.figures.plots import named
from hbvm_bench.report.figures.style import INK, MUTED, Look, options, panels
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import family_of, number
from hbvm_bench.summaries.rows import group_of

Array = NDArray[np.float64]

BINS = 60  # an error series is drawn as its largest value in each of so many spans
COLUMNS = 4
# Inches: the panels of all figures over time have one size and stand under each other.
WIDTH, LEFT, RIGHT, GAP = 12.4, 0.9, 0.18, 0.36
HEIGHT, TOP, BOTTOM, LEGEND_LINE = 1.75, 0.28, 0.52, 0.153


@dataclass(frozen=True)
class Drawn:
    """A case with what is needed to draw it."""

    record: Record
    look: Look
    series: dict[str, Array]

    @property
    def position_error(self) -> float:
        """Its position error at the end; infinite where there is none that may be compared."""
        error = number(self.record, "position_end")
        return math.inf if error is None else error

    @property
    def short(self) -> str:
        """Its number and the name of its method."""
        return f"{self.look.number}  {family_of(self.record)}"

    def legend(self, *, named: bool) -> str:
        """Return its number, its name if ``named``, its options, and a mark where it failed."""
        mark = {"off": " †", "ended": " ‡"}.get(group_of(self.record), "")
        name = f"{family_of(self.record)}  " if named else ""
        return f"{self.look.number}  {name}{options(self.record)}{mark}"


@dataclass(frozen=True)
class OverTime:
    """What a figure of an error over time shows."""

    key: str
    title: str
    label: str  # of the axis
    values: str  # name of the series that is drawn; one that ends in a dot is the first that begins so
    low: int  # powers of ten of the axis
    high: int
    caption: str
    t: str = "t"
    zero: bool = False  # whether "exactly 0" is a place on the axis
    joined: bool = True  # whether the samples are joined and binned (else: drawn as markers)

    def get(self, series: dict[str, Array]) -> tuple[Array, Array] | None:
        """Return times and values of a case; ``None`` where it has none."""
        names = [name for name in series if self.values in (name, f"{name.split('.')[0]}.")]
        return (series[self.t], series[names[0]]) if names and series[self.t].size else None


def over_time(cases: Sequence[Drawn], spec: OverTime) -> Picture | None:
    """Draw an error over time, a panel per family; ``None`` if no case has it."""
    shown = [case for case in cases if spec.get(case.series) is not None]
    if not shown:
        return None
    figure, grid = family_panels(shown, spec.label)
    for axes, members in grid:
        log_axis(axes, "y", spec.low, spec.high, zero=10.0**spec.low if spec.zero else None)
        axes.grid(visible=False, axis="x")
        ends = [case.series["t"][[0, -1]] for case in shown]
        axes.set_xlim(min(end[0] for end in ends), max(end[1] for end in ends))
        for case in members:
            _draw_error(axes, case, spec)
        panel_legend(axes, members, markers=not spec.joined)
    largest = []
    for case in shown:
        _, values = _finite(case, spec)
        largest.append(
            f"{case.record.case.method}: {f'{values.max():.1e}' if values.size else 'none finite'}"
        )
    summary = f"{spec.title}, largest values. {'; '.join(largest)}."
    return picture(figure, spec.key, spec.title, spec.caption, summary)


def _finite(case: Drawn, spec: OverTime) -> tuple[Array, Array]:
    got = spec.get(case.series)
    assert got is not None
    t, values = got
    finite = np.isfinite(values)
    return t[finite], np.abs(values[finite])


def family_panels(
    cases: Sequence[Drawn], label: str, notes: Mapping[str, str] | None = None
) -> tuple[Figure, list[tuple[Axes, list[Drawn]]]]:
    """Return a figure with a panel for each of `style.panels`, of one size, with room for `panel_legend`."""
    by_id = {case.record.id: case for case in cases}
    groups = [(name, [by_id[r.id] for r in members]) for name, members in panels([c.record for c in cases])]
    rows = [groups[start : start + COLUMNS] for start in range(0, len(groups), COLUMNS)]
    heights = [
        TOP + HEIGHT + BOTTOM + LEGEND_LINE * max(_lines(members, notes) for _, members in row)
        for row in rows
    ]
    figure = new(WIDTH, sum(heights))
    panel = (WIDTH - LEFT - RIGHT - GAP * (COLUMNS - 1)) / COLUMNS
    panels_: list[tuple[Axes, list[Drawn]]] = []
    ceiling = sum(heights)
    for row, used in zip(rows, heights, strict=True):
        for column, (name, members) in enumerate(row):
            x, y = LEFT + column * (panel + GAP), ceiling - TOP - HEIGHT
            axes = figure.add_axes((x / WIDTH, y / sum(heights), panel / WIDTH, HEIGHT / sum(heights)))
            axes.set_title(name, color=INK)
            axes.text(1.0, -0.2, "time", transform=axes.transAxes, ha="right", fontsize=8, color=MUTED)
            axes.xaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
            if column == 0:
                axes.set_ylabel(label)
                axes.yaxis.set_label_coords(-0.72 / panel, 0.5)
            else:
                axes.tick_params(labelleft=False)
            panels_.append((axes, members))
        ceiling -= used
    return figure, panels_


def panel_legend(
    axes: Axes,
    cases: Sequence[Drawn],
    *,
    markers: bool = False,
    notes: Mapping[str, str] | None = None,
) -> None:
    """Put the legend under its panel, where it covers no data; ``notes`` are added by case id."""
    handles = []
    for case, label in zip(cases, _labels(cases, notes or {}), strict=True):
        look, marker = case.look, case.look.marker if markers else ""
        handles.append(Line2D([], [], color=look.light, dashes=look.dash, marker=marker, ms=4, label=label))
    size = 6.8 if notes else 7.5
    axes.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(-0.03, -0.23), borderaxespad=0, fontsize=size
    )


def _labels(cases: Sequence[Drawn], notes: Mapping[str, str]) -> list[str]:
    named = len({family_of(case.record) for case in cases}) > 1
    return [entry(case.legend(named=named), notes.get(case.record.id, "")) for case in cases]


def _lines(cases: Sequence[Drawn], notes: Mapping[str, str] | None) -> int:
    """Return how many lines the legend of a panel has."""
    return sum(label.count("\n") + 1 for label in _labels(cases, notes or {}))


def entry(name: str, note: str) -> str:
    """Return a name and its note as a legend's entry, in as many lines as fit under its panel."""
    room = 48 if note else 42  # with notes the letters are smaller
    if note and len(name) + len(note) + 3 <= room:
        return f"{name}   {note}"
    lines = textwrap.wrap(name, room, subsequent_indent="   ", break_on_hyphens=False)
    return "\n".join([*lines, *([f"   {note}"] if note else [])])


def cut(text: str, room: int, kept: int = 0) -> str:
    """Return a text in so much room; of a longer one so much is ``kept``, by default all that fits."""
    return text if len(text) <= room else text[: kept or room] + "…"


def envelope(t: Array, values: Array, bins: int = BINS) -> tuple[Array, Array]:
    """Return the largest value in each of ``bins`` equal time intervals, at the place where it is."""
    if t.size <= bins:
        return t, values
    edges = np.linspace(t[0], t[-1], bins + 1)
    which = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, bins - 1)
    order = np.lexsort((values, which))
    last = np.flatnonzero(np.diff(which[order], append=bins))
    chosen = np.sort(order[last])
    return t[chosen], values[chosen]


def _draw_error(axes: Axes, case: Drawn, spec: OverTime) -> None:
    t, values = _finite(case, spec)
    if t.size == 0:
        return
    if spec.joined:
        t, values = envelope(t, values)
    elif not spec.zero:  # the start is right by definition
        seen = values >= 10.0**spec.low
        t, values = t[seen], values[seen]
    bottom = 10.0**spec.low
    clipped = np.clip(values, bottom * (10.0 if spec.zero else 1.0), 10.0**spec.high)
    drawn = np.where(values == 0, bottom, clipped) if spec.zero else clipped
    name = named(case.look.number, case.record.case.method)
    (line,) = axes.plot(t, drawn, color=case.look.light, dashes=case.look.dash, clip_on=False, label=name)
    if not spec.joined:
        line.set(linewidth=0.7, marker=case.look.marker, markersize=2.6, markevery=max(1, t.size // 10))
