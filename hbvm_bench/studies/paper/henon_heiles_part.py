"""The Henon-Heiles experiment in the report: the four figures, the claims, which orbits escape."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import takewhile

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator

from hbvm_bench.measure.computation import Task, each, split
from hbvm_bench.report.curves import envelope
from hbvm_bench.report.document import Claim, Maker
from hbvm_bench.report.figures.canvas import log_axis, power_label, say
from hbvm_bench.report.figures.drawn import COLOURS, WIDTH, Said, drawn, heat, legend_above, number
from hbvm_bench.report.figures.style import INK, MUTED, PAPER
from hbvm_bench.report.parts import Part, PartResults
from hbvm_bench.summaries.table import Table
from integrators.protocol import Array
from problems.catalogue.henon_heiles import ESCAPE, SADDLES

from .experiments import henon_heiles as experiment
from .experiments.henon_heiles import GAP, GAPS, NEIGHBOURS, T_END, H, Orbit, StepRow

METHODS = {"gauss": experiment.GAUSS, "hbvm": experiment.HBVM_4}
LEVELS = (0.02, 0.05, 0.08, 0.11, 0.14, ESCAPE)
LABELLED = (math.radians(162), math.radians(34))  # directions from the origin, alternating
PROBLEM = (
    "The paper integrates to t = 50,000 with h = 1 from a point whose energy is “very close to” "
    "1/6; it does not say which. Here: (q₁, q₂) = ({:g}, {:g}), momentum at an angle of "
    f"{{:g}} rad, H₀ = 1/6 − {GAP:g}. The motion is chaotic, so the last bit of the initial condition "
    f"decides when Gauss loses the orbit: {NEIGHBOURS} were tried that differ in the last bits of one "
    "momentum, and the one drawn (number {}) is the one that escapes nearest to the paper's time."
)


def _runs() -> list[Task]:
    runs = [
        Task("gauss", experiment.gauss_orbit, 20),
        Task("hbvm", partial(experiment.orbit, METHODS["hbvm"]), 3),
        Task("truth", experiment.true_orbit),
        *each("steps", experiment.by_step, METHODS, 9),
    ]
    for family, method in METHODS.items():
        runs += split(f"escapes {family}", partial(experiment.escapes, method), range(NEIGHBOURS), 4, 6)
        runs += split(f"map {family}", partial(experiment.escape_map, method), GAPS, 4, 15)
    return runs


def _blocks(results: PartResults) -> list[Maker]:
    return [
        ("the problem", lambda: PROBLEM.format(*experiment.START, results["gauss"][0])),
        ("Figure 1", lambda: level_curves(results["truth"])),
        ("Figure 2", lambda: gauss_plane(results["gauss"][1])),
        ("Figure 3", lambda: hbvm_plane(results["hbvm"])),
        ("Figure 4", lambda: hamiltonian(results["gauss"][1], results["hbvm"])),
        ("the escape times", lambda: fates(results.each("escapes", METHODS))),
        ("which initial conditions escape", lambda: maps(_maps(results))),
        ("step sizes", lambda: _step_table(results.each("steps", METHODS))),
    ]


def _maps(results: PartResults) -> dict[str, Array]:
    return {family: np.stack(rows) for family, rows in results.each("map", METHODS).items()}


def _claims(results: PartResults) -> list[Claim]:
    gauss: Orbit = results["gauss"][1]
    hbvm: Orbit = results["hbvm"]
    times, steps, escaped = results.each("escapes", METHODS), results.each("steps", METHODS), _maps(results)
    gone = {family: _times(values) for family, values in times.items()}
    starts = len(times["gauss"])
    middle = float(np.median([np.inf if time is None else time for time in times["gauss"]]))
    inside = _until_gone(gauss)
    slopes = max(float(np.abs([x + 2 * x * y, y + x * x - y * y]).max()) for x, y in SADDLES)
    heights = max(abs(float(experiment.potential(np.array(x), np.array(y))) - ESCAPE) for x, y in SADDLES)
    left = {family: int(np.count_nonzero(~np.isnan(values))) for family, values in escaped.items()}
    largest = {family: largest_step(rows) for family, rows in steps.items()}
    agrees = max(row.agrees for rows in steps.values() for row in rows if row.h == H)
    return [
        Claim(
            "The vertices of the triangle U = 1/6 are saddle points of U",
            "(0, 1), (±√3/2, −1/2)",
            f"|∇U| ≤ {number(slopes)} and |U − 1/6| ≤ {number(heights)} there",
            "holds" if max(slopes, heights) < 1e-15 else "no",
        ),
        Claim(
            "Gauss of order four with h = 1 lets the orbit escape",
            "t ≃ 7000",
            f"{len(gone['gauss'])} of {starts} neighbouring initial conditions escape before t = 50,000, the "
            f"first at {min(gone['gauss'], default=np.nan):.0f}, half of all by {middle:,.0f}; the one drawn "
            f"at {number(gauss.left)}",
            "holds" if gauss.left is not None else "no",
        ),
        Claim(
            "Under HBVM(4,2) the orbit is in the triangle at all times",
            "50,000 points",
            f"{len(hbvm.t) - 1:,} points, {hbvm.outside} outside; {len(gone['hbvm'])} of the neighbouring "
            f"initial conditions and {left['hbvm']} of {escaped['hbvm'].size} other initial conditions and "
            f"energies leave, where under Gauss {left['gauss']} do",
            "holds" if not (hbvm.left or hbvm.outside or gone["hbvm"] or left["hbvm"]) else "no",
        ),
        Claim(
            "HBVM(4,2) precisely conserves the total energy",
            "Figure 4",
            f"largest relative error {number(hbvm.error)} over 50,000 steps",
            "holds" if hbvm.error < 1e-11 else "no",
        ),
        Claim(
            "Gauss makes H oscillate irregularly about its value, which costs the stability",
            "Figure 4",
            f"H between {inside.min():.5f} and {inside.max():.5f}, across 1/6 = 0.16667",
            "holds" if inside.max() > ESCAPE else "no",
        ),
        Claim(
            "HBVM allows larger steps than Gauss",
            "in the text",
            f"of {experiment.STEP_STARTS} neighbouring initial conditions none leaves for any h tried up to "
            f"{largest['hbvm']:g} with HBVM(4,2), up to {largest['gauss']:g} with Gauss. Staying inside "
            "does not mean being accurate: with h = 1 either orbit agrees with the reference solution "
            f"up to t ≈ {agrees:.0f} only",
            "holds" if largest["hbvm"] > largest["gauss"] else "no",
        ),
    ]


def largest_step(rows: Sequence[StepRow]) -> float:
    """Return the largest h up to which no orbit leaves with any step; 0 where one leaves with the first."""
    return max((row.h for row in takewhile(lambda row: not _times(row.left), rows)), default=0.0)


def _times(values: Sequence[float | None]) -> list[float]:
    """Return the times at which something happened, without those where it never did."""
    return sorted(time for time in values if time is not None)


def _until_gone(run: Orbit) -> Array:
    """Return the values of H along an orbit, but for its last steps if it leaves."""
    return run.energy[run.t <= (run.left or np.inf) - 3]


def _step_table(steps: Mapping[str, Sequence[StepRow]]) -> Table:
    def cells(row: StepRow) -> tuple[str, ...]:
        gone = _times(row.left)
        return str(len(gone)), f"{gone[0]:.0f}" if gone else "–", f"{row.agrees:g}"

    return Table(
        "Step size and escape",
        ("h", *("leave", "the first at", "agrees until t") * 2),
        [(f"{a.h:g}", *cells(a), *cells(b)) for a, b in zip(steps["gauss"], steps["hbvm"], strict=True)],
        f"{experiment.STEP_STARTS} neighbouring initial conditions, followed to t = {T_END:,.0f}; a step "
        "whose equations find no solution counts as leaving. Agrees: time up to which the first of them is "
        f"within {experiment.AGREES:g} of the reference solution. Conserving the energy keeps the orbit "
        "inside; an accurate orbit needs a smaller step with either method.",
        words=(),
        key="henon-heiles-steps",
        groups=(("", 1), ("Gauss, s = 2", 3), ("HBVM(4,2)", 3)),
    )


@drawn("henon-heiles-1", "Figure 1 · level curves of the potential and an orbit", WIDTH * 0.6, 5.0)
def level_curves(figure: Figure, trace: Array) -> Said:
    """henon_fig1: level curves of U with a traced orbit."""
    axes = figure.subplots()
    x, y = np.meshgrid(np.linspace(-1.25, 1.25, 301), np.linspace(-0.75, 1.25, 301))
    axes.plot(*trace.T, color=COLOURS["hbvm"], linewidth=0.6, alpha=0.6)
    lines = axes.contour(x, y, experiment.potential(x, y), levels=LEVELS, colors=INK, linewidths=0.9)
    places = [_on_level(level, LABELLED[i % 2]) for i, level in enumerate(LEVELS)]
    names = {level: f"{level:g}" for level in LEVELS} | {ESCAPE: "1/6"}
    for text in axes.clabel(lines, fmt=names, fontsize=7.5, manual=places):
        text.set_bbox({"facecolor": PAPER, "edgecolor": "none", "pad": 0.8})
    _saddles(axes)
    axes.plot(0, 0, "+", color=INK, markersize=8)
    say(axes, "O", (0, 0), (5, 4), fontsize=9)
    _bounds(axes, 1.25, -0.75)
    return (
        "The level 1/6 is the triangle of the three saddles. The reference solution from this initial "
        f"condition, H₀ = 1/6 − {GAP:g}, to t = 300: it comes close to the sides, where a small error of the "
        "energy lets it out.",
        "The orbit fills the triangle and stays inside.",
    )


@drawn("henon-heiles-2", f"Figure 2 · Gauss of order four, h = {H:g}", WIDTH * 0.6, 5.0)
def gauss_plane(figure: Figure, run: Orbit) -> Said:
    """henon_fig2: every step in the (q1, q2) plane."""
    words = "Every step until the orbit leaves; circles: the last steps, as in the paper."
    return words, _orbit(figure, run, COLOURS["gauss"])


@drawn("henon-heiles-3", f"Figure 3 · HBVM(4,2), h = {H:g}", WIDTH * 0.6, 5.0)
def hbvm_plane(figure: Figure, run: Orbit) -> Said:
    """henon_fig3: every step in the (q1, q2) plane."""
    return "All 50,000 steps from the first initial condition.", _orbit(figure, run, COLOURS["hbvm"])


def _orbit(figure: Figure, run: Orbit, colour: str) -> str:
    """Draw every step of an orbit and return what is to see; the last ones, if it leaves, in circles."""
    gone = run.left is not None
    if gone:
        figure.set_size_inches(WIDTH * 0.66, 5.0)
    axes = figure.subplots()
    axes.plot(*np.array([*SADDLES, SADDLES[0]]).T, color=INK, linewidth=0.9)
    inside = run.q[:-3] if gone else run.q
    axes.plot(*inside.T, ".", color=colour, markersize=1.1, alpha=0.55, rasterized=True)
    if gone:
        last = run.q[-4:]
        shown = last[(np.abs(last[:, 0]) < 1.7) & (np.abs(last[:, 1]) < 1.5)]
        axes.plot(*shown.T, "o", mfc="none", mec=INK, markersize=8)
        axes.plot(*shown.T, ".", color=INK, markersize=3)
    fate = f"gone at t = {run.left:g}" if gone else f"{len(run.t) - 1} steps, none outside"
    axes.set_title(f"{run.method}: {fate}", color=INK)
    _saddles(axes)
    _bounds(axes, *((1.5, -0.9) if gone else (1.25, -0.75)))
    fate = f"gone at t = {run.left:g}." if gone else "the orbit stays to the end."
    return f"{run.method}: {len(run.t) - 1} steps, {run.outside} outside the triangle, {fate}"


@drawn("henon-heiles-4", "Figure 4 · the Hamiltonian along both solutions", WIDTH, 3.3)
def hamiltonian(figure: Figure, gauss: Orbit, hbvm: Orbit) -> Said:
    """henon_fig4: H along both runs."""
    left, right = figure.subplots(1, 2, width_ratios=[1.5, 1])
    inside, shown = _until_gone(gauss), hbvm.t <= gauss.t[-1]
    look = {"color": COLOURS["gauss"], "linewidth": 0.4, "rasterized": True}
    left.plot(gauss.t[: inside.size], inside, label=gauss.method, **look)
    left.plot(hbvm.t[shown], hbvm.energy[shown], color=COLOURS["hbvm"], linewidth=1.6, label=hbvm.method)
    left.axhline(ESCAPE, color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
    say(left, "1/6", (gauss.t[-1], ESCAPE), (3, -3), fontsize=8, annotation_clip=False)
    left.set(xlim=(0, gauss.t[-1]), xlabel="time", ylabel="H")
    legend_above(left)
    error = np.abs(hbvm.energy - hbvm.energy[0]) / hbvm.energy[0]
    right.plot(*envelope(hbvm.t[1:], error[1:], 300), color=COLOURS["hbvm"], linewidth=1.1)
    log_axis(right, "y", -17, -10)
    right.set(xlim=(0, T_END), xlabel="time", ylabel="|H − H₀| / H₀", title=hbvm.method)
    return (
        "Left, the paper's figure: under Gauss H swings irregularly across 1/6, under HBVM it is a "
        "straight line. Right: that line's error over the whole run.",
        f"{gauss.method}: H between {inside.min():.5f} and {inside.max():.5f}; {hbvm.method}: largest "
        f"relative error {hbvm.error:.1e}.",
    )


@drawn("henon-heiles-fates", "Beyond the paper · the escape time is random", WIDTH * 0.66, 3.2)
def fates(figure: Figure, times: Mapping[str, Sequence[float | None]]) -> Said:
    """Draw how long neighbouring initial conditions stay: the distribution behind the paper's one number."""
    axes = figure.subplots()
    summary = []
    for family, values in times.items():
        gone, method = _times(values), METHODS[family]
        share = 1 - np.arange(len(gone) + 1) / len(values)
        look = {
            "color": COLOURS[family],
            "linewidth": 1.6,
            "label": f"{method}, {len(values)} initial conditions",
        }
        axes.step([0, *gone, T_END], [*share, share[-1]], where="post", **look)
        summary.append(f"{method}: {len(gone)} of {len(values)} orbits leave")
    axes.axvline(experiment.PRINTED, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)))
    say(axes, f"the paper's t ≃ {experiment.PRINTED:.0f}", (experiment.PRINTED, 0.04), (5, 0), fontsize=8)
    axes.set(xlim=(0, T_END), ylim=(0, 1.04), xlabel="time", ylabel="share of orbits still inside")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return (
        "The same initial condition except for the last bits of one momentum. The motion is chaotic, so "
        "the last bit decides when Gauss lets the orbit out; the paper's single escape time is one draw from "
        "this distribution. Under HBVM none leaves.",
        "; ".join(summary),
    )


@drawn("henon-heiles-map", "Beyond the paper · which initial conditions escape", WIDTH, 3.6, values=True)
def maps(figure: Figure, times_of: Mapping[str, Array]) -> Said:
    """Escape times over initial conditions and energies, both methods."""
    panels = figure.subplots(1, 2, sharey=True)
    high = math.log10(experiment.MAP_END)
    meshes = []
    for axes, (family, times) in zip(panels, times_of.items(), strict=True):
        meshes.append(heat(axes, np.degrees(experiment.DIRECTIONS), GAPS, np.maximum(times, 1.0), 2, high))
        axes.set(yscale="log", xlabel="initial direction, degrees", xticks=range(0, 361, 60))
        left = int(np.count_nonzero(~np.isnan(times)))
        axes.set_title(f"{METHODS[family]}: {left} of {times.size} leave", color=INK)
        if left == 0:
            middle = {"transform": axes.transAxes, "ha": "center", "va": "center"}
            axes.text(0.5, 0.5, "every orbit stays inside", color=MUTED, fontsize=9, **middle)
    powers = range(math.ceil(math.log10(min(GAPS))), math.floor(math.log10(max(GAPS))) + 1)
    panels[0].yaxis.set_major_locator(FixedLocator([10.0**p for p in powers]))
    panels[0].yaxis.set_major_formatter(lambda value, _: power_label(value))
    panels[0].set_ylabel("1/6 − H₀")
    panels[0].invert_yaxis()
    bar = figure.colorbar(meshes[-1], ax=panels, pad=0.01, aspect=28)
    ticks = range(2, math.floor(high) + 1)
    bar.set_ticks(ticks, labels=[power_label(10.0**p) for p in ticks])
    bar.set_label("escape time; blank: inside throughout")
    gone = {family: ~np.isnan(times) for family, times in times_of.items()}
    inside = gone["gauss"][np.asarray(GAPS) >= 4e-3]
    return (
        f"Orbits from (0, 1/2) in every direction, with energies from 1/6 − {number(max(GAPS))} (bottom) to "
        f"1/6 − {number(min(GAPS))} (top), followed to t = {experiment.MAP_END:,.0f}. Under Gauss orbits "
        "escape where 1/6 − H₀ is below the error of H; the blank cells among the coloured ones are "
        "orbits that have not left yet, or regular ones that never will. Under HBVM nothing leaves.",
        f"Under Gauss {gone['gauss'].sum()} of {gone['gauss'].size} orbits leave, {inside.sum()} of "
        f"{inside.size} of those with 1/6 − H₀ ≥ 4e-3; under HBVM {gone['hbvm'].sum()}.",
    )


def _on_level(level: float, angle: float) -> tuple[float, float]:
    """Return the point of U = level in a direction, by U = r^2/2 + r^3 sin(3 angle)/3."""
    roots = np.roots([math.sin(3 * angle) / 3, 0.5, 0.0, -level])
    radius = min(root.real for root in roots if abs(root.imag) < 1e-9 and root.real > 0)
    return radius * math.cos(angle), radius * math.sin(angle)


def _saddles(axes: Axes) -> None:
    for i, (point, offset) in enumerate(zip(SADDLES, ((8, 0), (-19, 5), (7, 5)), strict=True)):
        axes.plot(*point, "s", color=INK, markersize=4)
        say(axes, f"P{'₁₂₃'[i]}", point, offset, fontsize=9)


def _bounds(axes: Axes, reach: float, low: float) -> None:
    axes.set(xlim=(-reach, reach), ylim=(low, 1.25), aspect="equal", xlabel="q₁", ylabel="q₂")


PART = Part("henon-heiles", "The Hénon–Heiles problem", _runs(), _claims, _blocks)
