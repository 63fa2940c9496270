"""The observable that a problem declares, and step sizes where a library tells them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure.observables import observables
from hbvm_bench.reference.solutions import Reference
from hbvm_bench.report.figures.canvas import Picture, log_axis, new, picture, say
from hbvm_bench.report.figures.over_time import WIDTH, Drawn, family_panels, panel_legend
from hbvm_bench.report.figures.plots import named
from hbvm_bench.report.figures.style import INK
from hbvm_bench.summaries.rows import status_of
from problems.problem import Problem

Array = NDArray[np.float64]

LAST = 15  # the last one of so many parts of the interval is drawn
ROOM = 1.9  # times the largest value of the reference: what is farther away has left the picture


def observed(problem: Problem, cases: Sequence[Drawn], reference: Reference | None) -> Picture | None:
    """Draw the first observable of a problem over the last part of the interval, a panel per family."""
    declared = list(observables(problem).items())
    start = problem.t_end - (problem.t_end - problem.t0) / LAST
    shown = [case for case in cases if case.series["t"].size and case.series["t"][-1] > start]
    if not declared or not shown or reference is None:
        return None
    label, of = declared[0]
    reach = ROOM * float(np.abs(of(reference.high)).max())
    figure, grid = family_panels(shown, label)
    late = reference.t >= start
    known = reference.t[late], of(reference.high[late])
    for axes, members in grid:
        for case in members:
            t, values = case.series["t"], of(case.series["y"])
            kept = (t >= start) & (np.abs(values) <= reach)
            name = named(case.look.number, case.record.case.method)
            axes.plot(t[kept], values[kept], color=case.look.light, dashes=case.look.dash, label=name)
        axes.plot(*known, "o", mfc="none", color=INK, ms=5, clip_on=False, zorder=5)
        axes.set(xlim=(start, problem.t_end), ylim=(-reach, reach))
        panel_legend(axes, members)
    whole = [case for case in shown if case.series["t"][-1] == problem.t_end]
    ends = "; ".join(f"{c.record.case.method}: {of(c.series['y'][-1:])[0]:.4g}" for c in whole)
    return picture(
        figure,
        "observable",
        f"{label[:1].upper()}{label[1:]}, the last {problem.t_end - start:g} time units",
        "Rings: the stored 128-bit reference. A missing line has left the axes. A curve that misses the "
        "rings has a wrong position, whatever its energy error.",
        f"{label} at t = {problem.t_end:g}. {ends}.",
    )


def step_sizes(cases: Sequence[Drawn]) -> Picture | None:
    """Draw the step sizes of the cases that stalled, against time and against the step's number."""
    stalled = [case for case in cases if case.record.result.outcome == "stalled"]
    shown = [case for case in stalled if np.any(case.series.get("extra.dt_history", 0.0))]
    if not shown:
        return None
    figure = new(WIDTH, 3.4)
    figure.subplots_adjust(left=0.07, right=0.98, top=0.97, bottom=0.15)
    left, right = figure.subplots(1, 2)
    low = 0
    for case in shown:
        t, dt = case.series["extra.dt_history"][:, :2].T
        t, dt = t[dt != 0], np.abs(dt[dt != 0])
        low = min(low, int(np.floor(np.log10(dt.min()))) - 1)
        every = max(1, len(dt) // 60)
        look = {"color": case.look.light, "marker": case.look.marker, "markersize": 2, "markevery": every}
        for axes, x in ((left, t), (right, np.arange(1.0, len(dt) + 1))):
            axes.plot(x, dt, label=named(case.look.number, case.record.case.method), **look)
        said = f"{case.look.number}  {case.record.case.method}: {status_of(case.record)}"
        say(left, said, (t[-1], dt.min()), (-8, 4), ha="right", fontsize=8)
    titles = ("time", "recorded step")
    for axes, title in zip((left, right), titles, strict=True):
        log_axis(axes, "y", low, 1)
        axes.set(xlabel=title, ylabel="step size dt")
    return picture(
        figure,
        "step-sizes",
        "Step sizes of stalled runs",
        "The watchdog ended the run because the time no longer advanced; no time limit was reached.",
        "; ".join(f"{c.record.case.method}: {c.record.result.reason}" for c in shown) + ".",
    )
