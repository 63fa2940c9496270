"""Errors over time: one panel, at most seven lines, of each family its most accurate setting."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.report.curves import GROWTH, PREFIX
from hbvm_bench.report.figures.canvas import WIDTH, Picture, log_axis, new, picture, power_range, styled
from hbvm_bench.report.figures.direct import MOST, End, label
from hbvm_bench.report.figures.style import MUTED, look, looks, shade
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import family_of, is_hbvm_or_gauss, number
from hbvm_bench.summaries.rows import group_of, reached
from integrators.protocol import Array

POWERS = (-18, 4)  # an error beyond is no error but a failure, and is in the table
DASHES = ("solid", "dashed", "dashdot", "dotted")  # of several settings of one family
MARK = {"off": " †", "ended": " ‡"}


@dataclass(frozen=True)
class Drawn:
    """A case with its curves, see `hbvm_bench.report.curves`."""

    record: Record
    curves: dict[str, Array]


@dataclass(frozen=True)
class OverTime:
    """What a figure of an error over time shows."""

    key: str
    title: str
    label: str  # of the axis, with its unit
    values: str  # with what the name of the curve begins
    caption: str

    def get(self, case: Drawn) -> Array | None:
        """Return times and values, shape (2, n), of a case; ``None`` where it has none."""
        curves = (curve for name, curve in case.curves.items() if name.startswith(PREFIX + self.values))
        first = next(curves, np.empty(0))
        return first if first.size else None


def telling(cases: Sequence[Drawn]) -> list[Drawn]:
    """Return at most `MOST` cases: of each family the most accurate, HBVM and Gauss first."""

    def rank(case: Drawn) -> tuple[bool, bool, float]:
        errors = [number(case.record, key) for key in ("position_end", "energy_max")]
        error = next((error for error in errors if error is not None), math.inf)
        return not is_hbvm_or_gauss(case.record), not reached(case.record), error

    best: dict[str, Drawn] = {}
    for case in sorted(cases, key=rank):
        best.setdefault(family_of(case.record), case)
    return list(best.values())[:MOST]


def time_label(problem: str) -> str:
    """Return the label of a time axis, with the unit that the problem says."""
    unit = parse_spec(problem).arguments.get("unit")
    return f"time ({unit}s)" if isinstance(unit, str) else "time (units of the problem)"


@styled
def over_time(cases: Sequence[Drawn], spec: OverTime) -> Picture | None:
    """Draw an error over time; ``None`` if no case has it."""
    having = [case for case in cases if spec.get(case) is not None]
    shown = telling(having)
    if not shown:
        return None
    curves = [curve for case in shown if (curve := spec.get(case)) is not None]
    low, high = power_range([values for _, values in curves], *POWERS)
    figure, axes = _axes(spec.label, shown[0].record.case.problem)
    log_axis(axes, "y", low, high)
    look_of = looks(family_of(case.record) for case in shown)
    ends, said = [], []
    for case, (t, values) in zip(shown, curves, strict=True):
        mine = look_of[family_of(case.record)]
        seen = np.clip(values, 10.0**low, 10.0**high)
        name = case.record.case.method
        axes.plot(t, seen, color=mine.light, label=name)
        ends.append(End(family_of(case.record) + MARK.get(group_of(case.record), ""), seen[-1], mine.light))
        said.append(f"{name}: {values.max():.1e}")
    label(axes, ends)
    left = len({family_of(case.record) for case in having}) - len(shown)
    return picture(
        figure,
        spec.key,
        spec.title,
        f"{spec.caption} Of each family its most accurate setting; a line is the largest value in each of 60 "
        "equal time intervals. † lost the symmetry or the energy, ‡ did not reach the end."
        + f" {left} families are in the table only."
        * (left > 0),
        f"Largest values. {'; '.join(said)}.",
    )


@styled
def growth(cases: Sequence[Drawn], key: str = "growth") -> Picture | None:
    """Draw the rms of the energy error over the initial conditions, with its scatter; ``None`` without any.

    Grey: growth as the square root of time, as of unbiased rounding errors.
    """
    having = [case for case in cases if case.curves.get(GROWTH, np.empty((4, 0))).shape[1] > 1]
    shown = having if len(having) <= MOST else telling(having)
    if not shown:
        return None
    drawn = [case.curves[GROWTH] for case in shown]
    starts = max(case.record.case.checks.starts for case in shown)
    figure, axes = _axes(
        f"relative energy error, rms over {starts} initial conditions", shown[0].record.case.problem
    )
    low, high = power_range([rms for _, rms, _, _ in drawn], *POWERS)
    times = np.concatenate([t for t, *_ in drawn])
    log_axis(axes, "x", math.floor(math.log10(times.min())), math.ceil(math.log10(times.max())))
    log_axis(axes, "y", low, high)
    alone = len({family_of(case.record) for case in shown}) == len(shown)
    names = [family_of(case.record) for case in shown] if alone else [*map(cut, told_apart(shown))]
    counted: Counter[str] = Counter()
    ends, said = [], []
    for case, name, (t, rms, least, most) in zip(shown, names, drawn, strict=True):
        family = family_of(case.record)
        colour, dash = shade(look(family)[0], counted[family]), DASHES[counted[family] % len(DASHES)]
        counted[family] += 1
        axes.fill_between(t, np.maximum(least, 10.0**low), most, color=colour, alpha=0.12, linewidth=0)
        axes.plot(t, rms, color=colour, linestyle=dash, label=case.record.case.method)
        ends.append(End(name, rms[-1], colour))
        said.append(f"{case.record.case.method}: {rms[-1]:.1e} at the end")
    guide = np.array([times.max() / 1e3, times.max()])
    axes.plot(guide, 10.0 ** (low + 0.3) * np.sqrt(guide / guide[0]), color=MUTED, linewidth=0.8)
    ends.append(End("√t", 10.0 ** (low + 0.3) * 1e3**0.5, MUTED))
    label(axes, ends)
    return picture(
        figure,
        key,
        "Growth of the energy error",
        "Line: root mean square over the initial conditions; band: 16 % to 84 % of them. Grey: growth as the "
        "square root of time, as of unbiased rounding errors.",
        f"{'; '.join(said)}.",
    )


def _axes(title: str, problem: str) -> tuple[Figure, Axes]:
    figure = new(WIDTH, 3.3)
    axes = figure.add_axes((0.12, 0.15, 0.6, 0.76))
    axes.set_title(title, fontweight="normal")
    axes.set_xlabel(time_label(problem))
    return figure, axes


def told_apart(cases: Sequence[Drawn]) -> list[str]:
    """Return the methods without the arguments that all settings of a method have: ``"Gauss h=1.0"``."""
    specs = [parse_spec(case.record.case.method) for case in cases]
    names = []
    for spec in specs:
        alike = [other.arguments.items() for other in specs if other.name == spec.name]
        own = [item for item in spec.arguments.items() if not all(item in each for each in alike)]
        said = ", ".join(key if value is True else f"{key}={value}" for key, value in own)
        names.append(f"{spec.name} {said}".strip())
    return names


def cut(text: str, room: int = 24) -> str:
    """Return as much of a text as has room beside its line."""
    return text if len(text) <= room else text[: room - 1] + "…"
