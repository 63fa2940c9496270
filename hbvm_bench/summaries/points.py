"""Work against error: every setting a point, the best of every family an envelope."""

from collections.abc import Sequence
from dataclasses import dataclass

from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.measure.metrics import find
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.rows import group_of

WORKS = ("warm_seconds", "evaluations")
"""What an integration costs: the first that a run has is shown by default."""

ERRORS = ("position_end", "phase_end", "energy_max")
"""What it is good for; energy only ever beside one of the others."""


@dataclass(frozen=True)
class Point:
    """One setting of one method on one problem.

    Attributes
    ----------
    record : Record
        As stored.
    family : str
        Name of the method.
    work, error : float
        Both positive; an error of exactly 0 is not a point of a logarithmic plot and is
        left out.
    """

    record: Record
    family: str
    work: float
    error: float


def family_of(record: Record) -> str:
    """Return the family of a case: the name of its method."""
    return parse_spec(record.case.method).name


def problems_of(records: Sequence[Record]) -> list[str]:
    """Return the problems of a run that are no ensembles, in order."""
    return list(dict.fromkeys(r.case.problem for r in records if r.case.ensemble is None))


def number(record: Record, key: str) -> float | None:
    """Return a metric of a case that may be compared with others, else ``None``."""
    value = record.result.metrics.get(key)
    return value.value if value is not None and value.counts else None


def points(records: Sequence[Record], problem: str, work: str, error: str) -> list[Point]:
    """Return the points of a problem: cases that reached the end on the trajectory asked for.

    Parameters
    ----------
    records : sequence of Record
        Of a run.
    problem : str
        As it prints.
    work, error : str
        Keys of metrics, such as one of `WORKS` and one of `ERRORS`.

    Raises
    ------
    problems.errors.UnknownNameError
        For an unknown metric.
    """
    for key in (work, error):
        find(key)
    made: list[Point] = []
    for record in records:
        if record.case.problem != problem or record.case.ensemble or group_of(record) != "on":
            continue
        cost, wrong = number(record, work), number(record, error)
        if cost and wrong:
            made.append(Point(record, family_of(record), cost, wrong))
    return made


def envelope(points: Sequence[Point]) -> list[Point]:
    """Return the points that no other one beats in both work and error, by ascending work."""
    best: list[Point] = []
    for point in sorted(points, key=lambda p: (p.work, p.error)):
        if not best or point.error < best[-1].error:
            best.append(point)
    return best


def envelopes(records: Sequence[Record], problem: str, work: str, error: str) -> dict[str, list[Point]]:
    """Return the envelope of each family's best on a problem, families in the order of the run."""
    found = points(records, problem, work, error)
    families = dict.fromkeys(point.family for point in found)
    return {family: envelope([p for p in found if p.family == family]) for family in families}


def work_of(records: Sequence[Record]) -> str:
    """Return the key of the work to show: seconds where cases were timed, otherwise evaluations."""
    return next((key for key in WORKS if any(number(r, key) for r in records)), WORKS[-1])
