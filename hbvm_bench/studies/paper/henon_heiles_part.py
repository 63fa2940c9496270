"""The Henon-Heiles experiment in words: what the paper claims, what came out."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import takewhile
from typing import Any

import numpy as np

from hbvm_bench.report.document import Claim, Maker
from hbvm_bench.studies.paper import henon_heiles_figures as figures
from hbvm_bench.studies.paper.drawn import number
from hbvm_bench.studies.paper.experiments import henon_heiles as experiment
from hbvm_bench.studies.paper.experiments import others
from hbvm_bench.studies.paper.experiments.henon_heiles import GAUSS, HBVM_4, Orbit, StepRow
from hbvm_bench.studies.paper.results import Part, Results, Task, split
from hbvm_bench.summaries.table import Table
from integrators.protocol import Array
from problems.catalogue.henon_heiles import ESCAPE, SADDLES

PRINTED = 7000.0  # the paper's escape time, "t ≃ 7000"
FAMILIES = {"gauss": GAUSS, "hbvm": HBVM_4}
PROBLEM = (
    "The paper integrates to t = 50,000 with h = 1 from a point whose energy is “very close to” "
    "1/6; it does not say which. Here: (q₁, q₂) = ({:g}, {:g}), momentum at an angle of "
    f"{{:g}} rad, H₀ = 1/6 − {experiment.GAP:g}. The motion is chaotic, so the last bit of the "
    f"start decides when Gauss loses the orbit: {experiment.NEIGHBOURS} starts were tried that "
    "differ in the last bits of one momentum, and the one drawn (number {}) is "
    "the one that escapes nearest to the paper's time."
)


def gauss_orbit() -> tuple[int, Orbit]:
    """Return the neighbouring start whose escape is nearest to the paper's time, and its orbit."""
    times = experiment.escapes(GAUSS, t_end=2 * PRINTED)
    nearest = min(range(len(times)), key=lambda i: abs((times[i] or np.inf) - PRINTED))
    return nearest, experiment.orbit(GAUSS, offset=nearest)


def _runs() -> list[Task]:
    starts, gaps = range(experiment.NEIGHBOURS), experiment.GAPS
    return [
        Task("gauss", gauss_orbit, 20),
        Task("hbvm", partial(experiment.orbit, HBVM_4), 3),
        Task("truth", experiment.true_orbit, 1),
        *(
            task
            for family, method in FAMILIES.items()
            for task in (
                Task(f"steps {family}", partial(experiment.by_step, family), 9),
                *split(f"escapes {family}", partial(experiment.escapes, method), starts, 4, 6),
                *split(f"map {family}", partial(experiment.escape_map, method), gaps, 4, 15),
            )
        ),
        *others.tasks(others.on_henon_heiles, others.HENON_HEILES, 8),
    ]


def _blocks(results: Results) -> list[Maker]:
    pair = partial(_pair, results)
    return [
        ("the problem", lambda: PROBLEM.format(*experiment.START, results["gauss"][0])),
        ("Figure 1", lambda: figures.level_curves(results["truth"])),
        (
            "Figure 2",
            lambda: figures.plane(
                results["gauss"][1], "gauss", 2,
                "Every step until the orbit leaves; circles: the last steps, as in the paper.",
            ),
        ),
        (
            "Figure 3",
            lambda: figures.plane(
                results["hbvm"], "hbvm", 3, "All 50,000 steps from the first of the starts."
            ),
        ),
        ("Figure 4", lambda: figures.hamiltonian(results["gauss"][1], results["hbvm"])),
        (
            "the escape times",
            lambda: figures.fates({repr(FAMILIES[key]): t for key, t in pair("escapes").items()}, PRINTED),
        ),
        ("who escapes from where", lambda: figures.maps(pair("map"))),
        ("the table of steps", lambda: _step_table(pair("steps"))),
        ("the other integrators", lambda: _others(results)),
    ]  # fmt: skip


def _pair(results: Results, what: str) -> dict[str, Any]:
    """Return what was computed with both methods; maps as arrays."""
    found = {family: results[f"{what} {family}"] for family in FAMILIES}
    return {family: np.stack(rows) for family, rows in found.items()} if what == "map" else found


def _claims(results: Results) -> list[Claim]:
    gauss: Orbit = results["gauss"][1]
    hbvm: Orbit = results["hbvm"]
    times, maps, steps = (_pair(results, what) for what in ("escapes", "map", "steps"))
    gone = {family: sorted(time for time in found if time is not None) for family, found in times.items()}
    starts = len(times["gauss"])
    middle = float(np.median([np.inf if time is None else time for time in times["gauss"]]))
    inside = gauss.t <= (gauss.left or np.inf) - 3
    slopes = max(float(np.abs(_slope(*point)).max()) for point in SADDLES)
    heights = max(abs(float(experiment.potential(np.array(x), np.array(y))) - ESCAPE) for x, y in SADDLES)
    left = {family: int(np.count_nonzero(~np.isnan(found))) for family, found in maps.items()}
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
            f"{len(gone['gauss'])} of {starts} neighbouring starts escape before t = 50,000, the first at "
            f"{min(gone['gauss'], default=np.nan):.0f}, half of all by {middle:,.0f}; the one drawn at "
            f"{number(gauss.left)}",
            "holds" if gauss.left is not None else "no",
        ),
        Claim(
            "Under HBVM(4,2) the orbit is in the triangle at all times",
            "50,000 points",
            f"{len(hbvm.t) - 1:,} points, {hbvm.outside} outside; {len(gone['hbvm'])} of the neighbouring "
            f"starts and {left['hbvm']} of {maps['hbvm'].size} other starts and energies leave, where under "
            f"Gauss {left['gauss']} do",
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
            f"H between {gauss.energy[inside].min():.5f} and {gauss.energy[inside].max():.5f}, across 1/6 = "
            "0.16667",
            "holds" if gauss.energy[inside].max() > ESCAPE else "no",
        ),
        Claim(
            "HBVM allows larger steps than Gauss",
            "in the text",
            f"of {experiment.STEP_STARTS} neighbouring starts none leaves for any h tried up to "
            f"{kept(steps['hbvm']):g} with HBVM(4,2), up to {kept(steps['gauss']):g} with Gauss. Inside is "
            f"not true: with h = 1 either orbit agrees with the true one up to t ≈ "
            f"{max(row.agrees for rows in steps.values() for row in rows if row.h == experiment.H):.0f} only",
            "holds" if kept(steps["hbvm"]) > kept(steps["gauss"]) else "no",
        ),
    ]


def kept(rows: Sequence[StepRow]) -> float:
    """Return the largest h up to which no orbit leaves with any step; 0 where one leaves with the first."""
    stay = takewhile(lambda row: row.left.count(None) == len(row.left), rows)
    return max((row.h for row in stay), default=0.0)


def _step_table(steps: Mapping[str, Sequence[StepRow]]) -> Table:
    def cells(row: StepRow) -> tuple[str, ...]:
        gone = [time for time in row.left if time is not None]
        return str(len(gone)), f"{min(gone):.0f}" if gone else "–", f"{row.agrees:g}"

    return Table(
        key="henon-heiles-steps",
        title="The step and who stays",
        head=("h", *("leave", "the first at", "agrees until t") * 2),
        rows=tuple(
            (f"{gauss.h:g}", *cells(gauss), *cells(hbvm))
            for gauss, hbvm in zip(steps["gauss"], steps["hbvm"], strict=True)
        ),
        words=(),
        groups=(("", 1), ("Gauss, s = 2", 3), ("HBVM(4,2)", 3)),
        note=f"{experiment.STEP_STARTS} neighbouring starts, followed to t = {experiment.T_END:,.0f}; "
        "a step whose equations find no solution counts as leaving. Agrees: time up to which the first of "
        f"them is within {experiment.AGREES:g} of the true orbit. Staying inside is what the energy gives; "
        "a true orbit takes a smaller step under either method.",
    )


def _slope(x: float, y: float) -> Array:
    return np.array([x + 2 * x * y, y + x * x - y * y])


def _others(results: Results) -> Table:
    return others.table(
        results,
        others.HENON_HEILES,
        {
            "energy": ("energy", number),
            "outside by": ("outside", number),
            "agrees until t": ("agrees", "{:.0f}".format),
        },
        "The same start with other integrators",
        f"To t = {others.HENON_SPAN:g}. Largest relative energy error; largest distance beyond the "
        f"triangle; time at which the orbit is {experiment.AGREES:g} from that of HBVM(15,10), h = 1/4. "
        "Chaos doubles every error about every five units of time, so no double precision orbit agrees "
        "much longer than two hundred.",
    )


PART = Part("henon-heiles", "The Hénon–Heiles problem", _runs(), _claims, _blocks)
