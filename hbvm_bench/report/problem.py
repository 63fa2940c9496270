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
from hbvm_bench.measure.metrics import PLANETOID_Z
from hbvm_bench.reference import solutions
from hbvm_bench.reference.solutions import Reference
from hbvm_bench.report import words
from hbvm_bench.report.document import Block, Details, Items, Maker, Ranked, Section, attempt
from hbvm_bench.report.figures import motion, over_time, portraits, views
from hbvm_bench.report.figures.canvas import Picture, styled
from hbvm_bench.report.figures.drift import drift_figure
from hbvm_bench.report.figures.over_time import Drawn, OverTime
from hbvm_bench.report.figures.style import Look
from hbvm_bench.report.figures.work_precision import work_precision
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import family_of, number
from hbvm_bench.summaries.rows import GROUPS, at_once, group_of, rows, title_of
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
    found: Sequence[tuple[Record, dict[str, Array]]],
    look: dict[str, Look],
    missing: Sequence[Case],
    number: int,
    *,
    brief: bool = False,
    summarized: bool = False,
) -> ProblemPart:
    """Make what the report says about one problem, or about an ensemble of it.

    Parameters
    ----------
    text : str
        The problem as it prints.
    found : sequence of (Record, dict)
        Its cases, at least one, and their series. An ensemble's are over its trajectories
        and not over time: it has rows and no figures.
    look : dict of Look
        By method.
    missing : sequence of Case
        Those that have no result yet.
    number : int
        Of the section, from 1.
    brief : bool
        Whether only the main figures are drawn, of the most telling cases.
    summarized : bool
        Whether its summary stands in its own section.
    """
    problem = make_problem(text)
    records = [record for record, _ in found]
    known = solutions.find(problem)
    ensemble = records[0].case.ensemble
    cases = [Drawn(record, look[record.case.method], series) for record, series in found if ensemble is None]
    drawn = [case for case in cases if "t" in case.series and case.series["t"].size]
    table = rows(records)
    groups = [
        (title_of(key, members), members)
        for key in GROUPS
        if (members := [row for row in table if row.group == key])
    ]
    ends = max((len(series.get("position_t", ())) for _, series in found), default=0)
    witnesses = [words.WITNESSES.format(ends)] if ensemble is not None and ends else []
    summary = attempt(
        (f"the summary of {text}", lambda: Items([*words.summary(records), *witnesses], "cards"))
    )
    title = f"{problem.title}{at_once(ensemble)}"
    unrun = Details(
        f"{len(missing)} cases on this problem have no result yet",
        [Items([f"`{case.method}`" for case in missing])],
    )
    blocks: list[Block] = [
        *(summary if summarized else []),
        *attempt((f"the reference of {text}", lambda: _truth(problem, known))),
        *([unrun] if missing else []),
        *_figures(problem, drawn, known, number, brief=brief),
        Section(
            "What our own methods do wrong",
            attempt((f"our shortcomings on {text}", lambda: Items(words.shortcomings(records)))),
            f"wrong-{number}",
        ),
    ]
    section = Section(title, blocks, f"problem-{number}", code=repr(problem), nav="Figures" * (number == 1))
    return ProblemPart(problem, Ranked(title, repr(problem), groups), summary, section)


def _figures(
    problem: Problem, cases: Sequence[Drawn], known: Reference | None, number: int, *, brief: bool
) -> list[Block]:
    suffix = "" if number == 1 else f"-{number}"  # file names and anchors are unique in a report
    main = telling(cases) if brief else cases
    left = len(cases) - len(main)
    note = f" Drawn: {len(main)} of {len(cases)} cases, the best and the default of each method." * (left > 0)

    @styled
    def finished(make: Callable[[], Any]) -> Picture | None:
        made: Picture | None = make()
        if made is None:
            return None
        caption = made.caption + ("" if made.key == "work-precision" else note)
        return replace(made, key=made.key + suffix, caption=caption)

    makers = _makers(problem, cases, main, known, brief=brief)
    return attempt(*((f"{title}, {problem!r}", partial(finished, make)) for title, make in makers))


def _makers(
    problem: Problem, cases: Sequence[Drawn], main: Sequence[Drawn], known: Reference | None, *, brief: bool
) -> list[Maker]:
    """Return what draws each figure, in order; a new one is a line here."""

    def errors(what: OverTime) -> Maker:
        return what.title, lambda: over_time.over_time(main, what)

    sitnikov = problem.name == "sitnikov"
    made: list[Maker] = [
        ("Work and precision", lambda: work_precision(cases)),
        ("Drift of the energy", lambda: drift_figure(main)),
    ]
    if sitnikov and not brief:
        made.append(("The system in space", lambda: motion.still(cases, "The system in space")))
    made += [errors(what) for what in (OVER_TIME[:1] if brief else (*OVER_TIME, *_other_invariants(cases)))]
    made += [
        ("Phase portrait", lambda: portraits.portrait(problem, main)),
        ("Section", lambda: portraits.section(problem, main)),
    ]
    if not brief:
        own = views.VIEWS.get(problem.name or "", ())
        made += [("A view of this problem", lambda view=view: view(problem, cases, known)) for view in own]
        made.append(("Step sizes", lambda: views.step_sizes(cases)))
    return made


def telling(cases: Sequence[Drawn]) -> list[Drawn]:
    """Return the cases to draw where there are many: of each method the most accurate and the default."""
    if len(cases) <= MOST_DRAWN:
        return list(cases)
    kept: dict[str, Drawn] = {}
    by_name: dict[str, list[Drawn]] = {}
    for case in cases:
        by_name.setdefault(family_of(case.record), []).append(case)
    for members in by_name.values():
        best = min(members, key=_rank)
        default = next((case for case in members if case.record.case.settings == "default"), best)
        kept |= {case.record.id: case for case in (best, default)}
    return [case for case in cases if case.record.id in kept][:MOST_DRAWN]


def _rank(case: Drawn) -> tuple[bool, float]:
    errors = [number(case.record, key) for key in ("position_end", "energy_max")]
    least = next((error for error in errors if error is not None), np.inf)
    return group_of(case.record) != "on", least


OVER_TIME = (
    OverTime(
        key="energy",
        title="Energy error over time",
        caption="Relative error of the energy. A line is the largest value in each of "
        f"{over_time.BINS} spans of time. † lost the symmetry, ‡ did not reach the end.",
        label="|H − H₀| / |H₀|",
        values="error.energy",
        low=-17,
        high=2,
    ),
    OverTime(
        key="position",
        title="Position error over time",
        caption="Position error at the times of the stored 128-bit reference.",
        label="position error",
        values="position",
        t="position_t",
        low=-17,
        high=4,
        joined=False,
    ),
    OverTime(
        key="angular-momentum",
        title="Angular momentum error over time",
        caption="2-norm of the error of the angular momentum vector, relative to its length.",
        label="|L − L₀| / |L₀|",
        values="error.angular_momentum",
        low=-17,
        high=2,
    ),
    OverTime(
        key="symmetry",
        title="Off-axis distance over time",
        caption="What the problem's symmetry keeps at exactly 0. Lines at the lower edge are exactly 0; "
        "what is smaller than the lowest power is drawn just above it.",
        label="distance from the axis",
        values="guard.",
        low=-24,
        high=4,
        zero=True,
    ),
    OverTime(
        key="distance",
        title="Largest distance from the origin over time",
        caption="Shows what escaped, and when.",
        label="largest distance",
        values="distance",
        low=0,
        high=5,
    ),
)


def _other_invariants(cases: Sequence[Drawn]) -> list[OverTime]:
    """Return a figure for every invariant that has none of its own."""
    drawn = {"error.energy", "error.angular_momentum"}
    names = dict.fromkeys(
        n for case in cases for n in case.series if n.startswith("error.") and n not in drawn
    )
    made = []
    for name in names:
        if not any(np.any(case.series[name] != 0.0) for case in cases if name in case.series):
            continue
        words_ = name.removeprefix("error.").replace("_", " ")
        made.append(
            OverTime(
                key="invariant-" + re.sub(r"\W+", "-", words_),
                title=f"{words_.capitalize()}: error over time",
                caption="Relative error, or absolute where the value at the start is 0; a vector's 2-norm.",
                label=f"error of {words_}",
                values=name,
                low=-17,
                high=2,
            )
        )
    return made


def _truth(problem: Problem, known: Reference | None) -> Items | None:
    """Return what is known of the trusted solution, as far as the table's readers want it."""
    if known is None:
        return None
    made = known.provenance
    version = f", version {made['heyoka']}" if "heyoka" in made else ""
    check = f"; {made['check']}" if "check" in made else ""
    said = [f"Reference: {made.get('method', '')}{version}{check}"]
    if "agreement" in made:
        said.append(f"The two agree to {made['agreement']}")
    floor = problem.errors(known.high, known.t)
    least = ", ".join(
        f"{name.replace('_', ' ')} {np.max(floor[name]):.1e}"
        for name in ("energy", "angular_momentum")
        if name in floor
    )
    if least:
        said.append(
            f"Errors of the reference itself once rounded to doubles, the least a run can show: {least}"
        )
    if problem.name == "sitnikov" and known.t[-1] == problem.t_end:
        z = known.high[-1, PLANETOID_Z]
        said.insert(0, f"Reference value of z at t = {problem.t_end:g}: {z:.16g}")
    return Items(said)
