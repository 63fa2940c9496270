"""The figures of the page on chaos."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from hbvm_bench.report.figures.canvas import log_axis, say
from hbvm_bench.report.figures.drawn import COLOURS, WIDTH, Said, drawn, heat
from hbvm_bench.report.figures.style import INK, MUTED, TRUTH
from hbvm_bench.studies.paper.experiments.axis_motion import START
from hbvm_bench.studies.paper.sitnikov_part import CRITICAL
from integrators.protocol import Array

from . import maps
from .exponents import Measured
from .orbits import Curves
from .systems import SYSTEMS

LOW, HIGH = np.log10(1.0), np.log10(30.0)  # of MEGNO's colours
PALE = "#f4f1ee"  # on the map, whose colours no theme changes
CHAOTIC = 4.0  # from which MEGNO is called chaotic: regular orbits are near 2


@drawn("chaos-values", "Exponents relative to the published ones", WIDTH, 5.2)
def values(figure: Figure, measured: Mapping[str, Measured]) -> Said:
    """Draw intervals, and heyoka's values, over the published values."""
    axes = figure.subplots()
    rows = [(name, known) for name in measured for known in SYSTEMS[name].published]
    inside = 0
    for i, (name, published) in enumerate(rows):
        here, scale = measured[name], published.exponents[0]
        low, high = here.intervals[0] / scale
        inside += bool(low <= 1.0 <= high)
        axes.plot([low, high], [i, i], color=COLOURS["hbvm"], linewidth=3.0, solid_capstyle="butt")
        axes.plot(here.exponents[0] / scale, i, "o", color=COLOURS["hbvm"], markersize=5)
        axes.plot(here.heyoka[0] / scale, i, "s", color=INK, mfc="none", markersize=6)
    axes.axvline(1.0, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)))
    axes.set_yticks(range(len(rows)), labels=[_label(name, known.source) for name, known in rows])
    axes.invert_yaxis()
    axes.set(xlabel="largest exponent over the published value")
    axes.plot([], [], "o", color=COLOURS["hbvm"], label="HBVM(), with 95 % interval")
    axes.plot([], [], "s", color=INK, mfc="none", label="heyoka")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return (
        "Bars: 95 % intervals of HBVM(), divided by the published value; squares: heyoka's values, which "
        "belong to other trajectories of the same attractor, as chaotic ones diverge.",
        f"{inside} of {len(rows)} published values lie in the 95 % intervals of HBVM().",
    )


def _label(name: str, source: str) -> str:
    """Return a system's name without parameters, with the source where several rows have that name."""
    heads = [known.title.partition(",")[0] for known in SYSTEMS.values() for _ in known.published]
    head = SYSTEMS[name].title.partition(",")[0]
    return head + (f" ({source})" if heads.count(head) > 1 else "")


@drawn("chaos-megno", "MEGNO over time", WIDTH * 0.8, 3.6)
def curves(figure: Figure, lines: Curves) -> Said:
    """Draw MEGNO of a regular, a chaotic and a linear motion."""
    axes = figure.subplots()
    looks = (
        (lines.chaotic, "motion", "chaotic", "-"),
        (lines.regular, "hbvm", "quasi-periodic", "-"),
        (lines.linear, "gauss", "linear, absolute", (0, (5, 2))),
    )
    for (t, y), family, label, dash in looks:
        axes.plot(t, np.abs(y), color=COLOURS[family], linestyle=dash, linewidth=1.4, label=label)
    t = lines.chaotic[0]
    axes.plot(t, lines.exponent * t / 2, color=TRUTH, linewidth=1.0, linestyle=(0, (2, 2)), label="λt/2")
    axes.axhline(2.0, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)))
    say(axes, "2", (1.0, 2.0), (2, 3), color=MUTED)
    log_axis(axes, "x", 0, int(np.ceil(np.log10(t[-1]))))
    log_axis(axes, "y", -3, int(np.ceil(np.log10(lines.chaotic[1].max()))))
    axes.set(xlabel="time", ylabel="MEGNO")
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    return (
        "Two orbits of the Hénon–Heiles problem and two uncoupled linear oscillators. Quasi-periodic motion "
        "of a nonlinear system tends to 2, a chaotic one grows like λt/2, a linear one falls to 0.",
        f"At the end: quasi-periodic {lines.regular[1, -1]:.3f}, chaotic {lines.chaotic[1, -1]:.0f}, linear "
        f"{lines.linear[1, -1]:.3f}.",
    )


@drawn(
    "chaos-sitnikov", "Sitnikov's problem over eccentricity and initial speed", WIDTH * 0.8, 4.4, values=True
)
def sitnikov(
    figure: Figure, es: Sequence[float], speeds: Sequence[float], rows: Sequence[Array], turns: int
) -> Said:
    """Draw MEGNO of planetoids that stay."""
    values_ = np.stack(rows)
    axes = figure.subplots()
    _bar(figure, axes, _megno(axes, es, speeds, values_.T))
    axes.axvline(CRITICAL, color=INK, linewidth=1.2, linestyle=(0, (4, 3)))
    say(axes, f"the paper's critical e = {CRITICAL:g}", (CRITICAL, speeds[-1]), (-5, -10), ha="right")
    axes.plot(0.75, START[1], "o", mfc="none", mec=PALE, markersize=7)
    say(axes, "the paper's run", (0.75, START[1]), (-12, -3), ha="right", color=PALE)
    axes.set(xlabel="eccentricity e", ylabel="speed through the plane at apocentre")
    return (
        f"MEGNO over {turns} revolutions of the primaries, by Gauss with s = {maps.SITNIKOV.s} and "
        f"{maps.PER_TURN} steps in the eccentric anomaly of a revolution. The planetoid's mass is neglected, "
        "and it moves on the axis. Blank: it goes farther than 100. The original paper names a critical "
        "eccentricity, from which on motion is chaotic. For motion on the axis the map shows no change "
        "there, and the paper's run is among the regular ones.",
        _share(values_),
    )


@drawn("chaos-sections", "The Hénon–Heiles problem on the section q₁ = 0", WIDTH, 3.5, values=True)
def sections(
    figure: Figure,
    positions: Sequence[float],
    momenta: Sequence[float],
    energies: Sequence[Sequence[Array]],
    t_end: float,
) -> Said:
    """Draw MEGNO of the initial conditions on the section at three energies."""
    panels = figure.subplots(1, len(energies), sharey=True)
    meshes, said = [], []
    for axes, energy, rows in zip(panels, maps.ENERGIES, energies, strict=True):
        values_ = np.stack(rows)
        meshes.append(_megno(axes, positions, momenta, values_))
        axes.set(xlabel="q₂", aspect="equal")
        axes.set_title(f"H = 1/{round(1 / energy)}")
        said.append(f"H = 1/{round(1 / energy)}: {_share(values_)}")
    panels[0].set_ylabel("p₂")
    _bar(figure, list(panels), meshes[-1])
    return (
        f"MEGNO of orbits that start with p₁ > 0, at t = {t_end:g}, by `{maps.HENON_HEILES!r}`, which "
        "conserves this energy, so that none can escape, not even at H = 1/6. The higher the energy, the "
        "more of the section is chaotic; islands remain around stable periodic orbits.",
        " ".join(said),
    )


@drawn(
    "chaos-asteroids",
    "The restricted three-body problem: asteroids inside Jupiter's orbit",
    WIDTH,
    4.0,
    values=True,
)
def asteroids(
    figure: Figure, axes_: Sequence[float], eccentricities: Sequence[float], rows: Sequence[Array], turns: int
) -> Said:
    """Draw MEGNO over semi-major axis and eccentricity."""
    values_ = np.stack(rows)
    axes = figure.subplots()
    _bar(figure, axes, _megno(axes, axes_, eccentricities, values_))
    top = eccentricities[-1]
    for inner, outer in ((3, 1), (5, 2), (2, 1), (5, 3), (3, 2), (4, 3)):
        at = (outer / inner) ** (2 / 3)
        axes.plot([at, at], [top, top * 1.03], color=INK, linewidth=1.0, clip_on=False)
        say(
            axes, f"{inner}:{outer}", (at, top * 1.03), (0, 2), ha="center", fontsize=8, annotation_clip=False
        )
    axes.set(xlabel="semi-major axis, in that of Jupiter", ylabel="eccentricity")
    return (
        f"MEGNO over {turns} revolutions of Jupiter, by `{maps.RESTRICTED!r}`. Massless asteroids start at "
        "the pericentre on the far side of the Sun from Jupiter, which moves on a circle. Marks: where the "
        "periods are in the ratios written. Chaos spreads from Jupiter's orbit inwards as eccentricities "
        "grow, with regular islands at resonances. Blank: the integration did not reach its end.",
        _share(values_),
    )


def _megno(axes: Axes, x: Sequence[float], y: Sequence[float], values_: Array) -> QuadMesh:
    return heat(axes, x, y, np.maximum(values_, 10.0**LOW), LOW, HIGH)


def _bar(figure: Figure, axes: Axes | list[Axes], mesh: QuadMesh) -> None:
    bar = figure.colorbar(mesh, ax=axes, pad=0.02, aspect=28)
    ticks = (1, 2, 4, 10, 30)
    bar.set_ticks([np.log10(tick) for tick in ticks], labels=[str(tick) for tick in ticks])
    bar.set_label("MEGNO; 2: regular")


def _share(values_: Array) -> str:
    known = values_[~np.isnan(values_)]
    chaotic = np.count_nonzero(known > CHAOTIC) / max(known.size, 1)
    return f"MEGNO is above {CHAOTIC:g} for {chaotic:.0%} of {known.size} orbits."
