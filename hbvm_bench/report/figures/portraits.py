"""Phase portraits, and Poincaré sections of problems with two degrees of freedom."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.report.figures.canvas import Picture, new, picture
from hbvm_bench.report.figures.over_time import WIDTH, Drawn, cut
from hbvm_bench.report.figures.plots import named
from hbvm_bench.report.figures.style import INK, MUTED, options
from problems.problem import Problem

Array = NDArray[np.float64]

COLUMNS = 6
POINTS_DRAWN = 3000  # points of one case that are drawn
FEWEST_CROSSINGS = 20
FARTHEST = 3.0  # times the usual width: a wider cloud is cut at the edge of its panel
COARSEST = 0.5  # of the largest |q1| between two samples: beyond, a crossing is a guess
GUESSES = 0.1  # of the crossings: with more of them samples are too far apart for a section


def portrait(problem: Problem, cases: Sequence[Drawn]) -> Picture | None:
    """Draw momentum against position of a problem with one degree of freedom; else ``None``."""
    if problem.system.dof != 1:
        return None
    return _grid(
        [(case, *case.series["y"][:, :2].T) for case in cases if len(case.series["y"]) > 2],
        "phase-portrait",
        "Phase portrait",
        "All samples of each case."
        + " The exact solution stays on one closed curve; a spread across it is an error of the energy."
        * ("energy" in problem.system.invariants),
        ("q", "p"),
    )


def section(problem: Problem, cases: Sequence[Drawn]) -> Picture | None:
    """Draw the Poincaré section q1 = 0, p1 > 0 of a problem with two degrees of freedom; else ``None``.

    A problem with bodies has no such section, nor has a case whose samples are too far apart.
    """
    bodies = getattr(problem.system, "bodies", None)
    if problem.system.dof != 2 or bodies is not None or problem.system.kind != "hamiltonian":
        return None
    clouds = [(case, *crossings(case.series["y"])) for case in cases]
    return _grid(
        [(case, q, p) for case, q, p in clouds if q.size >= FEWEST_CROSSINGS],
        "poincare-section",
        "Poincaré section",
        "Where the samples pass q₁ = 0 with p₁ > 0, between two samples on a straight line. A regular orbit "
        "makes curves, a chaotic one fills an area; on a chaotic orbit no method is accurate point by point.",
        ("q₂", "p₂"),
    )


def crossings(y: Array) -> tuple[Array, Array]:
    """Return q2 and p2 where q1 of states q1, q2, p1, p2, shape (n, 4), passes 0 upwards, shape (m,) each."""
    good = np.isfinite(y).all(axis=1)
    y = y[good]
    if len(y) < 2:
        return np.empty(0), np.empty(0)
    before, after = y[:-1], y[1:]
    size = float(np.max(np.abs(y[:, 0])))
    up = (before[:, 0] < 0.0) & (after[:, 0] >= 0.0)
    near = after[:, 0] - before[:, 0] < COARSEST * size
    if np.sum(up & ~near) > GUESSES * np.sum(up):
        return np.empty(0), np.empty(0)
    up &= near
    share = -before[up, 0] / (after[up, 0] - before[up, 0])
    at = before[up] + share[:, None] * (after[up] - before[up])
    return at[:, 1], at[:, 3]


def _grid(
    clouds: Sequence[tuple[Drawn, Array, Array]], key: str, title: str, caption: str, labels: tuple[str, str]
) -> Picture | None:
    if not clouds:
        return None
    rows = math.ceil(len(clouds) / COLUMNS)
    height = 2.3 * rows
    figure = new(WIDTH, height)
    figure.subplots_adjust(
        left=0.055, right=0.99, top=1 - 0.26 / height, bottom=0.42 / height, hspace=0.5, wspace=0.12
    )
    grid = figure.subplots(rows, COLUMNS, squeeze=False, sharex=True, sharey=True).ravel().tolist()
    reach = [_reach([x for _, x, _ in clouds]), _reach([y for _, _, y in clouds])]
    for axes in grid[len(clouds) :]:
        axes.set_axis_off()
    for axes, (case, x, y) in zip(grid, clouds, strict=False):
        every = max(1, -(-x.size // POINTS_DRAWN))
        name = named(case.look.number, case.record.case.method)
        dots, look = (x[::every], y[::every]), {"markersize": 1.1, "rasterized": True}
        axes.plot(*dots, ".", color=case.look.light, label=name, **look)
        axes.set(xlim=reach[0], ylim=reach[1])
        axes.set_title(case.short, fontsize=8, color=INK)
        lowest = axes in grid[max(len(clouds) - COLUMNS, 0) : len(clouds)]
        if lowest:  # of its column
            axes.tick_params(labelbottom=True)
            axes.text(1.0, -0.2, labels[0], transform=axes.transAxes, fontsize=8, ha="right", va="top")
        words, below = cut(options(case.record), 33), -0.2 if lowest else -0.08
        axes.text(0.0, below, words, transform=axes.transAxes, fontsize=6, color=MUTED, va="top")
    for row in range(rows):
        grid[row * COLUMNS].set_ylabel(labels[1])
    said = "; ".join(f"{case.record.case.method}: {x.size} points" for case, x, _ in clouds)
    summary = f"{title} of each case. {said}."
    return picture(figure, key, f"{title} ({labels[0]}, {labels[1]})", caption, summary)


def _reach(values: Sequence[Array]) -> tuple[float, float]:
    """Return the limits that nearly all values lie in: one case that escaped must not shrink the others."""
    ends = [(float(np.nanmin(v)), float(np.nanmax(v))) for v in values]
    usual = FARTHEST * sorted(high - low for low, high in ends)[len(ends) // 2]
    kept = [(low, high) for low, high in ends if high - low <= usual] or ends
    low, high = min(low for low, _ in kept), max(high for _, high in kept)
    margin = 0.08 * (high - low or 1.0)
    return low - margin, high + margin
