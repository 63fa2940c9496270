"""Pictures of the planetoid's motion along the axis: where it is regular, where it is not."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from hbvm_bench.report.figures.canvas import log_axis, say
from hbvm_bench.report.figures.style import INK, MUTED, PAPER
from hbvm_bench.studies.paper.axis_motion import START, Growth
from hbvm_bench.studies.paper.drawn import MOTION, SEQUENTIAL, WIDTH, Said, drawn
from integrators.protocol import Array


@drawn("sitnikov-chaos", "Beyond the paper · is it chaos?", WIDTH, 4.4)
def chaos(
    figure: Figure, rows: Sequence[Growth], points: Sequence[tuple[float, Array]], e: float, critical: float
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
        title=f"at every apocentre of the primaries, e = {e:g}",
    )
    right.legend(loc="upper right", markerscale=3)
    at = min(rows, key=lambda row: abs(row.e - e))
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
def territory(
    figure: Figure, es: Sequence[float], speeds: Sequence[float], left_after: Array, turns: int, e: float
) -> Said:
    """Where planetoids stay: revolutions until they leave, over eccentricity and speed."""
    axes = figure.subplots()
    shown = np.ma.masked_invalid(np.log10(left_after))
    mesh = axes.pcolormesh(
        es,
        speeds,
        shown.T,
        cmap=SEQUENTIAL.reversed(),
        vmin=0,
        vmax=math.log10(turns),
        rasterized=True,
        shading="nearest",
    )
    bar = figure.colorbar(mesh, ax=axes, pad=0.02, aspect=30)
    ticks = [value for value in (1, 3, 10, 30, 100, 300) if value <= turns]
    bar.set_ticks([math.log10(value) for value in ticks], labels=[str(value) for value in ticks])
    bar.set_label(f"revolutions until |z| > 100; blank: stays for {turns}")
    axes.plot(e, START[1], "o", color=MOTION, markersize=8, mec=PAPER, mew=1.5, zorder=5)
    say(axes, "the paper's run", (e, START[1]), (-9, -3), ha="right", fontsize=8.5, color=INK)
    axes.grid(visible=False)
    axes.set(xlabel="eccentricity e", ylabel="speed through the plane at apocentre")
    stays = np.isnan(left_after)
    nearest = int(np.argmin(np.abs(np.asarray(es) - e)))
    gone = np.flatnonzero(~stays[nearest])
    edge = speeds[int(gone[0])] if gone.size else math.nan
    return (
        "For each eccentricity of the primaries and each speed at the start: how long the planetoid "
        "stays, on the axis and without rounding's help or harm. The edge of the blank region is the "
        "end of regular motion; the paper's run lies inside it.",
        f"At e = {es[nearest]:g} the slowest planetoid that leaves has speed {edge:.3g}.",
    )
