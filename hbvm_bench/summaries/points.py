"""What every summary reads off the cases: families, problems, numbers, and which settings nothing beats."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeVar

from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.rows import grouped_by, reached, tasks

T = TypeVar("T")

WORKS = ("warm_seconds", "evaluations")
"""What an integration costs: the first that a run has is shown by default."""


def short_name(problem: str) -> str:
    """Return a problem as readers know it: of one in a campaign's Python file, without that file."""
    return re.sub(r"^[^:()]*\.py(@\w+)?:", "", problem)


PROJECTION = "HBVM(projection='energy')"
"""The family of HBVM with its energy projected: no energy-conserving method, so none of HBVM's settings."""


def family_of(record: Record) -> str:
    """Return the family of a case: the name of its method, or `PROJECTION`."""
    return family_named(record.case.method)


def family_named(method: str) -> str:
    """Return the family of a method, as it prints."""
    spec = parse_spec(method)
    return PROJECTION if spec.name == "HBVM" and spec.arguments.get("projection") else spec.name


def is_hbvm_or_gauss(record: Record) -> bool:
    """Whether a case counts for HBVM and Gauss: it is one of this project's, and no projection."""
    return record.role == "ours" and family_of(record) != PROJECTION


def by_problem(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Return the cases that are no ensembles, problem by problem, in order; one with two grids is two."""
    tasks_ = tasks(singles(records))
    return {task.problem + task.sampled(tasks_): members for task, members in tasks_.items()}


def by_family(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Return cases family by family, in order."""
    return grouped_by(family_of, records)


def singles(records: Sequence[Record]) -> list[Record]:
    """Return the cases that are no ensembles."""
    return [record for record in records if record.case.ensemble is None]


def number(record: Record, key: str) -> float | None:
    """Return a metric of a case that may be compared with others, else ``None``."""
    value = record.result.metrics.get(key)
    return value.value if value is not None and value.counts else None


def accurate(record: Record, within: Mapping[str, float]) -> bool:
    """Whether a case reached its end, with errors at most these."""
    if not reached(record):
        return False
    errors = [(number(record, key), bound) for key, bound in within.items()]
    return all(error is not None and error <= bound for error, bound in errors)


def pareto_front(items: Iterable[T], place: Callable[[T], tuple[float, float]]) -> list[T]:
    """Return what nothing else beats in both work and error, by ascending work; ``place`` gives the two."""
    best: list[T] = []
    least = math.inf
    for item in sorted(items, key=place):
        if place(item)[1] < least:
            best.append(item)
            least = place(item)[1]
    return best


def work_of(records: Sequence[Record]) -> str:
    """Return the key of the work to show: seconds where cases were timed, otherwise evaluations."""
    return next((key for key in WORKS if any(number(r, key) for r in records)), WORKS[-1])
