"""Everything a report says, gathered once and printed twice: as markdown and as a page."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from hbvm_bench import reference as references
from hbvm_bench.identity import make_problem
from hbvm_bench.metrics import METRICS, Metric
from hbvm_bench.quantities import PLANETOID_Z
from hbvm_bench.records import Record
from hbvm_bench.reference import Reference
from hbvm_bench.report import figures, views, words
from hbvm_bench.report.canvas import Picture, drawing
from hbvm_bench.report.figures import Drawn, OverTime
from hbvm_bench.report.style import Look, looks
from hbvm_bench.store import Store
from hbvm_bench.table import GROUPS, Row, columns, rows
from problems.problem import Problem

Array = NDArray[np.float64]

# Machine code of the libraries: what the times were made with.
BUILT = {
    "hbvm-bench": "compiled on this machine by numba",
    "heyoka": "compiled on this machine by LLVM",
    "diffrax": "compiled on this machine by XLA",
    "rebound": "generic wheel",
    "scipy": "generic wheel; vector field compiled on this machine by numba",
}


@dataclass(frozen=True)
class Section:
    """One problem's part of the report.

    Attributes
    ----------
    problem : Problem
        What was integrated.
    summary, shortcomings : list of str
        Sentences.
    columns : list of Metric
        Of the table.
    groups : list of (str, list of Row)
        The table, each group with its title.
    missing : int
        Cases of the campaign that have not run.
    pictures : list of Picture
        In order.
    reference : Reference or None
        The trusted solution.
    truth : list of (str, str)
        Its values that the table's readers want beside it.
    """

    problem: Problem
    summary: list[str]
    shortcomings: list[str]
    columns: list[Metric]
    groups: list[tuple[str, list[Row]]]
    missing: int
    pictures: list[Picture]
    reference: Reference | None
    truth: list[tuple[str, str]]


@dataclass(frozen=True)
class Content:
    """A whole report.

    Attributes
    ----------
    title, description, command, version
        Of the campaign.
    measured : str
        The days on which the cases ran.
    sections : list of Section
        Problem by problem.
    looks : dict of Look
        By case id.
    rules : tuple of str
        Of a fair comparison.
    settings : list
        See `words.settings_count`.
    versions, machine : list of (str, str)
        What it ran on.
    metrics : list of Metric
        All, with their descriptions.
    references : list of str
        Where problems come from.
    """

    title: str
    description: str
    command: str
    version: str
    measured: str
    sections: list[Section]
    looks: dict[str, Look]
    rules: tuple[str, ...]
    settings: list[tuple[str, str, dict[str, int]]]
    versions: list[tuple[str, str]]
    machine: list[tuple[str, str]]
    metrics: list[Metric]
    references: list[str]


def gather(store: Store) -> Content:
    """Read a store and make everything a report says.

    Raises
    ------
    problems.errors.InputError
        If the directory holds no run.
    """
    index = store.index()
    records = store.records()
    look = looks(records)
    texts = list(dict.fromkeys(record.case.problem for record in records))
    planned = len(index.ids) // max(1, len(index.campaign.problems))
    sections = [
        _section(text, [r for r in records if r.case.problem == text], store, look, planned, number)
        for number, text in enumerate(texts, 1)
    ]
    return Content(
        title=index.campaign.title or index.campaign.name,
        description=" ".join(index.campaign.description.split()),
        command=index.command,
        version=index.version,
        measured=_days(records),
        sections=sections,
        looks=look,
        rules=words.RULES,
        settings=words.settings_count(records[: planned or None]),
        versions=_versions(records),
        machine=_machine(records),
        metrics=list(METRICS.values()),
        references=list(dict.fromkeys(ref for s in sections for ref in s.problem.references)),
    )


def _section(
    text: str, records: list[Record], store: Store, look: dict[str, Look], planned: int, number: int
) -> Section:
    problem = make_problem(text)
    known = references.find(problem)
    cases = [Drawn(record, look[record.id], store.series(record.id)) for record in records]
    drawn = [case for case in cases if "t" in case.series and case.series["t"].size]
    table = rows(records)
    return Section(
        problem=problem,
        summary=words.summary(records),
        shortcomings=words.shortcomings(records),
        columns=columns(records),
        groups=[
            (title, [row for row in table if row.group == key])
            for key, title in GROUPS.items()
            if any(row.group == key for row in table)
        ],
        missing=planned - len(records),
        pictures=_pictures(problem, drawn, known, number),
        reference=known,
        truth=_truth(problem, known),
    )


def _pictures(
    problem: Problem, cases: Sequence[Drawn], known: Reference | None, number: int
) -> list[Picture]:
    with drawing():
        made = [figures.work_precision(cases)]
        made += [figures.over_time(cases, what) for what in OVER_TIME]
        made += [view(problem, cases, known) for view in views.VIEWS.get(problem.name or "", ())]
        made.append(views.step_sizes(cases))
    suffix = "" if number == 1 else f"-{number}"  # file names and anchors are unique in a report
    return [replace(picture, key=picture.key + suffix) for picture in made if picture is not None]


OVER_TIME = (
    OverTime(
        key="energy",
        title="Energy error over time",
        caption="Relative error of the energy. A line is the largest value in each of "
        f"{figures.BINS} spans of time. † lost the symmetry, ‡ did not reach the end.",
        label="|H − H₀| / |H₀|",
        get=lambda series: _pair(series, "t", "error.energy"),
        low=-17,
        high=2,
    ),
    OverTime(
        key="position",
        title="Position error over time",
        caption="Largest distance of a body from the stored 128-bit reference, at the reference's times.",
        label="position error",
        get=lambda series: _pair(series, "position_t", "position"),
        low=-17,
        high=4,
        joined=False,
    ),
    OverTime(
        key="angular-momentum",
        title="Angular momentum error over time",
        caption="2-norm of the error of the angular momentum vector, relative to its length.",
        label="|L − L₀| / |L₀|",
        get=lambda series: _pair(series, "t", "error.angular_momentum"),
        low=-17,
        high=2,
    ),
    OverTime(
        key="symmetry",
        title="Off-axis distance over time",
        caption="What the problem's symmetry keeps at exactly 0. Lines at the lower edge are exactly 0; "
        "what is smaller than the lowest power is drawn just above it.",
        label="distance from the axis",
        get=lambda series: _guard(series),
        low=-24,
        high=4,
        zero=True,
    ),
    OverTime(
        key="distance",
        title="Largest distance from the origin over time",
        caption="Shows what escaped, and when.",
        label="largest distance",
        get=lambda series: _pair(series, "t", "distance"),
        low=0,
        high=5,
    ),
)


def _pair(series: dict[str, Array], t: str, values: str) -> tuple[Array, Array] | None:
    return (series[t], series[values]) if values in series and series[t].size else None


def _guard(series: dict[str, Array]) -> tuple[Array, Array] | None:
    names = [name for name in series if name.startswith("guard.")]
    return (series["t"], series[names[0]]) if names else None


def _truth(problem: Problem, known: Reference | None) -> list[tuple[str, str]]:
    if known is None:
        return []
    made = known.provenance
    text = f"{made.get('method', '')}, version {made.get('heyoka', '')}; {made.get('check', '')}"
    floor = problem.errors(known.high, known.t)
    least = ", ".join(
        f"{name.replace('_', ' ')} {np.max(floor[name]):.1e}"
        for name in ("energy", "angular_momentum")
        if name in floor
    )
    values = [("Reference", text)]
    if least:
        values.append(
            ("Errors of the reference itself once rounded to doubles, the least a run can show", least)
        )
    if problem.name == "sitnikov" and known.t[-1] == problem.t_end:
        z = known.high[-1, PLANETOID_Z]
        values.insert(0, (f"Reference value of z at t = {problem.t_end:g}", f"{z:.16g}"))
    return values


def _days(records: Sequence[Record]) -> str:
    days = sorted({datetime.fromisoformat(r.finished).date().isoformat() for r in records if r.finished})
    return "" if not days else days[0] if days[0] == days[-1] else f"{days[0]} to {days[-1]}"


def _versions(records: Sequence[Record]) -> list[tuple[str, str]]:
    found: dict[str, set[str]] = {}
    for record in records:
        for name, number in record.versions.items():
            found.setdefault(name, set()).add(number)
    built = {name.lower(): words_ for name, words_ in BUILT.items()}
    return [
        (name, ", ".join(sorted(numbers)) + (f" ({built[name.lower()]})" if name.lower() in built else ""))
        for name, numbers in sorted(found.items())
    ]


def _machine(records: Sequence[Record]) -> list[tuple[str, str]]:
    different = {tuple(sorted((k, str(v)) for k, v in record.machine.items())) for record in records}
    if len(different) != 1:
        return [("machines", f"{len(different)} different ones; see the records")]
    return [(name.replace("_", " "), value) for name, value in sorted(different.pop())]
