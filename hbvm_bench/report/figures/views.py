"""Figures that belong to one problem, and step sizes where a library tells them."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure.metrics import PLANETOID_Z
from hbvm_bench.reference.solutions import Reference
from hbvm_bench.report.figures.canvas import Picture, log_axis, new, picture, say
from hbvm_bench.report.figures.over_time import WIDTH, Drawn, cut, family_panels, panel_legend, trace
from hbvm_bench.report.figures.plots import Axis, Panel, Plot, Trace
from hbvm_bench.report.figures.style import INK, MUTED, TRUTH, options
from hbvm_bench.summaries.rows import status_of
from problems.problem import Problem

Array = NDArray[np.float64]
View = Callable[[Problem, Sequence[Drawn], Reference | None], Picture | None]

LAST = 100.0  # time units at the end that the picture of z shows
REACH = 3.2  # of its vertical axis; the planetoid stays within 1.69
REVOLUTION = 21.46  # of the primaries


def axis_motion(problem: Problem, cases: Sequence[Drawn], reference: Reference | None) -> Picture | None:
    """Draw the planetoid's z over the last part of the interval, a panel per family."""
    start = problem.t_end - LAST
    shown = [case for case in cases if case.series["t"].size and case.series["t"][-1] > start]
    if not shown:
        return None
    figure, grid = family_panels(shown, "z of the planetoid")
    curves: list[Trace] = []
    truth: list[Trace] = []
    for axes, members in grid:
        for case in members:
            t, z = case.series["t"], case.series["y"][:, PLANETOID_Z]
            kept = (t >= start) & (np.abs(z) <= REACH)
            axes.plot(t[kept], z[kept], color=case.look.light, dashes=case.look.dash)
            curves.append(trace(case, t[kept], z[kept]))
        if reference is not None:
            late = reference.t >= start
            known = reference.t[late], reference.high[late, PLANETOID_Z]
            axes.plot(*known, "o", mfc="none", color=INK, ms=5, clip_on=False, zorder=5)
            truth = [Trace(0, "128-bit reference", *known, role="reference")]
        axes.set(xlim=(start, problem.t_end), ylim=(-REACH, REACH))
        panel_legend(axes, members)
    whole = [case for case in shown if case.series["t"][-1] == problem.t_end]
    ends = "; ".join(f"{c.record.case.method}: {c.series['y'][-1, PLANETOID_Z]:.4g}" for c in whole)
    return picture(
        figure,
        "axis-motion",
        f"The planetoid on the axis, the last {LAST:.0f} time units",
        "Rings: the stored 128-bit reference. A missing line has left the axes: its planetoid is far away. "
        "A curve that misses the rings has a wrong position, whatever its energy error.",
        f"z at t = {problem.t_end:g}. {ends}.",
        Plot([Panel("", Axis("time"), Axis("z of the planetoid"), [*curves, *truth])]),
    )


def primaries(problem: Problem, cases: Sequence[Drawn], reference: Reference | None) -> Picture | None:
    """Draw the paths of the two primaries at the end over the true ones, a square per case."""
    del reference
    shown = [case for case in cases if case.series["t"].size > 2]
    if not shown:
        return None
    best = min(shown, key=lambda case: case.position_error)
    columns = 9
    rows = -(-len(shown) // columns)
    height = 1.66 * rows
    figure = new(WIDTH, height)
    figure.subplots_adjust(left=0.02, right=0.99, top=1 - 0.2 / height, bottom=0.2 / height)
    grid = figure.subplots(rows, columns, squeeze=False, gridspec_kw={"hspace": 0.32}).ravel().tolist()
    for axes in grid[len(shown) :]:
        axes.set_axis_off()
    curves: tuple[list[Trace], list[Trace]] = ([], [])
    for axes, case in zip(grid, shown, strict=False):
        t = case.series["t"]
        first = best.series["t"] <= REVOLUTION
        last = t >= t[-1] - 3 * REVOLUTION
        for body in (0, 1):
            axes.plot(*path(problem, best, first, body).T, color=TRUTH, linewidth=2.6)
            mine = path(problem, case, last, body).T
            axes.plot(*mine, color=case.look.light, linewidth=0.9)
            curves[body].append(trace(case, *mine[:, ::4]))
        axes.set(xlim=(-3.4, 3.4), ylim=(-3.4, 3.4), aspect="equal")
        axes.set(xticks=[-2.5, 0, 2.5], xticklabels=[], yticks=[-2.5, 0, 2.5], yticklabels=[])
        axes.tick_params(length=0)
        axes.set_title(case.short, fontsize=7, color=INK)
        axes.set_xlabel(cut(options(case.record), 31, 30), fontsize=5.5, color=MUTED, labelpad=1)
    return picture(
        figure,
        "primaries",
        "The paths of the primaries in their plane",
        f"Grey: the first revolution of case {best.look.number}; the exact orbits do not turn. "
        "Colour: the last three revolutions that the run reached. Grid lines at −2.5, 0 and 2.5.",
        "An orbit turned against the grey one shows spurious precession: the step is too large for the "
        "direction of the apsides, whatever the energy error.",
        Plot([Panel(f"primary {i + 1}", Axis("x"), Axis("y"), curves[i]) for i in (0, 1)], "paths"),
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
    curves: tuple[list[Trace], list[Trace]] = ([], [])
    for case in shown:
        t, dt = case.series["extra.dt_history"][:, :2].T
        t, dt = t[dt != 0], np.abs(dt[dt != 0])
        low = min(low, int(np.floor(np.log10(dt.min()))) - 1)
        every = max(1, len(dt) // 60)
        for axes, x, panel in ((left, t, curves[0]), (right, np.arange(1.0, len(dt) + 1), curves[1])):
            axes.plot(x, dt, color=case.look.light, marker=case.look.marker, markersize=2, markevery=every)
            panel.append(trace(case, x, dt))
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
        Plot(
            [
                Panel(t, Axis(t), Axis("step size dt", log=True), c)
                for t, c in zip(titles, curves, strict=True)
            ]
        ),
    )


VIEWS: dict[str, tuple[View, ...]] = {"sitnikov": (axis_motion, primaries)}


def path(problem: Problem, case: Drawn, chosen: NDArray[np.bool_], body: int) -> Array:
    """Return the path of a body in the plane between chosen samples, shape (n, 2), for drawing."""
    t, y = case.series["t"][chosen], case.series["y"][chosen]
    velocity = problem.velocity(y)
    if velocity is None or len(t) < 2 or not np.isfinite(y).all():
        return np.empty((0, 2))
    # cubic Hermite pieces: the samples know their velocities, straight lines would cut the pericentres
    here = slice(3 * body, 3 * body + 2)
    q, v = y[:, here], velocity[:, here]
    h = np.diff(t)[:, None, None]
    u = np.linspace(0, 1, 5)[None, :-1, None]
    q0, q1, v0, v1 = q[:-1, None], q[1:, None], v[:-1, None], v[1:, None]
    begin = (1 + 2 * u) * (1 - u) ** 2 * q0 + u * (1 - u) ** 2 * h * v0
    curve = (begin + u**2 * (3 - 2 * u) * q1 + u**2 * (u - 1) * h * v1).reshape(-1, 2)
    return curve[np.abs(curve).max(axis=1) < 30]
