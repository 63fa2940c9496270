"""Sitnikov's system in space under several methods side by side: the still, and what the page moves."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hbvm_bench.measure.metrics import PLANETOID_Z
from hbvm_bench.report.figures.canvas import Picture, new, picture
from hbvm_bench.report.figures.over_time import WIDTH, Drawn, trace
from hbvm_bench.report.figures.plots import Axis, Panel, Plot
from hbvm_bench.report.figures.style import GRID, INK, MUTED, TRUTH, options
from hbvm_bench.report.figures.views import REVOLUTION
from hbvm_bench.summaries.points import family_of
from hbvm_bench.summaries.rows import status_of

Array = NDArray[np.float64]

FAMILIES = ("Gauss", "HBVM", "Taylor", "IAS15")
EACH = 2  # cases of a family that the page can show
GRAIN = 200  # of the moving view: positions are kept to 1/200 of a length
FAR = 300.0  # what is farther away is drawn at the edge
YAW, PITCH = 0.6, 0.42  # of the camera, in radians
REACH = 4.2
NUMBERS = 90  # places in time of the table and the curves


def chosen(cases: Sequence[Drawn]) -> list[list[Drawn]]:
    """Return for each family the cases to show: as published or by default first, then the most accurate."""
    panes = []
    for family in FAMILIES:
        members = [case for case in cases if family_of(case.record) == family and len(case.series["t"]) > 2]
        if not members:
            continue
        first = next((c for c in members if c.record.case.settings == "as published"), None)
        best = min(members, key=lambda case: case.position_error)
        picked = [case for case in (first, best) if case is not None]
        picked += [c for c in members if c.record.result.outcome != "ok"]
        panes.append(list({case.record.id: case for case in picked}.values())[:EACH])
    return panes


def still(cases: Sequence[Drawn], title: str) -> Picture | None:
    """Draw the system at the end, a pane per method; ``None`` without two methods to compare."""
    panes = chosen(cases)
    if len(panes) < 2:
        return None
    figure = new(WIDTH, 3.6)
    figure.subplots_adjust(left=0.0, right=1.0, top=0.84, bottom=0.0, wspace=0.0)
    grid = figure.subplots(1, len(panes), squeeze=False)[0]
    for axes, pane in zip(grid, panes, strict=True):
        _pane(axes, pane[0])
    shown = [case for pane in panes for case in pane]
    every = max(1, len(panes[0][0].series["t"]) // NUMBERS)
    traces = [trace(c, c.series["t"][::every], c.series["y"][::every, PLANETOID_Z]) for c in shown]
    said = "; ".join(f"{c.record.case.method}: {_fate(c, float(c.series['t'][-1]))}" for c in shown)
    still_picture = picture(
        figure,
        "motion",
        title,
        "The two primaries move around each other in the plane; the planetoid stays on the axis through "
        "their barycentre in the exact solution. The picture shows the last revolution that each run "
        "reached. The animation interpolates between samples half a unit of time apart.",
        f"Where the planetoid is at the end. {said}.",
        Plot([Panel("", Axis("time"), Axis("z of the planetoid"), traces)]),
    )
    view = {"grain": GRAIN, "revolution": REVOLUTION, "camera": [YAW, PITCH], "reach": REACH}
    return replace(still_picture, motion=view | {"panes": [[_case(case) for case in pane] for pane in panes]})


def _case(case: Drawn) -> dict[str, Any]:
    """Return what the page needs to move a case: positions as differences of whole multiples of 1/`GRAIN`."""
    t, y = case.series["t"], case.series["y"][:, :9]
    good = np.isfinite(y).all(axis=1)
    t, y = t[good], np.clip(y[good], -FAR, FAR)
    whole = np.rint(y * GRAIN).astype(np.int64)
    channels = {
        str(i): np.diff(whole[:, i], prepend=0).tolist() for i in range(9) if np.any(whole[:, i] != 0)
    }
    steps = np.rint(np.diff(t, prepend=0.0) * 1e4).astype(np.int64)
    regular = np.all(steps[1:] == steps[1]) if steps.size > 1 else False
    return {
        "number": case.look.number,
        "method": case.record.case.method,
        "end": float(t[-1]) if t.size else 0.0,
        "status": "" if case.record.result.outcome == "ok" else status_of(case.record),
        "t": [float(t[0]), float(steps[1]) / 1e4] if regular else [float(f"{value:.6g}") for value in t],
        "regular": bool(regular),
        "n": int(t.size),
        "channels": channels,
    }


def _pane(axes: Axes, case: Drawn) -> None:
    axes.set_axis_off()
    axes.set(aspect="equal", xlim=(-REACH, REACH), ylim=(-REACH * 0.8, REACH * 0.8))
    angle = np.linspace(0, 2 * math.pi, 80)
    for radius in (1.25, 2.5):
        ring = project(np.c_[radius * np.cos(angle), radius * np.sin(angle), 0 * angle])
        axes.plot(*ring.T, color=GRID, linewidth=0.8)
    axes.plot(*project(np.array([[0, 0, -3.0], [0, 0, 3.0]])).T, color=GRID, linewidth=0.8)
    t, y = case.series["t"], case.series["y"][:, :9]
    good = np.isfinite(y).all(axis=1)
    t, y = t[good], y[good]
    late = t >= t[-1] - REVOLUTION
    primary, planetoid = (TRUTH, 0.8, MUTED, 8), (case.look.light, 1.4, case.look.light, 5)
    for body, (colour, width, dot, size) in enumerate((primary, primary, planetoid)):
        path = project(y[late][:, 3 * body : 3 * body + 3])
        path = path[np.abs(path).max(axis=1) < 3 * REACH]
        axes.plot(*path.T, color=colour, linewidth=width, clip_on=True)
        if len(path) and np.abs(path[-1]).max() < REACH:
            axes.plot(*path[-1], "o", color=dot, markersize=size)
    axes.set_title(
        f"{case.short}  {options(case.record)}\n{_fate(case, float(t[-1]))}",
        color=INK,
        fontsize=7.5,
        loc="center",
    )


def project(points: Array) -> Array:
    """Return points in space, shape (n, 3), as the camera sees them, shape (n, 2)."""
    x, y, z = points.T
    across = x * math.cos(YAW) - y * math.sin(YAW)
    deep = x * math.sin(YAW) + y * math.cos(YAW)
    return np.c_[across, z * math.cos(PITCH) + deep * math.sin(PITCH)]


def _fate(case: Drawn, end: float) -> str:
    if case.record.result.outcome != "ok":
        return status_of(case.record)
    lost = ", off the axis" if case.record.result.violation else ""
    return f"t = {end:g}, z = {case.series['y'][-1, PLANETOID_Z]:.4g}{lost}"
