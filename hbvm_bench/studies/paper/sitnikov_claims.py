"""What the paper says of Sitnikov's problem, beside what was measured."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.report.document import Claim
from hbvm_bench.studies.paper import sitnikov, sitnikov_figures
from hbvm_bench.studies.paper.axis_motion import Growth
from hbvm_bench.studies.paper.drawn import number
from hbvm_bench.studies.paper.sitnikov import Orbit, StepRow, usable

# Limits of the verdicts, each with what was measured.
ALIKE = 0.05  # of the amplitude: two motions that differ by less look the same in a figure; 0.30
IN_BOUNDS = 1.02  # of the true amplitude; 1.003
ROUND_OFF = (
    1e-12  # of Gauss's angular momentum 1.9e-15; of the plane 3.7e-3, where the true motion has 3.8e-3
)
WITH_THE_ORDER = 10.0  # times as much turning at h = 1/2 as at 1/8; 202
CRITICAL = 0.725  # the paper's critical eccentricity
Array = NDArray[np.float64]
Scan = Sequence[tuple[int, float, float | None]]


def claims(
    runs: Mapping[str, Orbit],
    lost: Sequence[float],
    starts: int,
    steps: Sequence[StepRow],
    growth: Sequence[Growth],
    nodes: Scan,
) -> list[Claim]:
    """Return the claims of the paper's section.

    Parameters
    ----------
    runs : mapping of str to Orbit
        ``gauss``, ``hbvm`` and ``truth`` at the paper's step.
    lost : sequence of float
        When neighbouring starts lose the planetoid under Gauss, sorted.
    starts : int
        How many neighbouring starts there are.
    steps : sequence of StepRow
        The scan over steps.
    growth : sequence of Growth
        The scan over eccentricities.
    nodes : sequence of (int, float, float or None)
        The scan over k at the paper's step.
    """
    return [*_trajectories(runs, lost, starts), *_laws(runs, steps, nodes), *_dynamics(steps, growth)]


def lost_words(lost: Sequence[float], starts: int) -> str:
    """Return what neighbouring starts do, as a sentence."""
    if not lost:
        return f"None of {starts} starts that differ in the last bits of e loses the planetoid."
    return (
        f"Of {starts} starts that differ in the last bits of e, {len(lost)} lose the planetoid, the first "
        f"at t = {lost[0]:.0f}, the last at {lost[-1]:.0f}."
    )


def row(steps: Sequence[StepRow], family: str, h: float) -> StepRow:
    """Return the row of a family with s = 2 and step h."""
    return next(found for found in steps if (found.family, found.h, found.s) == (family, h, 2))


def chaotic_from(growth: Sequence[Growth]) -> float | None:
    """Return the first e from which the growth along the axis no longer falls with the length of the run.

    That of a regular orbit falls as log t / t, here by a factor ten between the two
    spans; half is the line.
    """
    for found in growth:
        if found.left is not None or found.along[-1][1] > 0.5 * found.along[0][1]:
            return found.e
    return None


def beat(found: StepRow) -> float:
    """Return after how long the steps fall on the same places of the revolution again."""
    steps = found.period / found.h
    return found.period / abs(steps - round(steps))


def kept(steps: Sequence[StepRow], family: str) -> float:
    """Return the largest h up to which every step keeps the planetoid to the end."""
    largest = 0.0
    for found in sorted((r for r in steps if r.family == family and r.s == 2), key=lambda r: r.h):
        if not usable(found):
            break
        largest = found.h
    return largest


def oscillates(z: Array, true: Array, off: float) -> str:
    """Return whether a height stays in the bounds of the true one, and is off by little of them besides."""
    bound = float(np.abs(true).max())
    if not np.abs(z).max() <= IN_BOUNDS * bound:
        return "no"
    return "holds" if off <= ALIKE * bound else "partly"


def both(first: bool, second: bool) -> str:
    """Return the verdict on a claim of two parts."""
    return "holds" if first and second else "partly" if first or second else "no"


def _trajectories(runs: Mapping[str, Orbit], lost: Sequence[float], starts: int) -> list[Claim]:
    gauss, hbvm, truth = runs["gauss"], runs["hbvm"], runs["truth"]
    apart = np.abs(hbvm.z - truth.z)
    early = float(apart[hbvm.t <= sitnikov_figures.SHOWN].max())
    spans = {family: sitnikov_figures.apocentres(runs[family]) for family in ("gauss", "hbvm")}
    axis = max(hbvm.off_axis, gauss.off_axis)
    like = oscillates(hbvm.z, truth.z, early)
    plane = max(hbvm.plane, gauss.plane)
    return [
        Claim(
            "Under Gauss of order four the planetoid eventually leaves the system",
            "Figure 2",
            f"|z| > {sitnikov.LOST:g} at t = {number(gauss.lost)}. {lost_words(lost, starts)}",
            "holds" if len(lost) > starts // 2 else "partly",
        ),
        Claim(
            "Under HBVM(18,2) it oscillates in bounds, very much like the true motion",
            "Figure 3, on [0, 350]",
            f"|z| ≤ {np.abs(hbvm.z).max():.4f} to t = 1500, in truth {np.abs(truth.z).max():.4f}. "
            f"{'z itself' if like == 'holds' else 'But z itself'} is off by up to {early:.2f} on [0, 350] "
            f"and by {apart[-1]:.2f} at t = 1500",
            like,
        ),
        Claim(
            "HBVM preserves the apocentre distance of the primaries, Gauss does not",
            "Figure 4",
            f"HBVM {spans['hbvm'][0]:.4f} … {spans['hbvm'][1]:.4f}, Gauss {spans['gauss'][0]:.2f} … "
            f"{spans['gauss'][1]:.2f}; in truth 5",
            "holds" if np.ptp(spans["hbvm"]) < 0.02 < np.ptp(spans["gauss"]) else "no",
        ),
        Claim(
            "Both methods leave the primaries' plane and the planetoid's axis invariant",
            "in the text",
            "off the axis: "
            + ("exactly 0, because rounding keeps the symmetry" if axis == 0 else number(axis))
            + f". The plane drifts along z by up to {number(plane)}"
            + (
                f", that of the true motion by {number(truth.plane)}: the planetoid's momentum is not "
                "balanced, the barycentre moves"
                if plane > ROUND_OFF
                else ""
            ),
            both(axis == 0, plane <= ROUND_OFF),
        ),
    ]


def _laws(runs: Mapping[str, Orbit], steps: Sequence[StepRow], nodes: Scan) -> list[Claim]:
    gauss, hbvm = runs["gauss"], runs["hbvm"]
    half = hbvm.momentum.size // 2
    first, second = float(hbvm.momentum[:half].max()), float(hbvm.momentum[half:].max())
    enough = next(k for k, error, _ in nodes if error <= 1e-13)
    return [
        Claim(
            "HBVM(18,2) conserves H up to machine precision",
            "Figure 5 left",
            f"largest relative error {number(hbvm.energy.max())}; k = {enough} is the first that reaches "
            "1e-13",
            "holds" if hbvm.energy.max() <= 1e-13 else "partly",
        ),
        Claim(
            "Gauss makes an error in H",
            "Figure 5 left",
            f"largest relative error {number(gauss.energy.max())}",
            "holds" if gauss.energy.max() > 1e-3 else "no",
        ),
        Claim(
            "Gauss, being symplectic, precisely conserves the angular momentum",
            "Figure 5 right",
            f"largest relative error {number(gauss.momentum.max())}",
            "holds" if gauss.momentum.max() < ROUND_OFF else "no",
        ),
        Claim(
            "HBVM's error in the angular momentum makes bounded, periodic-like oscillations",
            "Figure 5 right",
            f"at most {number(first, 3)} in the first half of the run and {number(second, 3)} in the "
            "second; they have the period of the beat between step and revolution, "
            f"{beat(row(steps, 'hbvm', sitnikov.H)):.0f}",
            "holds" if second < 1.1 * first else "no",
        ),
    ]


def _dynamics(steps: Sequence[StepRow], growth: Sequence[Growth]) -> list[Claim]:
    coarse, finer = row(steps, "hbvm", sitnikov.H), row(steps, "hbvm", 1 / 8)
    fits = [r for r in steps if r.family == "hbvm" and r.s == 2 and r.h <= 0.25]
    order = float(np.polyfit(np.log([r.h for r in fits]), np.log([abs(r.turn) for r in fits]), 1)[0])
    at = min(growth, key=lambda found: abs(found.e - sitnikov.E))
    limit = chaotic_from(growth)
    return [
        Claim(
            "The large step causes a sham, uniform rotation that does not destroy the symmetry",
            "Figure 3 left",
            f"{coarse.turn:.2f} degrees per revolution, uniform to {coarse.unsteady:.1f} degrees. It falls "
            f"with h to the power {order:.2f} and comes with the order, not with the energy: with h = 1/8 "
            f"{finer.turn:.5f} degrees, and {row(steps, 'gauss', 1 / 8).turn:.5f} under Gauss",
            both(abs(coarse.turn) > WITH_THE_ORDER * abs(finer.turn), coarse.unsteady < abs(coarse.turn)),
        ),
        Claim(
            "With e = 0.75 the motion is chaotic; it is so above a critical eccentricity",
            f"ē ≃ {CRITICAL}",
            f"with e = {sitnikov.E:g} an offset along the axis grows at a rate of {number(at.along[0][1])} "
            f"over {at.along[0][0]} revolutions and {number(at.along[-1][1])} over {at.along[-1][0]}, "
            f"as for a {'regular' if limit is None or limit > sitnikov.E else 'chaotic'} orbit. "
            + (f"This start becomes chaotic at e ≈ {limit:g}. " if limit is not None else "")
            + f"Off the axis offsets grow by a factor e every {1 / at.across:.1f} units of time",
            "no" if limit is None or limit > sitnikov.E else "holds",
        ),
        Claim(
            "HBVM allows larger steps than Gauss",
            "in the text",
            f"the planetoid stays to t = 1500 for every h tried up to {kept(steps, 'hbvm'):g} with "
            f"HBVM(18,2), up to {kept(steps, 'gauss'):g} with Gauss",
            "holds" if kept(steps, "hbvm") > kept(steps, "gauss") else "no",
        ),
    ]
