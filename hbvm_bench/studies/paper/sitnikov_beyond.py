"""Pictures of Sitnikov's problem that the paper does not have: nodes, steps, truth, chaos."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hbvm_bench.report.figures.canvas import log_axis, say
from hbvm_bench.report.figures.style import INK, MUTED, PAPER, TRUTH
from hbvm_bench.studies.paper.drawn import FAMILIES, GAUSS, HBVM, MOTION, WIDTH, Said, drawn, heat, number
from hbvm_bench.studies.paper.experiments.axis_motion import (
    MAP_ECCENTRICITIES,
    MAP_SPEEDS,
    MAP_TURNS,
    START,
    Growth,
)
from hbvm_bench.studies.paper.experiments.sitnikov import DEGREE, T_END, E, StepRow, usable
from hbvm_bench.summaries.table import Table
from integrators.protocol import Array

FRACTIONS = {1 / 32: "1/32", 1 / 16: "1/16", 1 / 12: "1/12", 1 / 8: "1/8", 1 / 4: "1/4", 1 / 2: "1/2"}


@drawn(
    "sitnikov-nodes", "Beyond the paper · how many nodes make the conservation practical", WIDTH * 0.62, 3.4
)
def by_nodes(figure: Figure, scans: Mapping[float, Sequence[tuple[int, float, float | None]]]) -> Said:
    """Draw the energy error of HBVM(k, 2) against k: practical conservation."""
    axes = figure.subplots()
    for (h, rows), marker, shade in zip(sorted(scans.items(), reverse=True), "os", (1.0, 0.5), strict=True):
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
    axes.set(xlabel="k, nodes of the quadrature", ylabel="largest |H − H₀| / |H₀|")
    axes.set_xticks(range(2, 25, 2))
    handles, _ = axes.get_legend_handles_labels()
    handles.append(
        Line2D([], [], marker="o", mfc="none", mec=INK, linestyle="", markersize=8, label="planetoid lost")
    )
    axes.legend(handles=handles, loc="upper right")
    return (
        f"HBVM(k,{DEGREE}) on Sitnikov's problem over [0, {T_END:g}]. The error falls by a constant "
        f"factor per node down to round-off; k = 2 is the Gauss method. {_enough(scans)}",
        "; ".join(
            f"h = {h:g}: {rows[0][1]:.0e} for k = {rows[0][0]}, {rows[-1][1]:.0e} for k = {rows[-1][0]}"
            for h, rows in scans.items()
        ),
    )


def _enough(scans: Mapping[float, Sequence[tuple[int, float, float | None]]]) -> str:
    first = {
        h: next((k for k, error, _ in rows if error <= 1e-13), None)
        for h, rows in sorted(scans.items(), reverse=True)
    }
    words = " and ".join(f"k = {k} with h = {h:g}" for h, k in first.items() if k is not None)
    return f"The first to keep the energy to 1e-13: {words}; the paper takes k = 18 with h = 0.5."


@drawn("sitnikov-steps", "Beyond the paper · what the step costs", WIDTH, 3.7)
def by_step(figure: Figure, rows: Sequence[StepRow]) -> Said:
    """Draw the sham rotation against h, and the time at which the planetoid is lost."""
    left, right = figure.subplots(1, 2)
    for s, dash, marker in ((2, "-", "o"), (3, (0, (5, 2)), "s")):
        for family in ("gauss", "hbvm"):
            chosen = [r for r in rows if r.family == family and r.s == s and usable(r) and r.h <= 0.6]
            if not chosen:
                continue
            name = f"Gauss, s = {s}" if family == "gauss" else f"HBVM(18,{s})"
            face = FAMILIES[family] if family == "hbvm" else "none"
            left.plot(
                [r.h for r in chosen],
                [abs(r.turn) for r in chosen],
                linestyle=dash,
                color=FAMILIES[family],
                marker=marker,
                mfc=face,
                markersize=5 if family == "hbvm" else 7,
                label=name,
            )
    h = np.array([1 / 32, 0.6])
    for s in (2, 3):
        finest = next(r for r in rows if r.family == "hbvm" and r.s == s)
        guide = 3.0 * abs(finest.turn) * (h / finest.h) ** (2 * s)
        left.plot(h, guide, color=TRUTH, linewidth=1.0, zorder=1)
        say(left, f"h{'⁴' if s == 2 else '⁶'}", (h[0], guide[0]), (2, 6), color=MUTED, fontsize=9)
    left.set_xscale("log")
    ticks = [step for step in FRACTIONS if step != 1 / 12]
    left.set_xticks(ticks, labels=[FRACTIONS[step] for step in ticks])
    left.set_xticks([], minor=True)
    low = int(np.floor(np.log10(min(abs(r.turn) for r in rows if r.family != "truth" and r.h <= 0.6))))
    log_axis(left, "y", max(low - 1, -9), 1)
    left.set(xlabel="step h", ylabel="degrees per revolution, less the true rate", title="the sham rotation")
    left.legend(loc="lower right")
    _losses(right, [r for r in rows if r.s == 2])

    def rate(h: float) -> float:
        return next(r.turn for r in rows if (r.family, r.s, r.h) == ("hbvm", 2, h))

    return (
        "Left: the rate at which the ellipses turn in the numerical solution. It is a property of the "
        "order, not of the energy: Gauss and HBVM turn alike. Right: how long the planetoid stays, h by "
        "h. Crosses: neither the fixed-point nor the Newton iteration found a solution of a step.",
        f"Under HBVM(18,2) the ellipses turn by {rate(1 / 32):.1e} degrees per revolution with h = 1/32 "
        f"and by {rate(1 / 2):.1f} with h = 1/2. The table below has all numbers.",
    )


@drawn("sitnikov-truth", "Beyond the paper · against the true trajectory", WIDTH, 3.4)
def truth_compared(figure: Figure, runs: Sequence[tuple[str, str, Array, Array]]) -> Said:
    """Draw |z - true z| over time for several runs: (label, family, t, error)."""
    axes = figure.subplots()
    dashes = ["-", (0, (6, 2)), (0, (2, 1.6)), (0, (8, 2, 2, 2))]
    seen: dict[str, int] = {}
    for label, family, t, error in runs:
        index = seen.get(family, 0)
        seen[family] = index + 1
        axes.plot(
            t[1:],
            np.maximum(error[1:], 1e-16),
            color=FAMILIES[family],
            linestyle=dashes[index],
            label=label,
            linewidth=1.2,
            marker="o",
            markersize=2.5,
        )
    log_axis(axes, "y", -13, 1, most=7)
    axes.set(xlim=(0, T_END), xlabel="time", ylabel="|z − true z|")
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    return (
        "Conserving the energy is not accuracy: all HBVM runs here keep the energy to 1e-13. The error "
        "of the height at the times of the stored 128-bit reference.",
        "; ".join(f"{label}: {error[-1]:.2e} at the end" for label, _, _, error in runs),
    )


@drawn("sitnikov-chaos", "Beyond the paper · is it chaos?", WIDTH, 4.4)
def chaos(
    figure: Figure, rows: Sequence[Growth], points: Sequence[tuple[float, Array]], critical: float
) -> Said:
    """Growth rates against e for the paper's start; the stroboscopic section at the paper's e."""
    left, right = figure.subplots(1, 2)
    spans = sorted({turn for row in rows for turn, _ in row.along if row.left is None})
    es = [row.e for row in rows]
    left.plot(es, [row.across for row in rows], color=INK, marker="D", markersize=4, label="off the axis")
    for span, face in zip(spans, (PAPER, MOTION), strict=False):
        values = [abs(dict(row.along).get(span, math.nan)) for row in rows]
        left.plot(
            es,
            values,
            color=MOTION,
            marker="o",
            markersize=4.5,
            mfc=face,
            label=f"along it, {span} revolutions",
        )
    log_axis(left, "y", -5, 1)
    left.axvline(critical, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)))
    say(left, "the paper's ē", (critical, 2.5e-5), (-5, 0), ha="right", fontsize=8, color=MUTED)
    left.set(
        xlabel="eccentricity e",
        ylabel="growth rate of an offset, per unit of time",
        title="the paper's start, v = 1/2",
    )
    left.legend(loc="center left", bbox_to_anchor=(0.02, 0.66))
    for speed, orbit in points:
        if speed == START[1]:
            continue
        right.plot(orbit[1:, 0], orbit[1:, 1], ".", color=MUTED, markersize=1.3, alpha=0.8, rasterized=True)
        right.plot(orbit[1:, 0], -orbit[1:, 1], ".", color=MUTED, markersize=1.3, alpha=0.8, rasterized=True)
    ours = dict(points)[START[1]]
    right.plot(
        ours[:, 0], ours[:, 1], ".", color=MOTION, markersize=3.0, rasterized=True, label="the paper's orbit"
    )
    right.set(
        xlim=(-4, 4),
        ylim=(-1.4, 1.4),
        xlabel="z",
        ylabel="velocity",
        title=f"at every apocentre of the primaries, e = {E:g}",
    )
    right.legend(loc="upper right", markerscale=3)
    at = min(rows, key=lambda row: abs(row.e - E))
    return (
        "Left: the rate at which a small offset grows. Along the axis it falls with the length of the "
        "run, as the logarithm of time over time, up to e ≈ 0.8: the orbit of this start is regular "
        "there. Beyond, it no longer falls, and the orbit is chaotic. Off the axis it is large at every "
        "eccentricity. Right: orbits of many starts, seen once per revolution. The paper's start is on "
        "a closed curve inside the regular region; outside, planetoids wander and leave. Mass of the "
        "planetoid neglected.",
        f"At e = {at.e:g}: along the axis "
        + ", ".join(f"{rate:.1e} after {turn} revolutions" for turn, rate in at.along)
        + f"; off the axis {at.across:.3f}, a factor e every {1 / at.across:.2f} units of time.",
    )


@drawn("sitnikov-territory", "Beyond the paper · who stays on the axis", WIDTH * 0.72, 4.0, values=True)
def territory(figure: Figure, left_after: Array) -> Said:
    """Where planetoids stay: revolutions until they leave, over eccentricity and speed."""
    axes = figure.subplots()
    es, speeds, turns = MAP_ECCENTRICITIES, MAP_SPEEDS, MAP_TURNS
    mesh = heat(axes, es, speeds, left_after.T, 0, math.log10(turns))
    bar = figure.colorbar(mesh, ax=axes, pad=0.02, aspect=30)
    ticks = [value for value in (1, 3, 10, 30, 100, 300) if value <= turns]
    bar.set_ticks([math.log10(value) for value in ticks], labels=[str(value) for value in ticks])
    bar.set_label(f"revolutions until |z| > 100; blank: stays for {turns}")
    axes.plot(E, START[1], "o", color=MOTION, markersize=8, mec=PAPER, mew=1.5, zorder=5)
    say(axes, "the paper's run", (E, START[1]), (-9, -3), ha="right", fontsize=8.5, color=INK)
    axes.grid(visible=False)
    axes.set(xlabel="eccentricity e", ylabel="speed through the plane at apocentre")
    stays = np.isnan(left_after)
    nearest = int(np.argmin(np.abs(np.asarray(es) - E)))
    gone = np.flatnonzero(~stays[nearest])
    edge = speeds[int(gone[0])] if gone.size else math.nan
    return (
        "For each eccentricity of the primaries and each speed at the start: how long the planetoid "
        "stays, on the axis and without rounding's help or harm. The edge of the blank region is the "
        "end of regular motion; the paper's run lies inside it.",
        f"At e = {es[nearest]:g} the slowest planetoid that leaves has speed {edge:.3g}.",
    )


def step_table(rows: Sequence[StepRow]) -> Table:
    """Return the table behind `by_step`: Gauss and HBVM side by side, a line per degree and step."""
    found = {(row.s, row.h, row.family): row for row in rows}
    lines = []
    for s, h in dict.fromkeys((row.s, row.h) for row in rows if row.family != "truth"):
        pair = [found[s, h, family] for family in ("gauss", "hbvm")]
        lines.append(
            (
                str(s),
                FRACTIONS.get(h, f"{h:g}"),
                *(_fate(row) for row in pair),
                *(number(row.energy) for row in pair),
                *(number(row.turn, 3) if usable(row) else "–" for row in pair),
                *(number(row.slow) if usable(row) else "–" for row in pair),
                *(number(row.z_error) if usable(row) else "–" for row in pair),
            )
        )
    return Table(
        key="sitnikov-step-table",
        title="The step and its price",
        head=("s", "h", *("Gauss", "HBVM") * 5),
        rows=tuple(lines),
        words=(),
        groups=(
            ("", 2),
            ("planetoid lost at", 2),
            ("energy error", 2),
            ("sham rotation, degrees per rev.", 2),
            ("error of the period", 2),
            ("z at 1500 off by", 2),
        ),
        note="HBVM with k = 18. Largest relative error of H; rotation of the ellipses less the true one; "
        "relative error of the primaries' period; |z − true z| at the end. A planetoid that is lost has no "
        "such numbers.",
    )


def _fate(row: StepRow) -> str:
    return f"{row.lost:.0f}" if row.lost is not None else "no convergence" if row.reason else "stays"


def _losses(axes: Axes, rows: Sequence[StepRow]) -> None:
    steps = sorted({r.h for r in rows if r.family != "truth"})
    for row in rows:
        if row.family == "truth":
            continue
        x = steps.index(row.h) + (-0.19 if row.family == "gauss" else 0.19)
        end = row.lost if row.lost is not None else T_END if not row.reason else None
        colour = FAMILIES[row.family]
        if end is None:
            axes.plot(x, 40, "x", color=colour, markersize=5)
        else:
            axes.bar(x, end, 0.36, color=colour, alpha=1.0 if row.lost is None else 0.45)
    axes.set_xticks(range(len(steps)), labels=[FRACTIONS.get(h, f"{h:g}") for h in steps], rotation=55)
    axes.grid(visible=False, axis="x")
    axes.set(
        ylim=(0, T_END * 1.02),
        ylabel="time until the planetoid is lost",
        xlabel="step h",
        title="who keeps the planetoid to t = 1500",
    )
    handles = [
        Line2D([], [], marker="s", linestyle="", color=GAUSS, label="Gauss, s = 2"),
        Line2D([], [], marker="s", linestyle="", color=HBVM, label="HBVM(18,2)"),
        Line2D([], [], marker="x", linestyle="", color=MUTED, label="no convergence"),
    ]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1.2), ncols=3)
