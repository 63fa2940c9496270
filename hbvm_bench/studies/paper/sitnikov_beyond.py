"""Pictures of Sitnikov's problem behind claims of the paper: nodes, steps, chaos."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hbvm_bench.report.figures.canvas import log_axis, say
from hbvm_bench.report.figures.drawn import COLOURS, WIDTH, Said, drawn, number
from hbvm_bench.report.figures.style import INK, MUTED, PAPER, TRUTH
from hbvm_bench.summaries.table import Table
from integrators.protocol import Array

from .experiments.axis_motion import START, Growth
from .experiments.sitnikov import DEGREE, T_END, E, StepRow

FRACTIONS = {1 / n: f"1/{n}" for n in (32, 16, 12, 8, 4, 2)}
LARGEST = 0.6  # step whose rotation is drawn
Scan = Sequence[tuple[int, float, float | None]]  # k, energy error, and when the planetoid is lost


@drawn("sitnikov-nodes", "Beyond the paper · nodes needed for conservation to round-off", WIDTH * 0.62, 3.4)
def by_nodes(figure: Figure, scans: Mapping[float, Scan]) -> Said:
    """Draw the energy error of HBVM(k, 2) against k: practical conservation."""
    axes = figure.subplots()
    ring: Any = {"marker": "o", "mfc": "none", "mec": INK, "linestyle": ""}
    enough = []
    for (h, rows), marker, shade in zip(scans.items(), "os", (1.0, 0.5), strict=True):
        k, error, _ = zip(*rows, strict=True)
        look = {"color": COLOURS["hbvm"], "alpha": shade, "marker": marker, "markersize": 4}
        axes.plot(k, error, label=f"h = {h:g}", **look)
        gone = [row[:2] for row in rows if row[2] is not None]
        if gone:
            axes.plot(*zip(*gone, strict=True), markersize=9, **ring)
        enough += [f"k = {k} with h = {h:g}" for k, error, _ in rows if error <= 1e-13][:1]
    log_axis(axes, "y", -16, 0, most=8)
    axes.set(xlabel="k, nodes of the quadrature", ylabel="largest |H − H₀| / |H₀|", xticks=range(2, 25, 2))
    handles, _ = axes.get_legend_handles_labels()
    lost_ones = Line2D([], [], markersize=8, label="planetoid lost", **ring)
    axes.legend(handles=[*handles, lost_ones], loc="upper right")
    return (
        f"HBVM(k,{DEGREE}) on Sitnikov's problem over [0, {T_END:g}]. The error falls by a constant "
        "factor per node down to round-off; k = 2 is the Gauss method. The first with an energy error of "
        f"at most 1e-13: {' and '.join(enough)}; the paper takes k = 18 with h = 0.5.",
        "; ".join(
            f"h = {h:g}: {rows[0][1]:.0e} for k = {rows[0][0]}, {rows[-1][1]:.0e} for k = {rows[-1][0]}"
            for h, rows in scans.items()
        ),
    )


@drawn("sitnikov-steps", "Beyond the paper · the effect of the step size", WIDTH, 3.7)
def by_step(figure: Figure, rows: Sequence[StepRow]) -> Said:
    """Draw spurious precession against h, and the time at which the planetoid is lost."""
    left, right = figure.subplots(1, 2)
    small = [row for row in rows if row.h <= LARGEST]
    looks: dict[str, Any] = {
        "gauss": {"color": COLOURS["gauss"], "mfc": "none", "markersize": 7},
        "hbvm": {"color": COLOURS["hbvm"], "markersize": 5},
    }
    for s, dash, marker in ((2, "-", "o"), (3, (0, (5, 2)), "s")):
        for family, name in (("gauss", f"Gauss, s = {s}"), ("hbvm", f"HBVM(18,{s})")):
            chosen = [(r.h, abs(r.turn)) for r in small if (r.family, r.s) == (family, s) and r.usable]
            if chosen:
                x, y = zip(*chosen, strict=True)
                left.plot(x, y, linestyle=dash, marker=marker, label=name, **looks[family])
    h = np.array([1 / 32, LARGEST])
    for s, power in ((2, "h⁴"), (3, "h⁶")):
        finest = next(r for r in rows if r.family == "hbvm" and r.s == s)
        guide = 3.0 * abs(finest.turn) * (h / finest.h) ** (2 * s)
        left.plot(h, guide, color=TRUTH, linewidth=1.0, zorder=1)
        say(left, power, (h[0], guide[0]), (2, 6), color=MUTED, fontsize=9)
    left.set_xscale("log")
    ticks = [step for step in FRACTIONS if step != 1 / 12]
    left.set_xticks(ticks, labels=[FRACTIONS[step] for step in ticks])
    left.set_xticks([], minor=True)
    low = int(np.floor(np.log10(min(abs(r.turn) for r in small))))
    log_axis(left, "y", max(low - 1, -9), 1)
    left.set(
        xlabel="step h", ylabel="degrees per revolution, less the exact rate", title="spurious precession"
    )
    left.legend(loc="lower right")
    _losses(right, [r for r in rows if r.s == 2])
    rate = {r.h: r.turn for r in rows if (r.family, r.s) == ("hbvm", 2)}
    return (
        "Left: the rate at which the ellipses turn in the numerical solution. It is a property of the "
        "order, not of the energy: Gauss and HBVM turn alike. Right: how long the planetoid stays, h by "
        "h. Crosses: neither the fixed-point nor the Newton iteration found a solution of a step.",
        f"Under HBVM(18,2) the ellipses turn by {rate[1 / 32]:.1e} degrees per revolution with h = 1/32 "
        f"and by {rate[1 / 2]:.1f} with h = 1/2. The table below has all numbers.",
    )


def _losses(axes: Axes, rows: Sequence[StepRow]) -> None:
    steps = sorted({r.h for r in rows})
    for row in rows:
        x = steps.index(row.h) + (-0.19 if row.family == "gauss" else 0.19)
        colour = COLOURS[row.family]
        if row.lost is None and row.reason:
            axes.plot(x, 40, "x", color=colour, markersize=5)
        else:
            end, shade = (T_END, 1.0) if row.lost is None else (row.lost, 0.45)
            axes.bar(x, end, 0.36, color=colour, alpha=shade)
    axes.set_xticks(range(len(steps)), labels=[FRACTIONS.get(h, f"{h:g}") for h in steps], rotation=55)
    axes.grid(visible=False, axis="x")
    axes.set(ylim=(0, T_END * 1.02), xlabel="step h", ylabel="time until the planetoid is lost")
    axes.set_title("planetoid stays to t = 1500")
    handles = [
        Line2D([], [], marker=marker, linestyle="", color=colour, label=label)
        for marker, colour, label in (
            ("s", COLOURS["gauss"], "Gauss, s = 2"),
            ("s", COLOURS["hbvm"], "HBVM(18,2)"),
            ("x", MUTED, "no convergence"),
        )
    ]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1.2), ncols=3)


def step_table(rows: Sequence[StepRow]) -> Table:
    """Return the table behind `by_step`: Gauss and HBVM side by side, a line per degree and step."""
    row_of = {(row.s, row.h, row.family): row for row in rows}
    lines = []
    for s, h in dict.fromkeys((row.s, row.h) for row in rows):
        pair = [row_of[s, h, family] for family in ("gauss", "hbvm")]
        columns = zip(*(_cells(row) for row in pair), strict=True)
        lines.append((str(s), FRACTIONS.get(h, f"{h:g}"), *(cell for both in columns for cell in both)))
    heads = (
        "planetoid lost at",
        "energy error",
        "spurious precession, degrees per rev.",
        "error of the period",
        "z at 1500 off by",
    )
    return Table(
        "Step size and errors",
        ("s", "h", *("Gauss", "HBVM") * len(heads)),
        lines,
        "HBVM with k = 18. Largest relative error of H; precession of the ellipses less the exact one; "
        "relative error of the primaries' period; |z − reference z| at the end. A planetoid that is lost "
        "has no such numbers.",
        words=(),
        key="sitnikov-step-table",
        groups=(("", 2), *((head, 2) for head in heads)),
    )


def _cells(row: StepRow) -> tuple[str, ...]:
    fate = f"{row.lost:.0f}" if row.lost is not None else "no convergence" if row.reason else "stays"
    rates = (number(row.turn, 3), number(row.slow), number(row.z_error)) if row.usable else ("–",) * 3
    return (fate, number(row.energy), *rates)


@drawn("sitnikov-chaos", "Beyond the paper · chaotic or regular", WIDTH, 4.4)
def chaos(
    figure: Figure, rows: Sequence[Growth], points: Sequence[tuple[float, Array]], critical: float
) -> Said:
    """Growth rates against e for the paper's start; the stroboscopic section at the paper's e."""
    left, right = figure.subplots(1, 2)
    motion = COLOURS["motion"]
    spans = sorted({turn for row in rows for turn, _ in row.along if row.left is None})
    es = [row.e for row in rows]
    left.plot(es, [row.across for row in rows], color=INK, marker="D", markersize=4, label="off the axis")
    for span, face in zip(spans, (PAPER, motion), strict=False):
        values = [abs(dict(row.along).get(span, math.nan)) for row in rows]
        label = f"along it, {span} revolutions"
        left.plot(es, values, color=motion, marker="o", markersize=4.5, mfc=face, label=label)
    log_axis(left, "y", -5, 1)
    left.axvline(critical, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)))
    say(left, "the paper's ē", (critical, 2.5e-5), (-5, 0), ha="right", fontsize=8, color=MUTED)
    left.set(xlabel="eccentricity e", ylabel="growth rate of an offset, per unit of time")
    left.set_title("the paper's initial condition, v = 1/2")
    left.legend(loc="center left", bbox_to_anchor=(0.02, 0.66))
    look: Any = {"color": MUTED, "markersize": 1.3, "alpha": 0.8, "rasterized": True}
    for z, v in (orbit[1:].T for speed, orbit in points if speed != START[1]):
        right.plot(z, v, ".", **look)
        right.plot(z, -v, ".", **look)
    look = {"color": motion, "markersize": 3.0, "rasterized": True}
    right.plot(*dict(points)[START[1]].T, ".", label="the paper's orbit", **look)
    right.set(xlim=(-4, 4), ylim=(-1.4, 1.4), xlabel="z", ylabel="velocity")
    right.set_title(f"at every apocentre of the primaries, e = {E:g}")
    right.legend(loc="upper right", markerscale=3)
    at = min(rows, key=lambda row: abs(row.e - E))
    along = ", ".join(f"{rate:.1e} after {turn} revolutions" for turn, rate in at.along)
    return (
        "Left: the rate at which a small offset grows. Along the axis it falls with the length of the "
        "run, as the logarithm of time over time, up to e ≈ 0.8: this orbit is regular there. Beyond, it "
        "no longer falls, and the orbit is chaotic. Off the axis it is large at every "
        "eccentricity. Right: many orbits, seen once per revolution. The paper's orbit is on "
        "a closed curve inside the regular region; outside, planetoids wander and leave. Mass of the "
        "planetoid neglected.",
        f"At e = {at.e:g}: along the axis {along}; off the axis {at.across:.3f}, a factor e every "
        f"{1 / at.across:.2f} units of time.",
    )
