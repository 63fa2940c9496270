"""The figures of Sitnikov's problem: the paper's five, and what they leave out."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hbvm_bench.report.curves import envelope
from hbvm_bench.report.figures.canvas import log_axis
from hbvm_bench.report.figures.drawn import COLOURS, WIDTH, Said, drawn
from hbvm_bench.report.figures.style import INK, MUTED, TRUTH
from integrators.protocol import Array

from .experiments.sitnikov import LOST, REVOLUTIONS, T_END, D, E, H, Orbit

TILT = 0.55  # of the oblique drawing of the configuration
SHOWN = 350.0  # the interval on which the paper shows z(t)
REACH = 3.2  # of the drawings of the primaries' plane


@drawn("sitnikov-1", "Figure 1 · the configuration and the reference solution", WIDTH, 4.0)
def configuration(figure: Figure, truth: Orbit) -> Said:
    """sit_fig1: the three bodies, and the true z(t)."""
    grid = figure.add_gridspec(2, 2, width_ratios=[0.8, 1.2])
    _configuration(figure.add_subplot(grid[:, 0]), truth)
    for row, end, width in ((0, SHOWN, 0.9), (1, T_END, 0.6)):
        axes = figure.add_subplot(grid[row, 1])
        shown = truth.t <= end
        axes.plot(truth.t[shown], truth.z[shown], color=INK, linewidth=width)
        axes.set(xlim=(0, end), ylim=(-2, 2), ylabel="z", title=f"the planetoid's height, t ≤ {end:g}")
        axes.set_xlabel("time" if row else "")
    return (
        "Left: two equal masses on ellipses of eccentricity 0.75, a planetoid of mass 1e-5 on the axis "
        "through their barycentre. Right: its height over time, from a run whose end agrees with "
        "128-bit arithmetic to nine digits.",
        f"The planetoid oscillates irregularly but stays within |z| = {np.abs(truth.z).max():.3f}.",
    )


@drawn("sitnikov-2", f"Figure 2 · Gauss of order four, h = {H:g}", WIDTH, 4.1)
def thrown_out(figure: Figure, run: Orbit, truth: Orbit, neighbours: Sequence[float | None]) -> Said:
    """sit_fig2: the primaries in their plane, the planetoid in space and time."""
    _trajectories(figure, run, truth, COLOURS["gauss"], T_END)
    return (
        "Left: the primaries at every step. Right: the planetoid is thrown out; the last bit decides "
        f"when, and whether it comes back once more. {lost_words(neighbours)}",
        _reached(run),
    )


@drawn("sitnikov-3", f"Figure 3 · HBVM(18,2), h = {H:g}", WIDTH, 4.1)
def stays(figure: Figure, run: Orbit, truth: Orbit, ellipses: Sequence[Array]) -> Said:
    """sit_fig3: as before; the paths (2, n) of one primary in the `REVOLUTIONS` are drawn as lines."""
    left = _trajectories(figure, run, truth, COLOURS["hbvm"], SHOWN)
    for number, (x, y) in zip(REVOLUTIONS, ellipses, strict=True):
        left.plot(x, y, color=INK, linewidth=0.9)
        far = int(np.argmax(np.hypot(x, y)))
        look: Any = {"ha": "center", "va": "center", "fontsize": 8, "color": INK}
        left.annotate(str(number), (1.11 * x[far], 1.11 * y[far]), **look)
    return (
        "Left: the primaries at every step, and one of them in its 1st, 16th and 31st revolution as a line: "
        "the ellipses turn, a spurious precession (the paper's “sham rotation”). Right: the planetoid on "
        "the paper's range of time, over the reference solution in grey.",
        _reached(run),
    )


def lost_words(times: Sequence[float | None]) -> str:
    """Say when neighbouring initial conditions lose the planetoid, if they do."""
    lost = sorted(time for time in times if time is not None)
    if not lost:
        return (
            f"None of {len(times)} initial conditions that differ in the last bits of e loses the planetoid."
        )
    return (
        f"Of {len(times)} initial conditions that differ in the last bits of e, {len(lost)} lose the "
        f"planetoid, the first at t = {lost[0]:.0f}, the last at {lost[-1]:.0f}."
    )


def _trajectories(figure: Figure, run: Orbit, truth: Orbit, colour: str, end: float) -> Axes:
    """Draw the primaries in their plane, whose axes are returned, and the planetoid in space and time."""
    left, right = figure.subplots(1, 2, width_ratios=[0.8, 1.2])
    for body, shade in ((0, 0.55), (1, 1.0)):
        left.plot(*run.primaries[:, body].T, ".", color=colour, alpha=shade, markersize=1.6, rasterized=True)
    left.set(xlim=(-REACH, REACH), ylim=(-REACH, REACH), aspect="equal", xlabel="x", ylabel="y")
    left.set_title(f"primaries, every step to t = {run.t[-1]:g}")
    shown, past = run.t <= end, truth.t <= end
    if run.lost is None:
        right.plot(truth.t[past], truth.z[past], color=TRUTH, linewidth=2.2, label="reference solution")
        right.set(ylim=(-2, 2), title="the planetoid on the axis")
    else:
        right.set_title(f"{run.method}: the planetoid on the axis", color=INK)
        until = run.t <= run.lost  # the oscillations up to the loss, in an inset on the empty side
        inset = right.inset_axes((0.09, 0.12 if run.z[-1] < 0 else 0.5, 0.42, 0.36), zorder=5)
        inset.plot(run.t[until], run.z[until], color=colour, linewidth=0.8)
        inset.set(xlim=(0, run.lost), ylim=(-LOST, LOST))
        inset.tick_params(labelsize=7)
        inset.set_title(f"until |z| > {LOST:g}, at t = {run.lost:g}", color=INK, fontsize=8)
    right.plot(run.t[shown], run.z[shown], color=colour, linewidth=0.9, label=run.method)
    right.set(xlim=(0, end), xlabel="time", ylabel="z")
    if run.lost is None:
        right.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=2)
    return left


def _reached(run: Orbit) -> str:
    z, apart = np.abs(run.z).max(), run.distance.max()
    return f"{run.method}: largest |z| {z:.4g}, distance of the primaries up to {apart:.4f}."


@drawn("sitnikov-4", "Figure 4 · distance of the primaries", WIDTH, 3.1)
def distances(figure: Figure, runs: Mapping[str, Orbit]) -> Said:
    """sit_fig4: the distance of the primaries over time."""
    panels = figure.subplots(1, 2, sharey=True)
    summary = []
    for axes, family in zip(panels, ("gauss", "hbvm"), strict=True):
        run = runs[family]
        low, high = run.apocentres
        axes.plot(run.t, run.distance, color=COLOURS[family], linewidth=0.6)
        axes.axhline(D, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
        axes.set(xlim=(0, T_END), xlabel="time", title=run.method)
        words = f"maxima {low:.4f} … {high:.4f}"
        axes.text(0.99, 1.02, words, transform=axes.transAxes, ha="right", fontsize=8)
        summary.append(f"{run.method}: maxima between {low:.4f} and {high:.4f}")
    top = max(6.0, 1.05 * float(runs["gauss"].distance.max()))
    panels[0].set(ylabel="distance of the primaries", ylim=(0, top))
    return (
        "Dashed: the exact apocentre distance, 5. HBVM preserves it because the energy determines the "
        "semi-major axis; Gauss does not.",
        "; ".join(summary),
    )


@drawn("sitnikov-5", "Figure 5 · errors of the energy and of the angular momentum", WIDTH, 3.6)
def errors(figure: Figure, runs: Mapping[str, Orbit]) -> Said:
    """sit_fig5: relative errors of H and of the angular momentum."""
    left, right = figure.subplots(1, 2, sharey=True)
    colours = {"gauss": COLOURS["gauss"], "hbvm": COLOURS["hbvm"], "both": INK}
    shown = {key: runs[key] for key in colours if key in runs}
    for key, run in shown.items():
        for axes, values in ((left, run.energy), (right, run.momentum)):
            t, top = envelope(run.t[1:], values[1:], 300)
            axes.plot(t, np.maximum(top, 1e-17), color=colours[key], linewidth=1.1, label=run.method)
    for axes, title in ((left, "|H − H₀| / |H₀|"), (right, "|M − M₀| / |M₀|")):
        log_axis(axes, "y", -17, 1, most=9)
        axes.set(xlim=(0, T_END), xlabel="time", title=title)
    left.set_ylabel("relative error")
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    both = "; the line integral method, which is not in the paper, conserves both" if "both" in runs else ""
    return (
        "Largest value in each of 300 equal time intervals; evaluated in double-double. Each of the "
        f"paper's methods conserves one of the two quantities and not the other{both}.",
        "; ".join(
            f"{run.method}: energy {run.energy.max():.1e}, angular momentum {run.momentum.max():.1e}"
            for run in shown.values()
        ),
    )


def _configuration(axes: Axes, truth: Orbit) -> None:
    def place(x: Any, y: Any, z: float) -> tuple[Any, Any]:
        return x + 0.5 * y, TILT * y + z

    def say(words: str, x: float, z: float, offset: tuple[int, int], **look: Any) -> None:
        axes.annotate(words, place(x, 0, z), xytext=offset, textcoords="offset points", fontsize=8.5, **look)

    def line(*ends: tuple[float, float], **look: Any) -> None:
        axes.plot(*np.array([place(x, 0, z) for x, z in ends]).T, color=MUTED, linewidth=0.8, **look)

    axes.set_axis_off()
    axes.set_aspect("equal")
    angle = np.linspace(0, 2 * np.pi, 200)
    a = D / 2 / (1 + E)
    for sign in (-1, 1):
        x, y = sign * a * (np.cos(angle) + E), sign * a * np.sqrt(1 - E * E) * np.sin(angle)
        axes.plot(*place(x, y, 0), color=INK, linewidth=1.0)
        axes.plot(*place(sign * D / 2, 0, 0), "o", color=INK, markersize=12)
        say("m = 1", sign * D / 2, 0, (0, 12 if sign < 0 else -19), ha="center")
    line((0, -2.2), (0, 2.2), linestyle=(0, (4, 3)))
    top = float(truth.z.max())
    axes.plot(*place(0, 0, top), "o", color=COLOURS["hbvm"], markersize=5)
    say("planetoid, m = 10⁻⁵", 0, top, (9, -3))
    say("z", 0, 2.2, (6, -5), style="italic")
    line((-D / 2, -1.2), (D / 2, -1.2), marker="|", markersize=7)
    say("d = 5 at apocentre", 0.9, -1.2, (0, -13), ha="center", color=MUTED)
