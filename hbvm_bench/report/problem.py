"""One problem's part of a report: sentences, rows and figures."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.measure.observables import observables
from hbvm_bench.measure.raw import WITNESSES
from hbvm_bench.reference import solutions
from hbvm_bench.reference.solutions import Reference
from hbvm_bench.report import words
from hbvm_bench.report.document import Block, Details, Items, Maker, Ranked, Section, attempt
from hbvm_bench.report.figures import over_time, portraits, views
from hbvm_bench.report.figures.canvas import Picture, styled
from hbvm_bench.report.figures.drift import drift_figure
from hbvm_bench.report.figures.over_time import Drawn, OverTime
from hbvm_bench.report.figures.style import Look
from hbvm_bench.report.figures.work_precision import work_precision
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import family_of, short_name
from hbvm_bench.summaries.points import number as number_of
from hbvm_bench.summaries.rows import at_once, grouped, reached, rows
from problems.problem import Problem

Array = NDArray[np.float64]

MOST_DRAWN = 32  # cases in a figure of a large report


@dataclass(frozen=True)
class ProblemPart:
    """What a report says on one problem: its rows, its summary, and a section of its own."""

    problem: Problem
    ranked: Ranked
    summary: list[Block]
    section: Section


def part(
    text: str,
    cases_found: Sequence[tuple[Record, dict[str, Array]]],
    look: dict[str, Look],
    missing: Sequence[Case],
    number: int,
    *,
    brief: bool,
    summarized: bool,
    sampled: str = "",
    drawings: Sequence[Picture] = (),
) -> ProblemPart:
    """Make what the report says about one problem, or about an ensemble of it.

    ``found`` are its cases, at least one, with their series, and ``missing`` those that have no result yet.
    An ensemble's series are over its trajectories and not over time: it has rows and no figures. ``brief``
    draws only the main figures, of the most telling cases; ``summarized`` puts the summary into the section;
    ``sampled`` tells it from another part on the problem, by its samples.
    ``drawings`` are its figures where they are drawn already.
    """
    problem = make_problem(text)
    records = [record for record, _ in cases_found]
    known = solutions.find(problem)
    ensemble = records[0].case.ensemble
    cases = [
        Drawn(record, look[record.case.method], series) for record, series in cases_found if ensemble is None
    ]
    drawn = [case for case in cases if "t" in case.series and case.series["t"].size]
    known_ends = ensemble is not None and any(number_of(record, "position_end") for record in records)
    ends = min(ensemble.count, WITNESSES) if ensemble is not None and known_ends else 0
    subset = [words.REFERENCE_SUBSET.format(ends)] if ends else []
    summary = attempt((f"the summary of {text}", lambda: Items([*words.summary(records), *subset], "cards")))
    wrong = attempt(
        (f"the shortcomings of HBVM and Gauss on {text}", lambda: Items(words.shortcomings(records)))
    )
    title = f"{problem.title}{at_once(ensemble)}{sampled}"
    unrun = Items([f"`{case.method}`" for case in missing])
    blocks: list[Block] = [
        *(summary if summarized else []),
        *attempt((f"the reference of {text}", lambda: _truth(problem, known))),
        *([Details(f"{len(missing)} cases on this problem have no result yet", [unrun])] if missing else []),
        *(drawings or _figures(problem, drawn, known, number, brief=brief)),
        Section("Shortcomings of HBVM and Gauss", wrong, f"wrong-{number}"),
    ]
    section = Section(
        title, blocks, f"problem-{number}", code=short_name(repr(problem)), nav="Figures" * (number == 1)
    )
    return ProblemPart(
        problem, Ranked(title, short_name(repr(problem)), grouped(rows(records))), summary, section
    )


def _figures(
    problem: Problem, cases: Sequence[Drawn], known: Reference | None, number: int, *, brief: bool
) -> list[Block]:
    suffix = "" if number == 1 else f"-{number}"  # file names and anchors are unique in a report
    main = telling(cases) if brief else cases
    left = len(cases) - len(main)
    note = f" Drawn: {len(main)} of {len(cases)} cases, the best and the default of each method." * (left > 0)

    @styled
    def finished(make: Callable[[], Any]) -> Picture | None:
        if (drawn := make()) is None:
            return None
        said = "" if drawn.key == "work-precision" else note
        return replace(drawn, key=drawn.key + suffix, caption=drawn.caption + said)

    makers = _makers(problem, cases, main, known, brief=brief)
    return attempt(*((f"{title}, {problem!r}", partial(finished, make)) for title, make in makers))


def _makers(
    problem: Problem, cases: Sequence[Drawn], main: Sequence[Drawn], known: Reference | None, *, brief: bool
) -> list[Maker]:
    """Return what draws each figure, in order; a new one is a line here."""

    def errors(spec: OverTime) -> Maker:
        return spec.title, lambda: over_time.over_time(main, spec)

    makers: list[Maker] = [
        ("Work and precision", lambda: work_precision(cases)),
        ("Energy drift", lambda: drift_figure(main)),
    ]
    makers += [errors(spec) for spec in (OVER_TIME[:1] if brief else (*OVER_TIME, *_other_invariants(cases)))]
    makers += [
        ("Phase portrait", lambda: portraits.portrait(problem, main)),
        ("Section", lambda: portraits.section(problem, main)),
    ]
    if not brief:
        makers.append(("The observable", lambda: views.observed(problem, cases, known)))
        makers.append(("Step sizes", lambda: views.step_sizes(cases)))
    return makers


def telling(cases: Sequence[Drawn]) -> list[Drawn]:
    """Return the cases to draw where there are many: of each method the most accurate and the default."""
    if len(cases) <= MOST_DRAWN:
        return list(cases)
    kept: set[str] = set()
    for family in dict.fromkeys(family_of(case.record) for case in cases):
        members = [case for case in cases if family_of(case.record) == family]
        best = min(members, key=_rank)
        default = next((case for case in members if case.record.case.settings == "default"), best)
        kept |= {best.record.id, default.record.id}
    return [case for case in cases if case.record.id in kept][:MOST_DRAWN]


def _rank(case: Drawn) -> tuple[bool, float]:
    errors = [number_of(case.record, key) for key in ("position_end", "energy_max")]
    return not reached(case.record), next((error for error in errors if error is not None), np.inf)


# fmt: off
OVER_TIME = (
    OverTime(
        "energy", "Energy error over time", "|H − H₀| / |H₀|", "error.energy", -17, 2,
        "Relative error of the energy. A line is the largest value in each of "
        f"{over_time.BINS} equal time intervals. † lost the symmetry, ‡ did not reach the end.",
    ),
    OverTime(
        "position", "Position error over time", "position error", "position", -17, 4,
        "Position error at the times of the stored 128-bit reference.", t="position_t", joined=False,
    ),
    OverTime(
        "angular-momentum", "Angular momentum error over time", "|L − L₀| / |L₀|", "error.angular_momentum",
        -17, 2, "2-norm of the error of the angular momentum vector, relative to its length.",
    ),
    OverTime(
        "symmetry", "Off-axis distance over time", "distance from the axis", "guard.", -24, 4,
        "The quantity that the problem's symmetry keeps at exactly 0. Lines at the lower edge are exactly 0; "
        "smaller values than the lowest power are drawn just above them.", zero=True,
    ),
    OverTime(
        "distance", "Largest distance from the origin over time", "largest distance", "distance", 0, 5,
        "Shows which bodies escaped, and when.",
    ),
)
# fmt: on


def _other_invariants(cases: Sequence[Drawn]) -> list[OverTime]:
    """Return a figure for every invariant that has none of its own and is not exact throughout."""
    own = ("error.energy", "error.angular_momentum")
    series = [(name, values) for case in cases for name, values in case.series.items()]
    names = dict.fromkeys(name for name, _ in series if name.startswith("error.") and name not in own)
    caption = "Relative error, or absolute where the value at the start is 0; a vector's 2-norm."
    specs = []
    for name in names:
        if any(np.any(values != 0.0) for other, values in series if other == name):
            said = name.removeprefix("error.").replace("_", " ")
            key, title = "invariant-" + re.sub(r"\W+", "-", said), f"{said.capitalize()}: error over time"
            specs.append(OverTime(key, title, f"error of {said}", name, -17, 2, caption))
    return specs


def _truth(problem: Problem, known: Reference | None) -> Items | None:
    """Return what is known of the trusted solution, as far as the table's readers want it."""
    if known is None:
        return None
    provenance = known.provenance
    version = f", version {provenance['heyoka']}" if "heyoka" in provenance else ""
    check = f"; {provenance['check']}" if "check" in provenance else ""
    said = [f"Reference: {provenance.get('method', '')}{version}{check}"]
    if "agreement" in provenance:
        said.append(f"The two agree to {provenance['agreement']}")
    if (number := known.condition_at(problem.t_end)) is not None:
        said.append(
            f"Condition number of the positions at the end: {number:.1e}. A state that is rounded to doubles "
            f"at the worst time changes them by {number * solutions.UNIT_ROUNDOFF:.1e}"
        )
    floor = problem.errors(known.high, known.t)
    shown = [name for name in ("energy", "angular_momentum") if name in floor]
    if least := ", ".join(f"{name.replace('_', ' ')} {np.max(floor[name]):.1e}" for name in shown):
        said.append(
            "Errors of the reference solution rounded to doubles, the smallest errors a run can show: "
            f"{least}"
        )
    if known.t[-1] == problem.t_end:
        for label, observable in list(observables(problem).items())[:1]:
            value = float(observable(known.high[-1:])[0])
            said.insert(0, f"Reference value of the {label} at t = {problem.t_end:g}: {value:.16g}")
    return Items(said)
