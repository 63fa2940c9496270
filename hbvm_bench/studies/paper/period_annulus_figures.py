"""The figures of the period annulus: the paper's two, the period, and the fate of orbits near the edge."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from hbvm_bench.report.figures.canvas import log_axis, say
from hbvm_bench.report.figures.style import INK, MUTED, TRUTH
from hbvm_bench.studies.paper.drawn import GAUSS, HBVM, WIDTH, Said, drawn
from hbvm_bench.studies.paper.experiments.period_annulus import SPAN, energy
from integrators.protocol import Array, MethodBase
from problems.catalogue.period_annulus import H_STAR, P1

LEVELS = (0.005, 0.02, 0.04, 0.06, 0.08, H_STAR, 0.1, 0.12, 0.15)
Path = tuple[Array, Array]


@drawn("period-annulus-1", "Figure 1 · level curves", WIDTH * 0.56, 5.0)
def level_curves(figure: Figure) -> Said:
    """poinc_fig1: level curves around the centre P0 and the saddle P1."""
    axes = figure.subplots()
    q, p, values = _levels((-1.0, 0.6), (-0.8, 0.6), 241)
    others = [level for level in LEVELS if level != H_STAR]
    lines = axes.contour(q, p, values, levels=others, colors=MUTED, linewidths=0.8)
    axes.clabel(lines, fmt="%g", fontsize=7.5)
    edge = axes.contour(q, p, values, levels=[H_STAR], colors=INK, linewidths=1.6)
    axes.clabel(edge, fmt="H*", fontsize=8.5, manual=[(0.36, 0.2)])
    axes.plot(0, 0, "o", color=INK, markersize=5)
    say(axes, "P₀", (0, 0), (4, 4), fontsize=9)
    axes.plot(*P1, "s", color=INK, markersize=5)
    say(axes, "P₁", P1, (-17, 5), fontsize=9)
    axes.set(xlabel="q", ylabel="p", aspect="equal")
    return (
        f"The edge of the annulus of the centre P₀ is the loop of H* = {H_STAR:.10f} that leaves the "
        "saddle P₁ and returns to it.",
        "Closed curves around P0 up to the loop through P1; open ones beyond.",
    )


@drawn("period-annulus-2", "Figure 2 · the two orbits from the points found", WIDTH, 3.7)
def closeup(figure: Figure, orbits: Mapping[str, Path], methods: Mapping[str, MethodBase]) -> Said:
    """poinc_fig2: the error of H along both orbits from the points found, and the orbits near the saddle."""
    gauss, hbvm = orbits["gauss"], orbits["hbvm"]
    names = [repr(methods["gauss"]), repr(methods["hbvm"])]
    left, right = figure.subplots(1, 2, width_ratios=[1.1, 1])
    for (t, y), colour, name in zip((gauss, hbvm), (GAUSS, HBVM), names, strict=True):
        h = energy(y)
        left.plot(
            t, h - h[0], color=colour, linewidth=0.5 if colour == GAUSS else 1.4, label=name, rasterized=True
        )
    left.set(xlim=(0, SPAN), xlabel="time", ylabel="H(qₙ, pₙ) − H(q₀, p₀)")
    left.ticklabel_format(axis="y", style="sci", scilimits=(0, 0), useMathText=True)
    for line in left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.02), ncols=2).get_lines():
        line.set_linewidth(1.6)
    q, p, values = _levels((P1[0] - 0.05, P1[0] + 0.16), (P1[1] - 0.06, P1[1] + 0.13), 161)
    right.contour(q, p, values, levels=[H_STAR], colors=INK, linewidths=1.0)
    for (_, y), colour, size in ((gauss, GAUSS, 2.6), (hbvm, HBVM, 2.6)):
        right.plot(*y.T, ".", color=colour, markersize=size, rasterized=True)
    right.plot(*P1, "s", mfc="none", mec=INK, markersize=8)
    say(right, "P₁", P1, (8, -12), fontsize=9)
    right.set(
        xlim=(q.min(), q.max()), ylim=(p.min(), p.max()), xlabel="q", ylabel="p", title="close to the saddle"
    )
    spread = [float(np.ptp(energy(y))) for _, y in (gauss, hbvm)]
    near = [float(np.hypot(*(y - P1).T).min()) for _, y in (gauss, hbvm)]
    return (
        "Left: the error of the Hamiltonian. Right: the orbits near the saddle, where the line is the "
        "loop H*. Gauss scatters about it; the points of HBVM lie on it and run into P₁.",
        f"{names[0]}: H varies by {spread[0]:.1e}, closest to P1 {near[0]:.1e}; {names[1]}: "
        f"{spread[1]:.1e}, {near[1]:.1e}.",
    )


@drawn("period-annulus-period", "The period grows without bound", WIDTH * 0.62, 3.2)
def periods(figure: Figure, rows: Sequence[tuple[float, float]], rate: float) -> Said:
    """Draw the period against the distance from H*."""
    gap = np.array([row[0] for row in rows])
    period = np.array([row[1] for row in rows])
    axes = figure.subplots()
    anchor = int(np.argmin(np.abs(np.log10(gap) + 7)))
    line = period[anchor] - np.log(gap / gap[anchor]) / rate
    axes.plot(gap, line, color=TRUTH, linewidth=2.5, label="slope 1/λ, λ the saddle's eigenvalue")
    axes.plot(gap, period, "o", color=HBVM, markersize=4.5, label="measured, HBVM(15,6)")
    log_axis(axes, "x", -15, 0, most=8)
    axes.invert_xaxis()
    axes.set(xlabel="(H* − H) / H*", ylabel="period")
    axes.legend(loc="upper left")
    return (
        "The period against the distance from the edge: it grows as the logarithm, at the rate 1/λ "
        f"with λ = {rate:.6f}. At H = H* the orbit never returns.",
        f"From {period.min():.3f} near the centre to {period.max():.3f} at a relative distance of "
        f"{gap.min():.0e}.",
    )


@drawn("period-annulus-fates", "Beyond the paper · why the Gauss entries are what they are", WIDTH, 4.65)
def fates(figure: Figure, series: Mapping[str, Sequence[tuple[float, float | None]]]) -> Said:
    """Draw when orbits depart, against their distance inside the true edge: why Gauss's entries scatter."""
    figure.set_size_inches(WIDTH, 1.25 + 0.85 * len(series))
    panels = np.atleast_1d(figure.subplots(len(series), 1, sharex=True))
    for axes, (name, rows) in zip(panels, series.items(), strict=True):
        colour = GAUSS if name.startswith("Gauss") else HBVM
        gone = np.array([(gap, time) for gap, time in rows if time is not None]).reshape(-1, 2)
        stay = np.array([gap for gap, time in rows if time is None])
        axes.plot(stay, np.full(stay.size, 1.75 * SPAN), "|", color=colour, markersize=7, mew=0.9)
        axes.plot(*gone.T, ".", color=colour, markersize=3.2)
        axes.axhline(SPAN, color=MUTED, linewidth=0.6)
        log_axis(axes, "y", 0, 3)
        axes.set_ylim(4.0, 3 * SPAN)
        axes.text(1.005, 0.5, name, transform=axes.transAxes, va="center", fontsize=8.5, color=INK)
    low = int(np.floor(np.log10(min(gap for rows in series.values() for gap, _ in rows))))
    log_axis(panels[-1], "x", low, -1, most=9)
    panels[-1].invert_xaxis()
    panels[-1].set_xlabel("relative distance of the start inside the true edge, 1 − c/c*")
    figure.supylabel("departs at time (upper row of each: stays)", fontsize=8.5)
    return (
        "All these starts lie inside the annulus, so all should stay. Under HBVM they do. Under Gauss "
        "there is no edge but a layer in which starts that stay and starts that depart alternate on "
        "every scale: the bisection ends at one of many boundaries, and which one depends on the last "
        "bit. That is why the error is reproduced within a factor and the digits are not.",
        "; ".join(
            f"{name}: {sum(time is not None for _, time in rows)} of {len(rows)} depart"
            for name, rows in series.items()
        ),
    )


def _levels(q: tuple[float, float], p: tuple[float, float], n: int) -> tuple[Array, Array, Array]:
    grid_q, grid_p = np.meshgrid(np.linspace(*q, n), np.linspace(*p, n))
    values = energy(np.stack([grid_q.ravel(), grid_p.ravel()], axis=1)).reshape(n, n)
    return grid_q, grid_p, values
