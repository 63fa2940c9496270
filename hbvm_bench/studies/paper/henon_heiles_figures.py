"""The figures of the Henon-Heiles experiment: the paper's four, and who escapes from where."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator

from hbvm_bench.report.figures.canvas import log_axis, power_label, say
from hbvm_bench.report.figures.over_time import envelope
from hbvm_bench.report.figures.style import INK, MUTED, PAPER
from hbvm_bench.studies.paper.drawn import GAUSS, HBVM, WIDTH, Said, drawn, heat, number
from hbvm_bench.studies.paper.experiments.henon_heiles import (
    DIRECTIONS,
    GAP,
    GAPS,
    MAP_END,
    T_END,
    H,
    Orbit,
    potential,
)
from integrators.protocol import Array
from problems.catalogue.henon_heiles import ESCAPE, SADDLES

LEVELS = (0.02, 0.05, 0.08, 0.11, 0.14, ESCAPE)
LABELLED = (math.radians(162), math.radians(34))  # directions from the origin, alternating


@drawn("henon-heiles-1", "Figure 1 · level curves of the potential and an orbit", WIDTH * 0.6, 5.0)
def level_curves(figure: Figure, trace: Array) -> Said:
    """henon_fig1: level curves of U with a traced orbit."""
    axes = figure.subplots()
    x, y = np.meshgrid(np.linspace(-1.25, 1.25, 301), np.linspace(-0.75, 1.25, 301))
    axes.plot(*trace.T, color=HBVM, linewidth=0.6, alpha=0.6)
    lines = axes.contour(x, y, potential(x, y), levels=LEVELS, colors=INK, linewidths=0.9)
    for text in axes.clabel(
        lines,
        fmt=lambda value: "1/6" if abs(value - ESCAPE) < 1e-9 else f"{value:g}",
        fontsize=7.5,
        manual=[_on_level(level, LABELLED[i % 2]) for i, level in enumerate(LEVELS)],
    ):
        text.set_bbox({"facecolor": PAPER, "edgecolor": "none", "pad": 0.8})
    _saddles(axes)
    axes.plot(0, 0, "+", color=INK, markersize=8)
    say(axes, "O", (0, 0), (5, 4), fontsize=9)
    _plane(axes, 1.25, (-0.75, 1.25))
    return (
        "The level 1/6 is the triangle of the three saddles. The true orbit from our start, H₀ = 1/6 − "
        f"{GAP:g}, to t = 300: it comes close to the sides, where a small error of the energy lets it "
        "out.",
        "The orbit fills the triangle and stays inside.",
    )


@drawn("", "", WIDTH * 0.6, 5.0)
def plane(figure: Figure, run: Orbit, family: str, figure_number: int, caption: str) -> Said:
    """henon_fig2, henon_fig3: every step in the (q1, q2) plane."""
    colour = GAUSS if family == "gauss" else HBVM
    if run.left is not None:
        figure.set_size_inches(WIDTH * 0.66, 5.0)
    axes = figure.subplots()
    corners = np.array([*SADDLES, SADDLES[0]])
    axes.plot(*corners.T, color=INK, linewidth=0.9)
    inside = run.q if run.left is None else run.q[:-3]
    axes.plot(*inside.T, ".", color=colour, markersize=1.1, alpha=0.55, rasterized=True)
    if run.left is not None:
        last = run.q[-4:]
        shown = last[(np.abs(last[:, 0]) < 1.7) & (np.abs(last[:, 1]) < 1.5)]
        axes.plot(*shown.T, "o", mfc="none", mec=INK, markersize=8)
        axes.plot(*shown.T, ".", color=INK, markersize=3)
        axes.set_title(f"{run.method}: gone at t = {run.left:g}", color=INK)
    else:
        axes.set_title(f"{run.method}: {len(run.t) - 1} steps, none outside", color=INK)
    _saddles(axes)
    _plane(
        axes, 1.5 if run.left is not None else 1.25, (-0.9, 1.25) if run.left is not None else (-0.75, 1.25)
    )
    name = "Gauss of order four" if family == "gauss" else "HBVM(4,2)"
    return (
        f"henon-heiles-{figure_number}",
        f"Figure {figure_number} · {name}, h = {H:g}",
        caption,
        f"{run.method}: {len(run.t) - 1} steps, {run.outside} outside the triangle"
        + (f", gone at t = {run.left:g}." if run.left is not None else ", the orbit stays to the end."),
    )


@drawn("henon-heiles-4", "Figure 4 · the Hamiltonian along both solutions", WIDTH, 3.3)
def hamiltonian(figure: Figure, gauss: Orbit, hbvm: Orbit) -> Said:
    """henon_fig4: H along both runs."""
    left, right = figure.subplots(1, 2, width_ratios=[1.5, 1])
    inside = gauss.t <= (gauss.left or T_END) - 3
    left.plot(
        gauss.t[inside], gauss.energy[inside], color=GAUSS, linewidth=0.4, label=gauss.method, rasterized=True
    )
    shown = hbvm.t <= gauss.t[-1]
    left.plot(hbvm.t[shown], hbvm.energy[shown], color=HBVM, linewidth=1.6, label=hbvm.method)
    left.axhline(ESCAPE, color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
    say(left, "1/6", (gauss.t[-1], ESCAPE), (3, -3), fontsize=8, annotation_clip=False)
    left.set(xlim=(0, gauss.t[-1]), xlabel="time", ylabel="H")
    for line in left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.02), ncols=2).get_lines():
        line.set_linewidth(1.6)
    error = np.abs(hbvm.energy - hbvm.energy[0]) / hbvm.energy[0]
    right.plot(*envelope(hbvm.t[1:], error[1:], 300), color=HBVM, linewidth=1.1)
    log_axis(right, "y", -17, -10)
    right.set(xlim=(0, T_END), xlabel="time", ylabel="|H − H₀| / H₀", title=hbvm.method)
    return (
        "Left, the paper's figure: under Gauss H swings irregularly across 1/6, under HBVM it is a "
        "straight line. Right: that line's error over the whole run.",
        f"{gauss.method}: H between {gauss.energy[inside].min():.5f} and "
        f"{gauss.energy[inside].max():.5f}; {hbvm.method}: largest relative error {hbvm.error:.1e}.",
    )


@drawn("henon-heiles-fates", "Beyond the paper · the escape time is chance", WIDTH * 0.66, 3.2)
def fates(figure: Figure, times: Mapping[str, Sequence[float | None]], printed: float) -> Said:
    """Draw how long neighbouring starts stay: the distribution behind the paper's one number."""
    axes = figure.subplots()
    summary = []
    for method, found in times.items():
        gone = np.sort([time for time in found if time is not None])
        share = 1 - np.arange(gone.size + 1) / len(found)
        axes.step(
            [0, *gone, T_END],
            [*share, share[-1]],
            where="post",
            color=GAUSS if method.startswith("Gauss") else HBVM,
            linewidth=1.6,
            label=f"{method}, {len(found)} starts",
        )
        summary.append(f"{method}: {gone.size} of {len(found)} orbits leave")
    axes.axvline(printed, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)))
    say(axes, f"the paper's t ≃ {printed:.0f}", (printed, 0.04), (5, 0), fontsize=8, color=INK)
    axes.set(xlim=(0, T_END), ylim=(0, 1.04), xlabel="time", ylabel="share of orbits still inside")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return (
        "The same start but for the last bits of one momentum. The motion is chaotic, so the last bit "
        "decides when Gauss lets the orbit out; the paper's single escape time is one draw from this "
        "distribution. Under HBVM none leaves.",
        "; ".join(summary),
    )


@drawn("henon-heiles-map", "Beyond the paper · who escapes from where", WIDTH, 3.6, values=True)
def maps(figure: Figure, found: Mapping[str, Array]) -> Said:
    """Escape times over starts and energies, both methods."""
    gauss, hbvm, gaps, t_end = found["gauss"], found["hbvm"], GAPS, MAP_END
    degrees = np.degrees(DIRECTIONS)
    panels = figure.subplots(1, 2, sharey=True)
    mesh = None
    for axes, times, name in zip(
        panels, (gauss, hbvm), ("Gauss(s=2, h=1.0)", "HBVM(k=4, s=2, h=1.0)"), strict=True
    ):
        mesh = heat(axes, degrees, gaps, np.maximum(times, 1.0), 2, math.log10(t_end))
        axes.set(yscale="log", xlabel="direction of the start, degrees")
        axes.set_xticks(range(0, 361, 60))
        axes.grid(visible=False)
        left = int(np.count_nonzero(~np.isnan(times)))
        axes.set_title(f"{name}: {left} of {times.size} leave", color=INK)
        if left == 0:
            middle = {"transform": axes.transAxes, "ha": "center", "va": "center"}
            axes.text(0.5, 0.5, "every orbit stays inside", color=MUTED, fontsize=9, **middle)
    powers = range(math.ceil(math.log10(min(gaps))), math.floor(math.log10(max(gaps))) + 1)
    panels[0].yaxis.set_major_locator(FixedLocator([10.0**p for p in powers]))
    panels[0].yaxis.set_major_formatter(lambda value, _: power_label(value))
    panels[0].set_ylabel("1/6 − H₀")
    panels[0].invert_yaxis()
    assert mesh is not None
    bar = figure.colorbar(mesh, ax=panels, pad=0.01, aspect=28)
    ticks = [p for p in range(2, 6) if 10**p <= t_end]
    bar.set_ticks(ticks, labels=[power_label(10.0**p) for p in ticks])
    bar.set_label("escape time; blank: inside throughout")
    inside = gauss[np.asarray(gaps) >= 4e-3]
    return (
        f"Orbits from (0, 1/2) in every direction, with energies from 1/6 − {number(max(gaps))} "
        f"(bottom) to 1/6 − {number(min(gaps))} (top), followed to t = {t_end:,.0f}. Under Gauss the "
        "triangle leaks where 1/6 is nearer than the error of H; the blank cells among the coloured "
        "ones are orbits that have not left yet, or regular ones that never will. Under HBVM nothing "
        "leaves.",
        f"Under Gauss {int(np.count_nonzero(~np.isnan(gauss)))} of {gauss.size} orbits leave, "
        f"{int(np.count_nonzero(~np.isnan(inside)))} of {inside.size} of those with 1/6 − H₀ ≥ 4e-3; "
        f"under HBVM {int(np.count_nonzero(~np.isnan(hbvm)))}.",
    )


def _on_level(level: float, angle: float) -> tuple[float, float]:
    """Return the point of U = level in a direction, by U = r^2/2 + r^3 sin(3 angle)/3."""
    roots = np.roots([math.sin(3 * angle) / 3, 0.5, 0.0, -level])
    radius = min(root.real for root in roots if abs(root.imag) < 1e-9 and root.real > 0)
    return radius * math.cos(angle), radius * math.sin(angle)


def _saddles(axes: Axes) -> None:
    offsets = ((8, 0), (-19, 5), (7, 5))
    for i, (point, offset) in enumerate(zip(SADDLES, offsets, strict=True)):
        axes.plot(*point, "s", color=INK, markersize=4)
        say(axes, f"P{'₁₂₃'[i]}", point, offset, fontsize=9)


def _plane(axes: Axes, reach: float, vertical: tuple[float, float]) -> None:
    axes.set(xlim=(-reach, reach), ylim=vertical, aspect="equal", xlabel="q₁", ylabel="q₂")
