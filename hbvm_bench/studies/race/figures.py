"""The pictures of a race: work against precision, energy and position side by side."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.report.figures.canvas import Picture, drawing, log_axis, new, picture
from hbvm_bench.report.figures.plots import Axis, Panel, Plot, Trace
from hbvm_bench.report.figures.style import INK, MUTED, Look
from hbvm_bench.studies.race import standings
from hbvm_bench.studies.race.results import Outcome, Race
from hbvm_bench.studies.race.settings import FAMILIES, OURS
from hbvm_bench.studies.race.tables import asked, power

FLOOR = -17  # power of ten: smaller errors, exactly 0 among them, are drawn here
TOP = 1


def work_precision(race: Race, look: Mapping[str, Look]) -> Picture | None:
    """Draw errors against time; ``None`` without a setting that may be compared.

    Parameters
    ----------
    race : Race
        Results of one contest.
    look : mapping of str to Look
        By a method's name.
    """
    shown = [outcome for outcome in race.outcomes if outcome.counts]
    if not shown:
        return None
    with drawing():
        figure = new(10.4, 4.6)
        left, right, side = figure.subplots(1, 3, width_ratios=[1, 1, 0.52])
        times = [outcome.median or 1.0 for outcome in shown]
        low, high = math.floor(math.log10(min(times))), math.ceil(math.log10(max(times)))
        levels = asked(race)
        panels: list[Panel] = []
        figure.subplots_adjust(left=0.055, right=0.995, top=0.93, bottom=0.11, wspace=0.2)
        for axes, title, level, key in (
            (left, "energy error", levels[0], "energy"),
            (right, "position error at the end", levels[1], "position"),
        ):
            log_axis(axes, "x", low, max(high, low + 1))
            worst = max(_height(outcome, key) for outcome in shown)
            log_axis(
                axes, "y", FLOOR, max(math.ceil(math.log10(worst)), round(math.log10(level)) + 1), most=9
            )
            axes.axhline(level, color=MUTED, linewidth=0.8, linestyle=(0, (3, 3)))
            for family in standings.present(race):
                _draw(axes, [o for o in shown if o.setting.family == family], key, look)
            axes.set_xlabel("seconds for the whole span (median)")
            axes.set_title(f"{title}, relative", color=INK)
            panels.append(_panel(race, shown, f"{title}, relative", level, key, look))
        _legend(side, [f for f in standings.present(race) if any(o.setting.family == f for o in shown)], look)
    energy, position = (power(level) for level in levels)
    return picture(
        figure,
        f"work-precision-{race.contest.key}",
        f"Work and precision: {race.contest.title}",
        "Every setting is a mark, lower left is better. Lines join the settings of a family that none of its "
        f"others beats in both time and this error. Dashed: what is asked for, {energy} and {position}. Only "
        "settings on the trajectory that was asked for are drawn.",
        _summary(race),
        Plot(panels, "points"),
    )


def _panel(
    race: Race, shown: Sequence[Outcome], title: str, level: float, key: str, look: Mapping[str, Look]
) -> Panel:
    traces = []
    for outcome in shown:
        text = outcome.setting.method
        spot = np.array([outcome.median or 0.0]), np.array([getattr(outcome, key)])
        traces.append(Trace(look[parse_spec(text).name].number, text, *spot))
    for family in standings.present(race):
        line = front([o for o in shown if o.setting.family == family], key)
        if len(line) > 1:
            x, y = np.array([(o.median or 0.0, _height(o, key)) for o in line]).T
            number = look[parse_spec(line[0].setting.method).name].number
            note = "none of the family's settings is better in both"
            traces.append(Trace(number, f"best of {FAMILIES[family].title}", x, y, "law", note))
    times = [outcome.median or 1.0 for outcome in shown]
    asked_for = np.array([min(times), max(times)]), np.array([level, level])
    traces.append(Trace(0, "what is asked for", *asked_for, "law"))
    return Panel(
        title,
        Axis("seconds for the whole span (median)", log=True),
        Axis(title, log=True, low=FLOOR, high=TOP),
        traces,
    )


def front(outcomes: Sequence[Outcome], key: str) -> list[Outcome]:
    """Return the settings that none other beats in both time and error, by ascending time."""
    best: list[Outcome] = []
    least = math.inf
    for outcome in sorted(outcomes, key=lambda o: (o.median or 0.0, getattr(o, key))):
        if getattr(outcome, key) < least:
            best.append(outcome)
            least = getattr(outcome, key)
    return best


def _draw(axes: Axes, outcomes: Sequence[Outcome], key: str, look: Mapping[str, Look]) -> None:
    if not outcomes:
        return
    line = front(outcomes, key)
    lead = look[parse_spec(outcomes[0].setting.method).name].light
    axes.plot([o.median or 0.0 for o in line], [_height(o, key) for o in line], color=lead, linewidth=1.1)
    for outcome in outcomes:
        own = look[parse_spec(outcome.setting.method).name]
        axes.plot(
            [outcome.median or 0.0],
            [_height(outcome, key)],
            own.marker,
            color=own.light,
            markersize=5.0 if outcome in line else 3.6,
            clip_on=False,
        )


def _height(outcome: Outcome, key: str) -> float:
    return min(max(getattr(outcome, key), 10.0**FLOOR), 10.0**TOP)


def _legend(axes: Axes, families: Sequence[str], look: Mapping[str, Look]) -> None:
    axes.set_axis_off()
    handles: list[Line2D] = []
    for family in families:
        lead = FAMILIES[family].lead
        for name in (lead, "Gauss") if family == OURS else (lead,):
            if name in look:
                label = name if family == OURS else FAMILIES[family].title
                own = look[name]
                handles.append(Line2D([], [], color=own.light, marker=own.marker, markersize=5, label=label))
    axes.legend(handles=handles, loc="center left", borderaxespad=0.0, fontsize=8.5)


def _summary(race: Race) -> str:
    energy, position = asked(race)
    said = []
    for family in standings.present(race):
        found = standings.best(race, family, energy, position)
        said.append(
            f"{FAMILIES[family].title} does not reach it"
            if found is None
            else f"{FAMILIES[family].title} takes {found.median:.3g} s"
        )
    return f"With an energy error of {energy:.0e} and a position error of {position:.0e}: {'; '.join(said)}."
