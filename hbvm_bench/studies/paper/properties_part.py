"""What the paper claims of the methods themselves: the order, and the threshold k = nu s / 2."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hbvm_bench.measure.computation import Task
from hbvm_bench.report.document import Claim, Maker
from hbvm_bench.report.figures.canvas import log_axis, say
from hbvm_bench.report.figures.drawn import COLOURS, WIDTH, Said, drawn, number
from hbvm_bench.report.figures.style import INK, MUTED, PAPER, TRUTH
from hbvm_bench.report.parts import Part, PartResults
from hbvm_bench.summaries.table import Table

from .experiments import properties
from .experiments.properties import PAIRS, ErrorRow, Order

PROBLEM = "The theory's statements, each measured on the paper's own polynomial problems."
HBVM = COLOURS["hbvm"]
MARKERS = dict(zip(range(1, 6), "osD^v", strict=True))
RUNS = [
    Task("orders", properties.orders, 4),
    Task("reversal", properties.reversals),
    Task("stability", properties.stability),
    Task("collocation", properties.collocation_gap),
    Task("same bits", properties.same_bits),
    Task("cubic", partial(properties.conservation, 3)),
    Task("quintic", partial(properties.conservation, 5)),
    Task("ranks", properties.ranks),
    Task("iterations", properties.iterations),
    Task("extended", properties.extended),
    Task("symplectic", properties.defects),
]


def _blocks(results: PartResults) -> list[Maker]:
    return [
        ("the methods", lambda: PROBLEM),
        ("the order", lambda: order(results["orders"])),
        ("the threshold", lambda: threshold(results["cubic"], results["quintic"])),
        ("collocation and symplecticity", lambda: _collocation(results["extended"], results["symplectic"])),
    ]


def _collocation(residuals: Sequence[ErrorRow], defects: Sequence[tuple[str, float]]) -> Table:
    residual = "residual of σ′ = Σ Pⱼ ∫ Pⱼ f(σ) at the nodes"
    defect = "|MᵀJM − J|, M the derivative of one step"
    return Table(
        "Extended collocation conditions, and symplecticity",
        ("method", "quantity", "defect"),
        [
            *((f"HBVM(k={k}, s={s}, h=0.5)", residual, number(value)) for k, s, value in residuals),
            *((method, defect, number(value)) for method, value in defects),
        ],
        "The residual is on the quintic, where the integrals are exact from k ≥ 5s/2 on; "
        "the derivative on Hénon–Heiles. HBVM with k > s conserves the energy and is not symplectic; for "
        "Gauss it is the reverse.",
        words=(0, 1),
        key="claims-collocation",
    )


def _claims(results: PartResults) -> list[Claim]:
    off = max(abs(row.slope - 2 * row.s) for row in results["orders"])
    back = max(error for _, error in results["reversal"])
    edge, inside = results["stability"]
    scans: list[tuple[list[ErrorRow], int]] = [(results["cubic"], 3), (results["quintic"], 5)]
    error = max(_largest_error(rows, nu) for rows, nu in scans)
    below = min(error for rows, nu in scans for s, k, error in rows if 2 * k < nu * s and s <= 3)
    same = "; the results are bitwise identical" if results["same bits"] else ""
    ranks_right = results["ranks"] == [s for _, s in PAIRS]
    turns = [count for _, count in results["iterations"]]
    met = max(value for k, s, value in results["extended"] if 2 * k >= 5 * s)
    unmet = min(value for k, s, value in results["extended"] if 2 * k < 5 * s)
    gauss = max(value for name, value in results["symplectic"] if name.startswith("Gauss"))
    hbvm = min(value for name, value in results["symplectic"] if name.startswith("HBVM"))
    return [
        Claim(
            "HBVM(k,s) has order 2s for all k ≥ s",
            "Section 2",
            f"fitted orders within {off:.2f} of 2s for s = 1 … 5 and k = s, s + 1, 2s, 3s",
            "holds" if off < 0.1 else "no",
        ),
        Claim(
            "It is symmetric",
            "Section 2",
            f"to t = 100 and back misses the initial state by {number(back)} at most",
            "holds" if back < 1e-12 else "no",
        ),
        Claim(
            "It is perfectly A-stable",
            "Section 2",
            f"| |R(iy)| − 1 | ≤ {number(edge)} for |y| ≤ 1e4, and |R| ≤ {inside:.12f} at 2000 points of the "
            f"left half plane, for {len(PAIRS)} pairs (k, s)",
            "holds" if edge < 1e-12 and inside < 1 else "no",
        ),
        Claim(
            "For k = s it is the Gauss method of order 2s",
            "Section 2",
            f"its tableau is that of collocation to {number(results['collocation'])}, s = 1 … 8{same}",
            "holds" if same else "partly",
        ),
        Claim(
            "It conserves polynomial H of degree ν exactly when k ≥ νs/2",
            "Section 2",
            f"relative error ≤ {number(error)} for all k ≥ νs/2 with ν = 3 and 5; for smaller k and s ≤ 3 it "
            f"is {number(below)} or more",
            "holds" if error < 1e-13 else "no",
        ),
        Claim(
            "The system to solve has block size s, whatever k",
            "Section 2, remark",
            f"the stage matrix has rank s for all {len(PAIRS)} pairs{'' if ranks_right else ' but some'}"
            f"; from k = 2 to k = 36 the iterations per step go from {min(turns):.1f} to {max(turns):.1f}",
            "holds" if ranks_right else "no",
        ),
        Claim(
            "The extended collocation conditions hold at the nodes",
            "Section 2",
            f"residual ≤ {number(met)} for k ≥ νs/2, ≥ {number(unmet)} below",
            "holds" if met < 1e-13 else "no",
        ),
        Claim(
            "Gauss methods are symplectic (and HBVM with k > s is not, which the paper does not say)",
            "Section 1",
            f"|MᵀJM − J|: Gauss ≤ {number(gauss)}, HBVM ≥ {number(hbvm)}",
            "holds" if gauss < 1e-11 < hbvm else "no",
        ),
    ]


@drawn("properties-order", "The order is 2s for every k", WIDTH * 0.66, 3.8)
def order(figure: Figure, rows: Sequence[Order]) -> Said:
    """Errors against steps for s = 1 .. 5 and several k."""
    axes = figure.subplots()
    for s in sorted({row.s for row in rows}):
        chosen = [row for row in rows if row.s == s]
        for row in chosen:
            filled = {"mfc": HBVM, "markersize": 3} if row.k == s else {"mfc": "none", "markersize": 7}
            label = f"_HBVM(k={row.k}, s={row.s})"
            axes.plot(row.h, row.error, color=HBVM, marker=MARKERS[s], linewidth=0.8, label=label, **filled)
        slopes = [row.slope for row in chosen]
        at = (chosen[0].h[0], chosen[0].error[0])
        words = f"s = {s}: {min(slopes):.2f} … {max(slopes):.2f}"
        say(axes, words, at, (8, -3), fontsize=8, annotation_clip=False)
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
def threshold(figure: Figure, cubic: Sequence[ErrorRow], quintic: Sequence[ErrorRow]) -> Said:
    """Energy error against k for two polynomial Hamiltonians, with the threshold drawn in."""
    left, right = figure.subplots(1, 2, sharey=True)
    _threshold(left, cubic, 3, "Hénon–Heiles, degree 3")
    _threshold(right, quintic, 5, "the quintic, degree 5")
    left.set_ylabel("largest |H − H₀| / |H₀|")
    left.legend(loc="upper right", ncols=1)
    return (
        "Largest relative error of H over [0, 50] with h = 1. Filled: k ≥ νs/2, where the paper "
        "promises exact conservation. The dips to round-off just below it, at high s, are errors below "
        "round-off, not conservation.",
        f"Largest error for k ≥ νs/2: {_largest_error(cubic, 3):.1e} for degree 3, "
        f"{_largest_error(quintic, 5):.1e} for degree 5.",
    )


def _largest_error(rows: Sequence[ErrorRow], nu: int) -> float:
    return max(error for s, k, error in rows if 2 * k >= nu * s)


def _threshold(axes: Axes, rows: Sequence[ErrorRow], nu: int, title: str) -> None:
    for s in sorted({row[0] for row in rows}):
        k, error = np.array([row[1:] for row in rows if row[0] == s]).T
        exact, look = 2 * k >= nu * s, {"linestyle": "", "marker": MARKERS[s], "markersize": 5}
        axes.plot(k, error, color=HBVM, alpha=0.35 + 0.13 * s, linewidth=0.9, zorder=2, label=f"_s = {s}")
        axes.plot(k[exact], error[exact], color=HBVM, label=f"s = {s}", **look)
        axes.plot(k[~exact], error[~exact], mfc=PAPER, mec=HBVM, label=f"_s = {s}, fewer", **look)
    axes.axhspan(1e-17, 5e-15, color=TRUTH, alpha=0.18, linewidth=0)
    axes.text(15.4, 2.5e-17, "round-off", fontsize=8, color=MUTED, ha="right")
    log_axis(axes, "y", -17, 0, most=9)
    axes.set(xlim=(0.5, 15.5), xticks=range(1, 16, 2), xlabel="k")
    axes.set_title(title, color=INK)


PART = Part("claims", "What the paper says of the methods", RUNS, _claims, _blocks)
