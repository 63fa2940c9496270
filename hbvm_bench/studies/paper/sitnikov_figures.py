"""The figures of Sitnikov's problem: the paper's five, and what they leave out."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hbvm_bench.report.figures.canvas import log_axis
from hbvm_bench.report.figures.over_time import envelope
from hbvm_bench.report.figures.style import INK, MUTED, TRUTH
from hbvm_bench.studies.paper.drawn import FAMILIES, GAUSS, HBVM, WIDTH, Said, drawn
from hbvm_bench.studies.paper.experiments.sitnikov import LOST, REVOLUTIONS, T_END, D, E, H, Orbit
from integrators.protocol import Array

TILT = 0.55  # of the oblique drawing of the configuration
SHOWN = 350.0  # the span of time that the paper shows z(t) on


@drawn("sitnikov-1", "Figure 1 · the configuration and the true motion", WIDTH, 4.0)
def configuration(figure: Figure, truth: Orbit) -> Said:
    """sit_fig1: the three bodies, and the true z(t)."""
    grid = figure.add_gridspec(2, 2, width_ratios=[0.8, 1.2])
    _configuration(figure.add_subplot(grid[:, 0]), truth)
    panels = [figure.add_subplot(grid[row, 1]) for row in (0, 1)]
    for row, (axes, end) in enumerate(zip(panels, (SHOWN, T_END), strict=True)):
        shown = truth.t <= end
        axes.plot(truth.t[shown], truth.z[shown], color=INK, linewidth=0.9 if row == 0 else 0.6)
        axes.set(xlim=(0, end), ylim=(-2, 2), ylabel="z", title=f"the planetoid's true height, t ≤ {end:g}")
    panels[1].set_xlabel("time")
    return (
        "Left: two equal masses on ellipses of eccentricity 0.75, a planetoid of mass 1e-5 on the axis "
        "through their barycentre. Right: its height over time, from a run whose end agrees with "
        "128-bit arithmetic to nine digits.",
        f"The planetoid oscillates irregularly but stays within |z| = {np.abs(truth.z).max():.3f}.",
    )


@drawn("", "", WIDTH, 4.1)
def trajectories(
    figure: Figure,
    run: Orbit,
    truth: Orbit,
    family: str,
    figure_number: int,
    end: float,
    caption: str,
    ellipses: Sequence[Array] = (),
) -> Said:
    """sit_fig2, sit_fig3: the primaries in their plane, the planetoid in space and time.

    ``ellipses``: paths (2, n) of one primary in the `REVOLUTIONS`, drawn as lines.
    """
    colour = FAMILIES[family]
    left, right = figure.subplots(1, 2, width_ratios=[0.8, 1.2])
    reach = 3.2
    for body, shade in ((0, 0.55), (1, 1.0)):
        x, y = run.primaries[:, body].T
        left.plot(x, y, ".", color=colour, alpha=shade, markersize=1.6, rasterized=True)
    for number, (x, y) in zip(REVOLUTIONS, ellipses, strict=False):
        left.plot(x, y, color=INK, linewidth=0.9)
        far = int(np.argmax(np.hypot(x, y)))
        left.annotate(
            str(number), (1.11 * x[far], 1.11 * y[far]), ha="center", va="center", fontsize=8, color=INK
        )
    left.set(
        xlim=(-reach, reach),
        ylim=(-reach, reach),
        aspect="equal",
        xlabel="x",
        ylabel="y",
        title=f"primaries, every step to t = {run.t[-1]:g}",
    )
    shown = run.t <= end
    if run.lost is None:
        past = truth.t <= end
        right.plot(truth.t[past], truth.z[past], color=TRUTH, linewidth=2.2, label="true motion")
        right.set(ylim=(-2, 2), title="the planetoid on the axis")
    else:
        right.set_title(f"{run.method}: the planetoid on the axis", color=INK)
        _before(right, run, colour)
    right.plot(run.t[shown], run.z[shown], color=colour, linewidth=0.9, label=run.method)
    right.set(xlim=(0, end), xlabel="time", ylabel="z")
    if run.lost is None:
        right.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=2)
    name = {"gauss": "Gauss of order four", "hbvm": "HBVM(18,2)"}[family]
    return (
        f"sitnikov-{figure_number}",
        f"Figure {figure_number} · {name}, h = {H:g}",
        caption,
        f"{run.method}: largest |z| {np.abs(run.z).max():.4g}, distance of the primaries up to "
        f"{run.distance.max():.4f}.",
    )


@drawn("sitnikov-4", "Figure 4 · distance of the primaries", WIDTH, 3.1)
def distances(figure: Figure, runs: Mapping[str, Orbit]) -> Said:
    """sit_fig4: the distance of the primaries over time."""
    panels = figure.subplots(1, 2, sharey=True)
    for axes, family in zip(panels, ("gauss", "hbvm"), strict=True):
        run = runs[family]
        axes.plot(run.t, run.distance, color=FAMILIES[family], linewidth=0.6)
        axes.axhline(D, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
        axes.set(xlim=(0, T_END), xlabel="time", title=run.method)
        low, high = apocentres(run)
        axes.text(
            0.99, 1.02, f"maxima {low:.4f} … {high:.4f}", transform=axes.transAxes, ha="right", fontsize=8
        )
    panels[0].set(
        ylabel="distance of the primaries", ylim=(0, max(6.0, 1.05 * float(runs["gauss"].distance.max())))
    )
    return (
        "Dashed: the true apocentre distance, 5. HBVM keeps it because the energy fixes the length of "
        "the axis; Gauss does not.",
        "; ".join(
            f"{runs[f].method}: maxima between {apocentres(runs[f])[0]:.4f} and {apocentres(runs[f])[1]:.4f}"
            for f in ("gauss", "hbvm")
        ),
    )


def apocentres(run: Orbit) -> tuple[float, float]:
    """Return the smallest and the largest maximum of the primaries' distance, each from a parabola."""
    d = run.distance
    i = 1 + np.flatnonzero((d[1:-1] > d[:-2]) & (d[1:-1] >= d[2:]))
    a, b, c = d[i - 1], d[i], d[i + 1]
    peaks = b - (a - c) ** 2 / (8 * (a - 2 * b + c))
    return float(peaks.min()), float(peaks.max())


@drawn("sitnikov-5", "Figure 5 · errors of the energy and of the angular momentum", WIDTH, 3.6)
def errors(figure: Figure, runs: Mapping[str, Orbit]) -> Said:
    """sit_fig5: relative errors of H and of the angular momentum."""
    left, right = figure.subplots(1, 2, sharey=True)
    shown = [runs[key] for key in ("gauss", "hbvm", "both") if key in runs]
    colours = [GAUSS, HBVM, INK]
    for run, colour in zip(shown, colours, strict=False):
        for axes, values in ((left, run.energy), (right, run.momentum)):
            t, top = envelope(run.t[1:], values[1:], 300)
            axes.plot(t, np.maximum(top, 1e-17), color=colour, linewidth=1.1, label=run.method)
    for axes, title in ((left, "|H − H₀| / |H₀|"), (right, "|M − M₀| / |M₀|")):
        log_axis(axes, "y", -17, 1, most=9)
        axes.set(xlim=(0, T_END), xlabel="time", title=title)
    left.set_ylabel("relative error")
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return (
        "Largest value in each of 300 spans of time; evaluated in double-double. Each of the paper's "
        "methods keeps one of the two laws and not the other"
        + (
            "; the line integral method, which the paper does not have, keeps both."
            if "both" in runs
            else "."
        ),
        "; ".join(
            f"{run.method}: energy {run.energy.max():.1e}, angular momentum {run.momentum.max():.1e}"
            for run in shown
        ),
    )


def _before(axes: Axes, run: Orbit, colour: str) -> None:
    """Show the oscillations up to the planetoid's loss in an inset, on the empty side."""
    assert run.lost is not None
    until = run.t <= run.lost
    falls = run.z[-1] < 0
    inset = axes.inset_axes((0.09, 0.12 if falls else 0.5, 0.42, 0.36), zorder=5)
    inset.plot(run.t[until], run.z[until], color=colour, linewidth=0.8)
    inset.set(xlim=(0, run.lost), ylim=(-LOST, LOST))
    inset.tick_params(labelsize=7)
    inset.set_title(f"until |z| > {LOST:g}, at t = {run.lost:g}", color=INK, fontsize=8)


def _configuration(axes: Axes, truth: Orbit) -> None:
    def place(x: float, y: float, z: float) -> tuple[float, float]:
        return x + 0.5 * y, TILT * y + z

    def say(words: str, x: float, y: float, z: float, offset: tuple[int, int], **look: Any) -> None:
        axes.annotate(words, place(x, y, z), xytext=offset, textcoords="offset points", fontsize=8.5, **look)

    axes.set_axis_off()
    axes.set_aspect("equal")
    angle = np.linspace(0, 2 * np.pi, 200)
    a = D / 2 / (1 + E)
    for sign in (-1, 1):
        x, y = sign * a * (np.cos(angle) + E), sign * a * np.sqrt(1 - E * E) * np.sin(angle)
        axes.plot(x + 0.5 * y, TILT * y, color=INK, linewidth=1.0)
        axes.plot(*place(sign * D / 2, 0, 0), "o", color=INK, markersize=12)
        say("m = 1", sign * D / 2, 0, 0, (0, 12 if sign < 0 else -19), ha="center")
    low, high = place(0, 0, -2.2), place(0, 0, 2.2)
    axes.plot([low[0], high[0]], [low[1], high[1]], color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    top = float(truth.z.max())
    axes.plot(*place(0, 0, top), "o", color=HBVM, markersize=5)
    say("planetoid, m = 10⁻⁵", 0, 0, top, (9, -3))
    say("z", 0, 0, 2.2, (6, -5), style="italic")
    left, right = place(-D / 2, 0, -1.2), place(D / 2, 0, -1.2)
    axes.plot([left[0], right[0]], [left[1], right[1]], color=MUTED, linewidth=0.8, marker="|", markersize=7)
    say("d = 5 at apocentre", 0.9, 0, -1.2, (0, -13), ha="center", color=MUTED)
