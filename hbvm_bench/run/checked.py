"""What of a campaign is looked at before anything runs: every name, and every number that says nothing.

A method that nobody has, a limit under which no process can begin, a sample beyond the end: each would be
found out hours later, or never. What types can say is said where the file is read.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from hbvm_bench.campaign.entries import Page
from hbvm_bench.campaign.file import Campaign, EnsembleEntry, Goal, MethodEntry, TimingPlan, name_of
from hbvm_bench.campaign.grid import Grid
from hbvm_bench.campaign.identity import Resolved, is_ours
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.measure.measured import PLAIN, PREFIXES
from hbvm_bench.measure.metrics import find
from hbvm_bench.reference import solutions
from hbvm_bench.summaries.goals import TIMES
from hbvm_bench.summaries.rows import Task, grouped_by
from hbvm_bench.summaries.standings import tasks_of
from problems.errors import InputError, unknown
from problems.problem import Problem

SHORTEST = 0.02  # seconds of a sample


def check(campaign: Campaign, cases: Sequence[Resolved]) -> None:
    """Check what neither the types of a campaign nor the making of its cases do.

    Raises
    ------
    problems.errors.InputError
        For the first name that nobody has, and the first number that says nothing.
    """
    _timing(campaign.timing)
    for method in (*campaign.methods, *(item for many in campaign.ensembles for item in many.methods)):
        _settings(method)
    _series(campaign.page, cases)
    here = _by_name(campaign, cases)
    for name, those in here.items():
        if not those:
            raise InputError(f"no method takes the problem {name!r}; name it in an only=, or leave it out.")
    for many in campaign.ensembles:
        _ensemble(many, here[name_of(many.entry)][0].problem)
    for entry in campaign.entries():
        name = name_of(entry)
        _metrics(entry.within)
        if entry.end is not None:
            solutions.of_end(here[name][0].problem, entry.end)
        if not campaign.quick:  # which shortens the spans and keeps the grids
            _grid(entry.grid or campaign.grid, name, here[name])
    for goal in campaign.goals:
        _goal(goal, campaign, [item for name in goal.only or here for item in here[name]])


def _timing(plan: TimingPlan) -> None:
    if plan.shortest < SHORTEST:
        raise InputError(
            f"shortest={plan.shortest!r} of timing is too short for a clock to be trusted; give at least "
            f"{SHORTEST}: shorter runs are repeated."
        )
    if plan.front and plan.compilations < 2:
        raise InputError("front = true of timing needs compilations = 2 or more, the first of which tells.")


def _settings(method: MethodEntry) -> None:
    count = len(method.texts) * math.prod(map(len, method.sweep.values()))
    for place in method.quick:
        if not 0 <= place < count:
            raise InputError(
                f"quick={method.quick} of {method.texts[0]}: there is no setting {place}; there are {count}, "
                "counted from 0."
            )


def _ensemble(many: EnsembleEntry, problem: Problem) -> None:
    for method in many.methods:
        if method.only:
            raise InputError(
                f"only={method.only} of {method.texts[0]} stands in the ensemble of {many.problem}, whose "
                "methods are its own; leave it out."
            )
    known = problem.system.unpack(problem.par)
    for name in many.vary:
        if name not in known:
            raise unknown(f"parameter of {problem.system.name}", name, known)


def _series(page: Page, cases: Sequence[Resolved]) -> None:
    """Refuse a name that no series of these cases can have; what a method adds is not known yet."""
    asked = [name for name in page.series if not name.startswith(PREFIXES["extra"])]
    if not asked:
        return
    problems = {repr(case.problem): case.problem for case in cases}.values()
    known = {*PLAIN, PREFIXES["drift"] + "t"}
    for problem in problems:
        invariants, start = problem.system.invariants, problem.y0[None]
        known |= {PREFIXES[kind] + name for kind in ("errors", "drift") for name in invariants}
        known |= {PREFIXES["guards"] + name for name in problem.guards(start, np.array([problem.t0]))}
    for name in asked:
        if name not in known:
            raise unknown("series of the campaign's cases", name, sorted(known))


def _by_name(campaign: Campaign, cases: Sequence[Resolved]) -> dict[str, list[Resolved]]:
    """Return the cases by what a campaign calls their problems and ensembles."""
    cases_of: dict[str, list[Resolved]] = {}
    of_task = grouped_by(lambda case: Task.from_case(case.case), cases)
    for entry, task in tasks_of(campaign):  # two entries may be one task, as the spans of a quick run
        cases_of.setdefault(name_of(entry), []).extend(of_task.get(task, []))
    return cases_of


def _grid(grid: Grid, name: str, cases: Iterable[Resolved]) -> None:
    longest = max(abs(case.problem.t_end - case.problem.t0) for case in cases)
    lengths = {"step": [grid.step], "multiple_of": [grid.multiple_of], "also": grid.also}
    for key, given in lengths.items():
        for length in given:
            if length is not None and length > longest:
                raise InputError(
                    f"{key}={length!r} of the grid of {name} lies beyond its integration interval of length "
                    f"{longest!r}; make it smaller, or leave it out."
                )


def _metrics(keys: Iterable[str]) -> None:
    for metric in map(find, keys):
        if metric.better is None:
            raise InputError(
                f"the metric {metric.key!r} cannot be asked for: no side of it is the better one."
            )


def _goal(goal: Goal, campaign: Campaign, cases: Sequence[Resolved]) -> None:
    _metrics((goal.metric, *goal.within, *goal.no_worse))
    if goal.metric in TIMES and not campaign.timing.rounds:
        raise InputError(f"a goal asks for {goal.metric}, and timing has rounds = 0; take some.")
    if goal.at is not None and goal.no_worse:
        raise InputError("no_worse= of a goal belongs to against= and ratio=; with at= give within=.")
    _method("method of ours", goal.method, campaign.quick, [case for case in cases if is_ours(case.method)])
    if goal.ratio is not None:
        theirs = [case for case in cases if not is_ours(case.method)]
        _method("peer that the goal's problems have", goal.against, campaign.quick, theirs)


def _method(kind: str, name: str, quick: bool, cases: Sequence[Resolved]) -> None:
    """Refuse a name of which the goal's problems have no case; a quick run may lack the setting."""
    families = {parse_spec(case.case.method).name for case in cases}
    known = families | {case.case.method for case in cases}
    if not known:
        raise InputError(
            f"a goal's problems have no {kind.partition(' that')[0]}; give a method, or leave it out."
        )
    asked = parse_spec(name).name if quick and name else name
    if asked and asked not in known:
        raise unknown(kind, name, sorted(known))
