"""The figures of Sitnikov's problem: the paper's five, and what they leave out."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from hbvm_bench.paper.document import GAUSS, HBVM, WIDTH, sheet
from hbvm_bench.paper.sitnikov import DEGREE, T_END, D, E, H, Orbit, StepRow
from hbvm_bench.report.canvas import Picture, drawing, log_axis, picture
from hbvm_bench.report.figures import envelope
from hbvm_bench.report.style import INK, MUTED, TRUTH
from integrators.protocol import Array

TILT = 0.55  # of the oblique drawing of the configuration
SHOWN = 350.0  # the span of time that the paper shows z(t) on
FAMILY_COLOURS = {"gauss": GAUSS, "hbvm": HBVM, "truth": TRUTH}


def configuration(truth: Orbit) -> Picture:
    """sit_fig1: the three bodies, and the true z(t)."""
    with drawing():
        figure = sheet(WIDTH, 4.0)
        grid = figure.add_gridspec(2, 2, width_ratios=[0.8, 1.2], hspace=0.45, wspace=0.12)
        _configuration(figure.add_subplot(grid[:, 0]), truth)
        panels = [figure.add_subplot(grid[row, 1]) for row in (0, 1)]
        for row, (axes, end) in enumerate(zip(panels, (SHOWN, T_END), strict=True)):
            shown = truth.t <= end
            axes.plot(truth.t[shown], truth.z[shown], color=INK, linewidth=0.9 if row == 0 else 0.6)
            axes.set_xlim(0, end)
            axes.set_ylim(-2, 2)
            axes.set_ylabel("z")
            axes.set_title(f"true height of the planetoid, t ≤ {end:g}", color=INK)
        panels[1].set_xlabel("time")
        return picture(
            figure,
            "sitnikov-1",
            "Figure 1 · the configuration and the true motion",
            "Left: two equal masses on ellipses of eccentricity 0.75, a planetoid of mass 1e-5 on the axis "
            "through "
            "their barycentre. Right: its height over time, from a run whose end agrees with 128-bit "
            "arithmetic to "
            "nine digits.",
            f"The planetoid oscillates irregularly but stays within |z| = {np.abs(truth.z).max():.3f}.",
        )


def trajectories(
    run: Orbit, truth: Orbit, family: str, figure_number: int, end: float, caption: str
) -> Picture:
    """sit_fig2, sit_fig3: the primaries in their plane, the planetoid in space and time."""
    colour = FAMILY_COLOURS[family]
    with drawing():
        figure = sheet(WIDTH, 4.1)
        left, right = figure.subplots(1, 2, width_ratios=[0.8, 1.2])
        reach = 3.2
        for body, shade in ((0, 0.55), (1, 1.0)):
            x, y = run.primaries[:, body].T
            left.plot(x, y, ".", color=colour, alpha=shade, markersize=1.6, rasterized=True)
        left.set_xlim(-reach, reach)
        left.set_ylim(-reach, reach)
        left.set_aspect("equal")
        left.set_xlabel("x")
        left.set_ylabel("y")
        left.set_title(f"primaries, every step to t = {run.t[-1]:g}", color=INK)
        if run.lost is None:
            shown = truth.t <= end
            right.plot(truth.t[shown], truth.z[shown], color=TRUTH, linewidth=2.2, label="true")
            right.set_ylim(-2, 2)
        shown = run.t <= end
        right.plot(run.t[shown], run.z[shown], color=colour, linewidth=0.9, label=run.method)
        if run.lost is not None:
            reach = float(np.ceil(np.abs(run.z).max() / 50) * 50)
            right.set_ylim(-reach, reach)
            right.axvline(run.lost, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
            right.annotate(
                f"|z| > 10 at t = {run.lost:g}",
                (run.lost, -0.8 * reach),
                xytext=(6, 0),
                textcoords="offset points",
                color=INK,
                fontsize=8,
            )
        right.set_xlim(0, end)
        right.set_xlabel("time")
        right.set_ylabel("z")
        right.set_title("the planetoid on the axis", color=INK)
        right.legend(loc="lower center", bbox_to_anchor=(0.5, 1.08), ncols=2)
        name = {"gauss": "Gauss of order four", "hbvm": "HBVM(18,2)"}[family]
        return picture(
            figure,
            f"sitnikov-{figure_number}",
            f"Figure {figure_number} · {name}, h = {H:g}",
            caption,
            f"{run.method}: largest |z| {np.abs(run.z).max():.4g}, distance of the primaries up to "
            f"{run.distance.max():.4f}.",
        )


def distances(runs: Mapping[str, Orbit]) -> Picture:
    """sit_fig4: the distance of the primaries over time."""
    with drawing():
        figure = sheet(WIDTH, 3.1)
        panels = figure.subplots(1, 2, sharey=True)
        for axes, family in zip(panels, ("gauss", "hbvm"), strict=True):
            run = runs[family]
            axes.plot(run.t, run.distance, color=FAMILY_COLOURS[family], linewidth=0.6)
            axes.axhline(D, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
            axes.set_xlim(0, T_END)
            axes.set_xlabel("time")
            axes.set_title(run.method, color=INK)
            low, high = apocentres(run)
            axes.text(
                0.99, 1.02, f"maxima {low:.4f} … {high:.4f}", transform=axes.transAxes, ha="right", fontsize=8
            )
        panels[0].set_ylabel("distance of the primaries")
        panels[0].set_ylim(0, max(6.0, 1.05 * float(runs["gauss"].distance.max())))
        return picture(
            figure,
            "sitnikov-4",
            "Figure 4 · distance of the primaries",
            "Dashed: the true apocentre distance, 5. HBVM keeps it because the energy fixes the length of "
            "the axis; "
            "Gauss does not.",
            "; ".join(
                f"{runs[f].method}: maxima between {apocentres(runs[f])[0]:.4f} and "
                f"{apocentres(runs[f])[1]:.4f}"
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


def errors(runs: Mapping[str, Orbit]) -> Picture:
    """sit_fig5: relative errors of H and of the angular momentum."""
    with drawing():
        figure = sheet(WIDTH, 3.6)
        left, right = figure.subplots(1, 2, sharey=True)
        shown = [runs[key] for key in ("gauss", "hbvm", "both") if key in runs]
        colours = [GAUSS, HBVM, INK]
        for run, colour in zip(shown, colours, strict=False):
            for axes, values in ((left, run.energy), (right, run.momentum)):
                t, top = envelope(run.t[1:], values[1:], 300)
                axes.plot(t, np.maximum(top, 1e-17), color=colour, linewidth=1.1, label=run.method)
        for axes, title in ((left, "|H − H₀| / |H₀|"), (right, "|M − M₀| / |M₀|")):
            log_axis(axes, "y", -17, 1, most=9)
            axes.set_xlim(0, T_END)
            axes.set_xlabel("time")
            axes.set_title(title, color=INK)
        left.set_ylabel("relative error")
        figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=3)
        return picture(
            figure,
            "sitnikov-5",
            "Figure 5 · errors of the energy and of the angular momentum",
            "Largest value in each of 300 spans of time; evaluated in double-double. Each method keeps one "
            "of the two "
            "laws and not the other.",
            "; ".join(
                f"{run.method}: energy {run.energy.max():.1e}, angular momentum {run.momentum.max():.1e}"
                for run in shown
            ),
        )


def by_nodes(scans: Mapping[float, Sequence[tuple[int, float, float | None]]]) -> Picture:
    """Energy error of HBVM(k, 2) against k: practical conservation."""
    with drawing():
        figure = sheet(WIDTH * 0.62, 3.4)
        axes = figure.subplots()
        for (h, rows), marker, shade in zip(
            sorted(scans.items(), reverse=True), "os", (1.0, 0.5), strict=True
        ):
            k = [row[0] for row in rows]
            axes.plot(
                k,
                [row[1] for row in rows],
                color=HBVM,
                alpha=shade,
                marker=marker,
                markersize=4,
                label=f"h = {h:g}",
            )
            gone = [(row[0], row[1]) for row in rows if row[2] is not None]
            if gone:
                axes.plot(*zip(*gone, strict=True), "o", mfc="none", mec=INK, markersize=9, linestyle="")
        log_axis(axes, "y", -16, 0, most=8)
        axes.set_xlabel("k, nodes of the quadrature")
        axes.set_ylabel("largest |H − H₀| / |H₀|")
        axes.set_xticks(range(2, 25, 2))
        handles, _ = axes.get_legend_handles_labels()
        handles.append(
            Line2D(
                [], [], marker="o", mfc="none", mec=INK, linestyle="", markersize=8, label="planetoid lost"
            )
        )
        axes.legend(handles=handles, loc="upper right")
        return picture(
            figure,
            "sitnikov-nodes",
            "Beyond the paper · how many nodes make the conservation practical",
            f"HBVM(k,{DEGREE}) on Sitnikov's problem over [0, {T_END:g}]. The error falls by a constant "
            "factor per node down "
            "to round-off; k = 2 is the Gauss method. The paper's k = 18 is just enough for h = 1/2; for h = "
            "1/4 twelve do.",
            "; ".join(
                f"h = {h:g}: " + ", ".join(f"k={k} {e:.0e}" for k, e, _ in rows) for h, rows in scans.items()
            ),
        )


def by_step(rows: Sequence[StepRow]) -> Picture:
    """Sham rotation against h, and the time at which the planetoid is lost."""
    with drawing():
        figure = sheet(WIDTH, 3.7)
        left, right = figure.subplots(1, 2)
        for s, dash, marker in ((2, "-", "o"), (3, (0, (5, 2)), "s")):
            for family in ("gauss", "hbvm"):
                chosen = [r for r in rows if r.family == family and r.s == s and usable(r) and r.h <= 0.6]
                if not chosen:
                    continue
                name = f"Gauss, s = {s}" if family == "gauss" else f"HBVM(18,{s})"
                face = FAMILY_COLOURS[family] if family == "hbvm" else "none"
                left.plot(
                    [r.h for r in chosen],
                    [abs(r.turn) for r in chosen],
                    linestyle=dash,
                    color=FAMILY_COLOURS[family],
                    marker=marker,
                    mfc=face,
                    markersize=5 if family == "hbvm" else 7,
                    label=name,
                )
        h = np.array([1 / 32, 0.6])
        for order, at in ((4, 12.0), (6, 0.18)):
            left.plot(h, at * 2 * h**order * 4, color=TRUTH, linewidth=0.8, zorder=1)
            left.annotate(
                f"h{'⁴' if order == 4 else '⁶'}", (h[0], at * 8 * h[0] ** order), color=MUTED, fontsize=8
            )
        left.set_xscale("log")
        left.set_yscale("log")
        left.set_xticks([1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2], labels=["1/32", "1/16", "1/8", "1/4", "1/2"])
        left.set_xticks([], minor=True)
        low = int(np.floor(np.log10(min(abs(r.turn) for r in rows if r.family != "truth" and r.h <= 0.6))))
        log_axis(left, "y", max(low, -9), 1)
        left.set_xlabel("step h")
        left.set_ylabel("degrees per revolution, less the true rate")
        left.set_title("the sham rotation", color=INK)
        left.legend(loc="lower right")
        _losses(right, [r for r in rows if r.s == 2])
        return picture(
            figure,
            "sitnikov-steps",
            "Beyond the paper · what the step costs",
            "Left: the rate at which the ellipses turn in the numerical solution. It is a property of the "
            "order, not of the "
            "energy: Gauss and HBVM turn alike. Right: how long the planetoid stays, h by h. Crosses: the "
            "fixed-point "
            "iteration found no solution of a step; a Newton iteration would be needed to go on.",
            "; ".join(
                f"{r.method}: {r.turn:.2e} degrees per revolution" for r in rows if r.family != "truth"
            ),
        )


def usable(row: StepRow) -> bool:
    """Whether the rates of a row describe the whole span of a bound planetoid."""
    return row.lost is None and not row.reason


def truth_compared(runs: Sequence[tuple[str, str, Array, Array]]) -> Picture:
    """|z - true z| over time for several runs: (label, family, t, error)."""
    with drawing():
        figure = sheet(WIDTH, 3.4)
        axes = figure.subplots()
        dashes = ["-", (0, (6, 2)), (0, (2, 1.6)), (0, (8, 2, 2, 2))]
        seen: dict[str, int] = {}
        for label, family, t, error in runs:
            index = seen.get(family, 0)
            seen[family] = index + 1
            time, top = envelope(t, error, 200)
            axes.plot(
                time,
                np.maximum(top, 1e-16),
                color=FAMILY_COLOURS[family],
                linestyle=dashes[index],
                label=label,
                linewidth=1.2,
                marker="o",
                markersize=2.5,
            )
        log_axis(axes, "y", -14, 3, most=9)
        axes.set_xlim(0, T_END)
        axes.set_xlabel("time")
        axes.set_ylabel("|z − true z|")
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        return picture(
            figure,
            "sitnikov-truth",
            "Beyond the paper · against the true trajectory",
            "Conserving the energy is not accuracy. The error of the height, largest value in each of 200 "
            "spans of time.",
            "; ".join(f"{label}: {error[-1]:.2e} at the end" for label, _, _, error in runs),
        )


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
        say("m = 1", sign * D / 2, 0, 0, (0, 12), ha="center")
    low, high = place(0, 0, -2.2), place(0, 0, 2.2)
    axes.plot([low[0], high[0]], [low[1], high[1]], color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    top = float(truth.z.max())
    axes.plot(*place(0, 0, top), "o", color=HBVM, markersize=5)
    say("planetoid, m = 10⁻⁵", 0, 0, top, (9, -3))
    say("z", 0, 0, 2.2, (6, -5), style="italic")
    axes.annotate(
        "",
        place(-D / 2, -1.6, 0),
        place(D / 2, -1.6, 0),
        arrowprops={"arrowstyle": "<->", "color": MUTED, "lw": 0.8},
    )
    say("5 = d, largest distance", 0, -1.6, 0, (0, -12), ha="center", color=MUTED)


def _losses(axes: Axes, rows: Sequence[StepRow]) -> None:
    steps = sorted({r.h for r in rows if r.family != "truth"})
    for row in rows:
        if row.family == "truth":
            continue
        x = steps.index(row.h) + (-0.19 if row.family == "gauss" else 0.19)
        end = row.lost if row.lost is not None else T_END if not row.reason else None
        colour = FAMILY_COLOURS[row.family]
        if end is None:
            axes.plot(x, 40, "x", color=colour, markersize=5)
        else:
            axes.bar(x, end, 0.36, color=colour, alpha=1.0 if row.lost is None else 0.45)
    axes.set_xticks(range(len(steps)), labels=[f"{h:.3g}" for h in steps], rotation=60)
    axes.grid(visible=False, axis="x")
    axes.set_ylim(0, T_END * 1.02)
    axes.set_ylabel("time until the planetoid is lost")
    axes.set_xlabel("step h")
    axes.set_title("who keeps the planetoid to t = 1500", color=INK)
    handles = [
        Line2D([], [], marker="s", linestyle="", color=GAUSS, label="Gauss, s = 2"),
        Line2D([], [], marker="s", linestyle="", color=HBVM, label="HBVM(18,2)"),
        Line2D([], [], marker="x", linestyle="", color=MUTED, label="no convergence"),
    ]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1.2), ncols=3)
