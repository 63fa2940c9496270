"""Sitnikov's problem in the report: what is computed, drawn and said."""

from functools import partial

import numpy as np

from hbvm_bench.report.document import Claim, Maker
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.studies.paper import axis_figures, axis_motion, others, sitnikov
from hbvm_bench.studies.paper import sitnikov_beyond as beyond
from hbvm_bench.studies.paper import sitnikov_claims as said
from hbvm_bench.studies.paper import sitnikov_figures as figures
from hbvm_bench.studies.paper.drawn import number
from hbvm_bench.studies.paper.results import Results, Task, joined, split
from hbvm_bench.studies.paper.sitnikov import Orbit, StepRow
from hbvm_bench.summaries.table import Table

KEY, TITLE = "sitnikov", "Sitnikov's problem"
PROBLEM = (
    "Two primaries of mass 1 on ellipses with e = 0.75 and a planetoid of mass 1e-5 on the axis "
    "through their barycentre; G = 1, h = 1/2, t from 0 to 1500, about 70 revolutions. The paper "
    "prints the planetoid's 1/2 among the momenta; read as a momentum it would mean a speed of 5e4 "
    "and escape, so it is read as a speed."
)
NODE_STEPS = (0.5, 0.25)
SCANS = 3  # tasks of the scan over eccentricities
CHUNKS = 4  # tasks of the map of who stays
BLOWN = 1e3  # relative error of H of a run that has no meaning


def tasks() -> list[Task]:
    """Return the computations of this part."""
    return [
        Task("sitnikov/orbits", sitnikov.orbits, 2),
        Task("sitnikov/ellipses", sitnikov.ellipses, 1),
        Task("sitnikov/neighbours", sitnikov.neighbours, 1),
        *(Task(f"sitnikov/nodes {h}", partial(sitnikov.energy_by_nodes, h), 3) for h in NODE_STEPS),
        Task("sitnikov/steps 2", partial(sitnikov.by_step, 2), 4),
        Task("sitnikov/steps 3", partial(sitnikov.by_step, 3, sitnikov.STEPS_SHORT), 4),
        Task("sitnikov/truth", sitnikov.against_truth, 2),
        *split("sitnikov/growth", axis_motion.growth_by_eccentricity, axis_motion.ECCENTRICITIES, SCANS, 15),
        Task("sitnikov/section", partial(axis_motion.section, sitnikov.E), 4),
        *split("sitnikov/stays", axis_motion.stays, axis_motion.MAP_ECCENTRICITIES, CHUNKS, 8),
        *others.tasks(KEY, others.on_sitnikov, others.SITNIKOV, 6),
    ]


def claims(results: Results) -> list[Claim]:
    """Return the claims of the paper's section."""
    times: list[float | None] = results["sitnikov/neighbours"]
    return said.claims(
        results["sitnikov/orbits"],
        _lost(times),
        len(times),
        _steps(results),
        _growth(results),
        results[f"sitnikov/nodes {sitnikov.H}"],
    )


def blocks(results: Results) -> list[Maker]:
    """Return what makes each block of the section."""

    def run(name: str) -> Orbit:
        return results["sitnikov/orbits"][name]

    def thrown_out() -> Picture:
        times: list[float | None] = results["sitnikov/neighbours"]
        return figures.trajectories(
            run("gauss"),
            run("fine"),
            "gauss",
            2,
            sitnikov.T_END,
            "Left: the primaries at every step. Right: the planetoid is thrown out; when, and whether "
            "it comes back once more, is decided by the last bit. "
            f"{said.lost_words(_lost(times), len(times))}",
        )

    def stays() -> Picture:
        return figures.trajectories(
            run("hbvm"),
            run("fine"),
            "hbvm",
            3,
            figures.SHOWN,
            "Left: the primaries at every step, and one of them in its 1st, 16th and 31st revolution as "
            "a line: the ellipses turn, the paper's sham rotation. Right: the planetoid on the paper's "
            "range of time, over the true motion in grey.",
            results["sitnikov/ellipses"],
        )

    def territory() -> Picture:
        found = np.stack(joined(results, "sitnikov/stays", CHUNKS))
        return axis_figures.territory(
            axis_motion.MAP_ECCENTRICITIES, axis_motion.MAP_SPEEDS, found, axis_motion.MAP_TURNS, sitnikov.E
        )

    return [
        ("the problem", lambda: PROBLEM),
        ("Figure 1", lambda: figures.configuration(run("fine"))),
        ("Figure 2", thrown_out),
        ("Figure 3", stays),
        ("Figure 4", lambda: figures.distances(results["sitnikov/orbits"])),
        ("Figure 5", lambda: figures.errors(results["sitnikov/orbits"])),
        ("both laws at once", lambda: _both(results["sitnikov/orbits"])),
        ("nodes", lambda: beyond.by_nodes({h: results[f"sitnikov/nodes {h}"] for h in NODE_STEPS})),
        ("steps", lambda: beyond.by_step(_steps(results))),
        ("the table of steps", lambda: beyond.step_table(_steps(results))),
        ("the true trajectory", lambda: beyond.truth_compared(results["sitnikov/truth"])),
        ("what is right and what is wrong", lambda: _plainly(results)),
        (
            "is it chaos?",
            lambda: axis_figures.chaos(
                _growth(results), results["sitnikov/section"], sitnikov.E, said.CRITICAL
            ),
        ),
        ("who stays", territory),
        ("the other integrators", lambda: _others(results)),
    ]


def _lost(times: list[float | None]) -> list[float]:
    return sorted(time for time in times if time is not None)


def _steps(results: Results) -> list[StepRow]:
    return [*results["sitnikov/steps 2"], *results["sitnikov/steps 3"][1:]]


def _growth(results: Results) -> list[axis_motion.Growth]:
    return joined(results, "sitnikov/growth", SCANS)


def _both(runs: dict[str, Orbit]) -> str | None:
    """Return what the method that keeps both laws does, where there is one."""
    run = runs.get("both")
    if run is None:
        return None
    off = float(abs(run.z[-1] - runs["truth"].z[-1]))
    axis = "exactly on the axis" if run.off_axis == 0 else f"{number(run.off_axis)} off the axis"
    return (
        f"Beyond the paper, both laws at once. `{run.method}` corrects the polynomial so that two line "
        f"integrals vanish: it keeps the energy to {number(run.energy.max())} and the angular momentum to "
        f"{number(run.momentum.max())} at the paper's step, with the planetoid {axis} and within |z| ≤ "
        f"{np.abs(run.z).max():.4f}. That, too, is not accuracy: its z at t = 1500 is off by {off:.2f}."
    )


def _plainly(results: Results) -> str:
    found = said.row(_steps(results), "hbvm", sitnikov.H)
    paper, ours = (
        results[f"sitnikov/other {text}"].numbers
        for text in ("HBVM(k=18, s=2, h=0.5)", "HBVM(k=16, s=8, h=0.125)")
    )
    share = ours["evaluations"] / paper["evaluations"]
    return (
        "What HBVM(18,2) with h = 1/2 gets right: the energy, the length of the primaries' axis and with "
        f"it their period (to {number(found.slow)}), a planetoid that stays. What it gets wrong: the "
        f"direction of the ellipses, which turn by {found.turn:.1f} degrees per revolution, the angular "
        "momentum, and the planetoid's phase: after a few hundred units of time its height has nothing to "
        "do with the true one. Nor is the method symplectic. A higher order with a smaller step gets all "
        f"of it right: HBVM(16,8) with h = 1/8 has z at t = 1500 to {number(ours['z'])}, for {share:.2f} "
        "times the field evaluations of the paper's run (table of the libraries below)."
    )


def _others(results: Results) -> Table:
    return others.table(
        results,
        KEY,
        others.SITNIKOV,
        {
            "energy": ("energy", number),
            "angular momentum": ("momentum", number),
            "off the axis": ("off_axis", number),
            "z at 1500 off by": ("z", number),
            "evaluations": ("evaluations", "{:,.0f}".format),
        },
        "The same run with other integrators",
        "One setting per method, chosen by us for accuracy. Evaluations: of the vector "
        "field, where the library counts them. `hbvm-bench run sitnikov` has "
        "all settings, with times. Off the axis the trajectory is another one, and its other numbers say "
        "nothing.",
        _remark,
    )


def _remark(row: others.Row) -> str:
    if row.numbers.get("energy", 0.0) > BLOWN:
        return "blows up"
    if row.numbers.get("off_axis", 0.0) > 1e-6:
        return "thrown off the axis by asymmetric rounding"
    if row.numbers.get("z", 0.0) > sitnikov.LOST:
        return "loses the planetoid"
    return ""
