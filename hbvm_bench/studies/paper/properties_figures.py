"""Pictures of the methods' own properties: the order, and the threshold k = nu s / 2."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hbvm_bench.report.figures.canvas import log_axis, say
from hbvm_bench.report.figures.style import INK, MUTED, PAPER, TRUTH
from hbvm_bench.studies.paper.drawn import HBVM, WIDTH, Said, drawn
from hbvm_bench.studies.paper.experiments.properties import Order

MARKERS = dict(zip(range(1, 6), "osD^v", strict=True))
Row = tuple[int, int, float]


@drawn("properties-order", "The order is 2s for every k", WIDTH * 0.66, 3.8)
def order(figure: Figure, rows: Sequence[Order]) -> Said:
    """Errors against steps for s = 1 .. 5 and several k."""
    axes = figure.subplots()
    for s in sorted({row.s for row in rows}):
        chosen = [row for row in rows if row.s == s]
        for row in chosen:
            axes.plot(
                row.h,
                row.error,
                color=HBVM,
                marker=MARKERS[s],
                mfc=HBVM if row.k == s else "none",
                markersize=3 if row.k == s else 7,
                linewidth=0.8,
                label=f"_HBVM(k={row.k}, s={row.s})",
            )
        say(
            axes,
            f"s = {s}: {min(r.slope for r in chosen):.2f} … {max(r.slope for r in chosen):.2f}",
            (chosen[0].h[0], chosen[0].error[0]),
            (8, -3),
            fontsize=8,
            color=INK,
            annotation_clip=False,
        )
    axes.set_xscale("log")
    log_axis(axes, "y", -16, -2, most=8)
    axes.set_xticks([0.01, 0.03, 0.1, 0.3, 1], labels=["0.01", "0.03", "0.1", "0.3", "1"])
    axes.set_xlim(0.008, 2.5)
    axes.minorticks_off()
    axes.set(xlabel="step h", ylabel="error at t = 6")
    return (
        "HBVM(k,s) on Hénon–Heiles for k = s (small, filled), s + 1, 2s and 3s (open), which lie on one "
        "another: the silent stages do not change the order. The numbers are the fitted slopes.",
        f"{len(rows)} pairs (k, s); the largest distance of a fitted order from 2s is "
        f"{max(abs(row.slope - 2 * row.s) for row in rows):.2f}.",
    )


@drawn("properties-threshold", "Conservation from k ≥ νs/2", WIDTH, 3.6)
def threshold(figure: Figure, cubic: Sequence[Row], quintic: Sequence[Row]) -> Said:
    """Energy error against k for two polynomial Hamiltonians, with the threshold drawn in."""
    panels = figure.subplots(1, 2, sharey=True)
    for axes, rows, nu, name in zip(
        panels, (cubic, quintic), (3, 5), ("Hénon–Heiles, degree 3", "the quintic, degree 5"), strict=True
    ):
        _threshold(axes, rows, nu)
        axes.set_title(name, color=INK)
    panels[0].set_ylabel("largest |H − H₀| / |H₀|")
    panels[0].legend(loc="upper right", ncols=1)
    return (
        "Largest relative error of H over [0, 50] with h = 1. Filled: k ≥ νs/2, where the paper "
        "promises exact conservation. The dips to round-off just below it, at high s, are errors too "
        "small to see, not conservation.",
        f"Largest error for k ≥ νs/2: {_kept(cubic, 3):.1e} for degree 3, {_kept(quintic, 5):.1e} for "
        "degree 5.",
    )


def _kept(rows: Sequence[Row], nu: int) -> float:
    return max(error for s, k, error in rows if 2 * k >= nu * s)


def _threshold(axes: Axes, rows: Sequence[Row], nu: int) -> None:
    for s in sorted({row[0] for row in rows}):
        k = np.array([row[1] for row in rows if row[0] == s])
        error = np.array([row[2] for row in rows if row[0] == s])
        exact = 2 * k >= nu * s
        axes.plot(k, error, color=HBVM, alpha=0.35 + 0.13 * s, linewidth=0.9, zorder=2, label=f"_s = {s}")
        axes.plot(k[exact], error[exact], MARKERS[s], color=HBVM, markersize=5, label=f"s = {s}")
        axes.plot(
            k[~exact], error[~exact], MARKERS[s], mfc=PAPER, mec=HBVM, markersize=5, label=f"_s = {s}, fewer"
        )
    axes.axhspan(1e-17, 5e-15, color=TRUTH, alpha=0.18, linewidth=0)
    axes.text(15.4, 2.5e-17, "round-off", fontsize=8, color=MUTED, ha="right")
    log_axis(axes, "y", -17, 0, most=9)
    axes.set_xlim(0.5, 15.5)
    axes.set_xticks(range(1, 16, 2))
    axes.set_xlabel("k")
