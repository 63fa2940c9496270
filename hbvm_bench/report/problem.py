"""One problem's part of a report: sentences, rows and figures."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.own import Known
from hbvm_bench.measure.observables import observables
from hbvm_bench.measure.raw import WITNESSES
from hbvm_bench.reference import solutions
from hbvm_bench.report import words
from hbvm_bench.report.curves import PREFIX
from hbvm_bench.report.document import Block, Details, Items, Maker, Ranked, Section, attempt
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.figures.over_time import Drawn, OverTime, growth, over_time
from hbvm_bench.report.figures.work_precision import work_precision
from hbvm_bench.report.page import Results
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.frame import Frame
from hbvm_bench.summaries.points import number as number_of
from hbvm_bench.summaries.points import short_name
from hbvm_bench.summaries.rows import Task, at_once, grouped, rows
from integrators.protocol import Array
from problems.problem import Problem

OVER_TIME = (
    OverTime("energy", "Energy error over time", "energy error, |H − H₀| / |H₀|", "error.energy", ""),
    OverTime(
        "position",
        "Position error over time",
        "position error, relative to the size of the orbit",
        "position",
        "At the times of the stored 128-bit reference.",
    ),
    OverTime(
        "angular-momentum",
        "Angular momentum error over time",
        "angular momentum error, |L − L₀| / |L₀|",
        "error.angular_momentum",
        "2-norm of the error of the vector, relative to its length.",
    ),
    OverTime(
        "symmetry",
        "Symmetry violation over time",
        "distance from the symmetry (units of the problem)",
        "guard.",
        "The quantity that the problem's symmetry keeps at exactly 0; lines at the lower edge are 0.",
    ),
    OverTime(
        "distance",
        "Largest distance from the origin over time",
        "largest distance (units of the problem)",
        "distance",
        "Shows which bodies escaped, and when.",
    ),
)


def ranked(task: Task, records: Sequence[Record], known: Known, tables: Iterable[Task]) -> Ranked:
    """Return the rows of one problem; the title tells it from others of the ``tables``."""
    problem = make_problem(task.problem, known)
    title = f"{problem.title}{at_once(task.ensemble)}{task.sampled(tables)}"
    return Ranked(title, short_name(task.problem), grouped(rows(records)))


def summary(task: Task, records: Sequence[Record]) -> Items:
    """Return the summary of one problem's cases; of an ensemble with how many of its ends are known."""
    known = task.ensemble is not None and any(number_of(record, "position_end") for record in records)
    ends = min(task.ensemble.count, WITNESSES) if task.ensemble is not None and known else 0
    subset = [words.REFERENCE_SUBSET.format(ends)] if ends else []
    return Items([*words.summary(records), *subset], "cards")


def section(
    results: Results,
    of: Ranked,
    task: Task,
    missing: Sequence[Case],
    number: int,
    *,
    brief: bool,
    summary: Sequence[Block] = (),
) -> Section:
    """Return what a report says about one problem, or about an ensemble of it.

    ``of`` are its cases, and ``missing`` those that have no result yet. An ensemble's series are over its
    trajectories and not over time: it has rows and no figures. ``brief`` draws only the main figures.
    """
    ids = {row.record.id for _, rows_ in of.groups for row in rows_}
    here, known = results.frame[results.frame.id.isin(ids)], results.known
    problem, records = make_problem(task.problem, known), list(here.record)
    unrun = Items([f"`{case.method}`" for case in missing])
    blocks: list[Block] = [
        *summary,
        *attempt((f"the reference of {task.problem}", partial(_reference, problem, known))),
        *([Details(f"{len(missing)} cases on this problem have no result yet", [unrun])] if missing else []),
        *_figures(here, results.series, number, brief=brief),
        Section("Shortcomings of HBVM and Gauss", [Items(words.shortcomings(records))], f"wrong-{number}"),
    ]
    nav = "Figures" * (number == 1)
    return Section(of.title, blocks, f"problem-{number}", code=of.problem, nav=nav)


def _figures(
    here: Frame, series: Mapping[str, Mapping[str, Array]], number: int, *, brief: bool
) -> list[Block]:
    suffix = "" if number == 1 else f"-{number}"  # file names and anchors are unique in a report
    cases = [Drawn(record, dict(series.get(record.id, {}))) for record in here.record]
    others = () if brief else (*OVER_TIME[1:], *_other_invariants(cases))
    makers: list[Maker] = [
        ("Work and precision", partial(work_precision, here, "work-precision")),
        ("Energy drift", partial(growth, cases)),
        *((spec.title, partial(over_time, cases, spec)) for spec in (OVER_TIME[0], *others)),
    ]
    made = attempt(*((f"{title}, {here.iloc[0].problem}", make) for title, make in makers))
    return [replace(block, key=block.key + suffix) if isinstance(block, Picture) else block for block in made]


def _other_invariants(cases: Sequence[Drawn]) -> list[OverTime]:
    """Return a figure for every invariant that has none of its own and is not exact throughout."""
    own = {PREFIX + spec.values for spec in OVER_TIME}
    curves = [(name, values) for case in cases for name, values in case.curves.items() if name not in own]
    errors = [(name, values) for name, values in curves if name.startswith(f"{PREFIX}error.")]
    names = dict.fromkeys(name for name, values in errors if np.any(values[1] != 0.0))
    specs = []
    for name in names:
        said = name.removeprefix(f"{PREFIX}error.").replace("_", " ")
        key, title = "invariant-" + re.sub(r"\W+", "-", said), f"{said.capitalize()}: error over time"
        caption = "Relative error, or absolute where the value at the start is 0; a vector's 2-norm."
        specs.append(OverTime(key, title, f"error of {said}", name.removeprefix(PREFIX), caption))
    return specs


def _reference(problem: Problem, known: Known) -> Items | None:
    """Return what is known of the reference solution, as far as the table's readers want it."""
    reference = solutions.find(problem, known.references)
    if reference is None:
        return None
    provenance = reference.provenance
    version = f", version {provenance['heyoka']}" if "heyoka" in provenance else ""
    check = f"; {provenance['check']}" if "check" in provenance else ""
    said = [f"Reference: {provenance.get('method', '')}{version}{check}"]
    if "agreement" in provenance:
        said.append(f"The two agree to {provenance['agreement']}")
    if (number := reference.condition_at(problem.t_end)) is not None:
        said.append(
            f"Condition number of the positions at the end: {number:.1e}. A state that is rounded to doubles "
            f"at the worst time changes them by {number * solutions.UNIT_ROUNDOFF:.1e}"
        )
    floor = problem.errors(reference.high, reference.t)
    shown = [name for name in ("energy", "angular_momentum") if name in floor]
    if least := ", ".join(f"{name.replace('_', ' ')} {np.max(floor[name]):.1e}" for name in shown):
        said.append(
            "Errors of the reference solution rounded to doubles, the smallest errors a run can show: "
            f"{least}"
        )
    if reference.t[-1] == problem.t_end:
        for label, observable in list(observables(problem).items())[:1]:
            value = float(observable(reference.high[-1:])[0])
            said.insert(0, f"Reference value of the {label} at t = {problem.t_end:g}: {value:.16g}")
    return Items(said)
