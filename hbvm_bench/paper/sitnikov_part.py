"""Sitnikov's problem in words: what the paper claims, what came out."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from hbvm_bench.paper import axis_figures, axis_motion, others, sitnikov
from hbvm_bench.paper import sitnikov_figures as figures
from hbvm_bench.paper.document import Claim, Part, Table, number
from hbvm_bench.paper.sitnikov import Orbit, StepRow
from hbvm_bench.paper.tasks import Results, Task

CRITICAL = 0.725  # the paper's critical eccentricity
CHUNKS = 4  # of the map of who stays


def tasks() -> list[Task]:
    """Return the computations of this part."""
    map_rows = np.array_split(np.asarray(axis_motion.MAP_ECCENTRICITIES), CHUNKS)
    scan = np.array_split(np.asarray(axis_motion.ECCENTRICITIES), 3)
    return [
        Task("sitnikov/orbits", sitnikov.orbits, 2),
        Task("sitnikov/neighbours", sitnikov.neighbours, 1),
        *(Task(f"sitnikov/nodes {h}", partial(sitnikov.energy_by_nodes, h), 3) for h in NODE_STEPS),
        Task("sitnikov/steps 2", partial(sitnikov.by_step, 2), 4),
        Task("sitnikov/steps 3", partial(sitnikov.by_step, 3, sitnikov.STEPS_SHORT), 4),
        Task("sitnikov/truth", sitnikov.against_truth, 2),
        *(
            Task(f"sitnikov/growth {i}", partial(axis_motion.growth_by_eccentricity, es.tolist()), 8)
            for i, es in enumerate(scan)
        ),
        Task("sitnikov/section", partial(axis_motion.section, sitnikov.E), 4),
        *(
            Task(f"sitnikov/stays {i}", partial(axis_motion.stays, es.tolist()), 8)
            for i, es in enumerate(map_rows)
        ),
        *(Task(f"sitnikov/other {text}", partial(others.on_sitnikov, text), 6) for text in others.SITNIKOV),
    ]


NODE_STEPS = (0.5, 0.25)


def part(results: Results) -> Part:
    """Return this part of the report."""
    runs: dict[str, Orbit] = results["sitnikov/orbits"]
    neighbours: list[float | None] = results["sitnikov/neighbours"]
    scans = {h: results[f"sitnikov/nodes {h}"] for h in NODE_STEPS}
    steps: list[StepRow] = [*results["sitnikov/steps 2"], *results["sitnikov/steps 3"][1:]]
    growth = [row for i in range(3) for row in results[f"sitnikov/growth {i}"]]
    stays = np.vstack([results[f"sitnikov/stays {i}"] for i in range(CHUNKS)])
    gauss, hbvm, truth = runs["gauss"], runs["hbvm"], runs["truth"]
    lost = sorted(time for time in neighbours if time is not None)
    return Part(
        key="sitnikov",
        title="Sitnikov's problem",
        lead=[
            "Two primaries of mass 1 on ellipses with e = 0.75 and a planetoid of mass 1e-5 on the axis "
            "through their "
            "barycentre; G = 1, h = 1/2, t from 0 to 1500, about 70 revolutions. The paper prints the "
            "planetoid's 1/2 among "
            "the momenta; read as a momentum it would mean a speed of 5e4 and escape, so it is read as a "
            "speed.",
        ],
        claims=_claims(runs, lost, len(neighbours), steps, growth, scans),
        blocks=[
            figures.configuration(truth),
            figures.trajectories(
                gauss, truth, "gauss", 2, sitnikov.T_END,
                "Left: the primaries at every step. Right: the planetoid is thrown out, comes back or not: "
                "after the first "
                "loss everything depends on the last bit. " + _lost_words(lost, len(neighbours)),
            ),
            figures.trajectories(
                hbvm, truth, "hbvm", 3, figures.SHOWN,
                "Left: the primaries at every step; the ellipses turn slowly, the paper's sham rotation. "
                "Right: the planetoid "
                "on the paper's range, over the true motion in grey.",
            ),
            figures.distances(runs),
            figures.errors(runs),
            figures.by_nodes(scans),
            figures.by_step(steps),
            _step_table(steps),
            figures.truth_compared(results["sitnikov/truth"]),
            "What HBVM(18,2) with h = 1/2 gets right: the energy, the length of the primaries' axis and with "
            "it their period "
            f"(to {number(_row(steps, 'hbvm', 0.5).slow)}), the bound planetoid. What it gets wrong: the "
            "direction of the "
            f"ellipses, which turn by {number(_row(steps, 'hbvm', 0.5).turn)} degrees per revolution, the "
            "angular momentum, and "
            "the planetoid's phase: after a few hundred units of time its height has nothing to do with the "
            "true one. "
            "And the method is not symplectic. A method of higher order at a smaller step costs little more "
            "and gets "
            "all of it right, as the table of the libraries shows for HBVM(16,8).",
            axis_figures.chaos(growth, results["sitnikov/section"], sitnikov.E, CRITICAL),
            axis_figures.territory(
                axis_motion.MAP_ECCENTRICITIES, axis_motion.MAP_SPEEDS, stays, axis_motion.MAP_TURNS, sitnikov.E
            ),
            _others(results),
        ],
    )  # fmt: skip


def _claims(
    runs: dict[str, Orbit],
    lost: Sequence[float],
    neighbours: int,
    steps: Sequence[StepRow],
    growth: Sequence[axis_motion.Growth],
    scans: dict[float, list[tuple[int, float, float | None]]],
) -> list[Claim]:
    gauss, hbvm, truth = runs["gauss"], runs["hbvm"], runs["truth"]
    early = hbvm.t <= figures.SHOWN
    apart = np.abs(hbvm.z - truth.z)
    gauss_span, hbvm_span = figures.apocentres(gauss), figures.apocentres(hbvm)
    half = hbvm.momentum.size // 2
    half_step, turn = _row(steps, "hbvm", 0.5), _row(steps, "hbvm", 0.25)
    kept = {family: _kept(steps, family) for family in ("gauss", "hbvm")}
    at = min(growth, key=lambda row: abs(row.e - sitnikov.E))
    first_left = next((row.e for row in growth if row.left is not None), None)
    enough = next(k for k, error, _ in scans[0.5] if error <= 1e-13)
    return [
        Claim(
            "Under Gauss of order four the planetoid eventually leaves the system",
            "Figure 2",
            f"|z| > {sitnikov.LOST:g} at t = {number(gauss.lost, 3)}. " + _lost_words(lost, neighbours),
            "holds" if gauss.lost is not None or len(lost) > neighbours // 2 else "no",
        ),
        Claim(
            "Under HBVM(18,2) it oscillates in bounds, much like the true motion",
            "Figure 3, on [0, 350]",
            f"|z| ≤ {np.abs(hbvm.z).max():.4f} to t = 1500 (true motion: {np.abs(truth.z).max():.4f}). But z "
            "is off by up to "
            f"{apart[early].max():.2f} on [0, 350] and by {apart[-1]:.2f} at t = 1500",
            "partly",
        ),
        Claim(
            "HBVM(18,2) conserves H up to machine precision",
            "Figure 5 left",
            f"largest relative error {number(hbvm.energy.max())}; k = {enough} nodes are the first that "
            "reach 1e-13",
            "holds" if hbvm.energy.max() <= 1e-13 else "partly",
        ),
        Claim(
            "Gauss shows an error in H",
            "Figure 5 left",
            f"largest relative error {number(gauss.energy.max())}",
            "holds" if gauss.energy.max() > 1e-3 else "no",
        ),
        Claim(
            "Gauss precisely conserves the angular momentum",
            "Figure 5 right",
            f"largest relative error {number(gauss.momentum.max())}",
            "holds" if gauss.momentum.max() < 1e-12 else "no",
        ),
        Claim(
            "HBVM's error in the angular momentum makes bounded, periodic-like oscillations",
            "Figure 5 right",
            f"largest {number(hbvm.momentum[:half].max(), 3)} in the first half, "
            f"{number(hbvm.momentum[half:].max(), 3)} in the "
            f"second. The period is the beat of step and revolution: {_beat(half_step):.0f}",
            "holds" if hbvm.momentum[half:].max() < 1.1 * hbvm.momentum[:half].max() else "no",
        ),
        Claim(
            "HBVM preserves the apocentre distance, Gauss does not",
            "Figure 4",
            f"HBVM {hbvm_span[0]:.4f} … {hbvm_span[1]:.4f}, Gauss {gauss_span[0]:.2f} … {gauss_span[1]:.2f}; "
            "true 5",
            "holds" if np.ptp(hbvm_span) < 0.02 < np.ptp(gauss_span) else "no",
        ),
        Claim(
            "The step causes a sham, uniform rotation that keeps the symmetry",
            "Figure 3 left",
            f"{half_step.turn:.2f} degrees per revolution, uniform to {half_step.unsteady:.1f} degrees; "
            f"{turn.turn:.3f} with "
            "h = 1/4. It falls as h⁴ and is no work of HBVM's: Gauss turns alike",
            "holds",
        ),
        Claim(
            "The primaries stay in their plane, the planetoid on its axis",
            "in the text",
            "off the axis: "
            f"{'exactly 0' if hbvm.off_axis == gauss.off_axis == 0 else number(max(hbvm.off_axis, gauss.off_axis))} "
            f"for both. The plane drifts along z by {hbvm.plane:.2e}, with the barycentre: the planetoid's "
            "momentum is "
            "not balanced",
            "partly",
        ),
        Claim(
            "The motion is chaotic above a critical eccentricity",
            f"ē ≃ {CRITICAL}",
            "not along the axis for this start: the growth rate at e = 0.75 falls from "
            f"{number(at.along[0][1])} after "
            f"{at.along[0][0]} revolutions to {number(at.along[-1][1])} after {at.along[-1][0]}, as for a "
            "regular orbit"
            + (f"; the planetoid first leaves at e = {first_left:g}" if first_left else "")
            + f". Off the axis offsets grow by e every {1 / at.across:.1f} units of time, at every e",
            "no",
        ),
        Claim(
            "HBVM allows larger steps than Gauss",
            "in the text",
            f"the planetoid stays to t = 1500 for all h ≤ {kept['hbvm']:g} with HBVM(18,2), for all h ≤ "
            f"{kept['gauss']:g} with "
            "Gauss",
            "holds" if kept["hbvm"] > kept["gauss"] else "no",
        ),
    ]


def _lost_words(lost: Sequence[float], starts: int) -> str:
    return (
        f"Of {starts} starts that differ in the last bits of e, {len(lost)} lose the planetoid, the first at "
        f"t = {lost[0]:.0f}, "
        f"the last at {lost[-1]:.0f}."
        if lost
        else f"None of {starts} starts that differ in the last bits of e loses the planetoid."
    )


def _row(steps: Sequence[StepRow], family: str, h: float) -> StepRow:
    return next(row for row in steps if row.family == family and row.h == h and row.s == 2)


def _kept(steps: Sequence[StepRow], family: str) -> float:
    """Return the largest h up to which every step keeps the planetoid."""
    largest = 0.0
    for row in sorted((r for r in steps if r.family == family and r.s == 2), key=lambda r: r.h):
        if not figures.usable(row):
            break
        largest = row.h
    return largest


def _beat(row: StepRow) -> float:
    """Return after how long the steps fall on the same places of the revolution again."""
    period = sitnikov.PERIOD * (1 + row.slow)
    part_of_step = period / row.h - round(period / row.h)
    return period / abs(part_of_step)


def _step_table(steps: Sequence[StepRow]) -> Table:
    def cells(row: StepRow) -> tuple[str, ...]:
        fate = f"t = {row.lost:.0f}" if row.lost is not None else "no convergence" if row.reason else "stays"
        rates = (
            [number(row.turn, 3), number(row.slow), number(row.z_error)] if figures.usable(row) else ["–"] * 3
        )
        return (row.method, fate, number(row.energy), *rates)

    return Table(
        key="sitnikov-step-table",
        title="The step and its price",
        head=(
            "method",
            "planetoid lost",
            "energy",
            "sham rotation, °/rev.",
            "period, relative",
            "z at 1500, off by",
        ),
        rows=tuple(cells(row) for row in steps if row.family != "truth"),
        numbers=frozenset(range(1, 6)),
        caption="Largest relative energy error; rotation less the true one; error of the primaries' period; "
        "|z − true z| at the "
        "end. A planetoid that is lost has no rates.",
    )


def _others(results: Results) -> Table:
    rows = [results[f"sitnikov/other {text}"] for text in others.SITNIKOV]
    return Table(
        key="sitnikov-others",
        title="The same run with other integrators",
        head=("method", "energy", "angular momentum", "off axis", "z at 1500, off by", "remark"),
        rows=tuple(
            (
                row.method,
                *(number(row.numbers.get(key)) for key in ("energy", "momentum", "off_axis", "z")),
                row.remark or _remark(row),
            )
            for row in rows
        ),
        numbers=frozenset(range(1, 5)),
        caption="One setting per method, as its authors advise for accuracy. `hbvm-bench run sitnikov` has "
        "all settings, with "
        "times. Off the axis the trajectory is another one, and its other numbers say nothing.",
    )


def _remark(row: others.Row) -> str:
    if row.numbers.get("off_axis", 0.0) > 1e-6:
        return "thrown off the axis by asymmetric rounding"
    if row.numbers.get("z", 0.0) > sitnikov.LOST:
        return "loses the planetoid"
    return ""
