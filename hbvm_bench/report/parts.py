"""The parts of a study's page that are made of computations: what each computes, claims and shows."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from hbvm_bench.measure.computation import VALUE, Task, unpacked
from hbvm_bench.report.document import Block, Claim, Claims, Maker, Section, attempt
from hbvm_bench.report.page import Results
from hbvm_bench.store.records import Record
from problems.errors import InputError


@dataclass(frozen=True)
class Part:
    """One of the experiments of a study, with its name in the store and its heading."""

    key: str
    title: str
    runs: Sequence[Task]
    claims: Callable[["PartResults"], list[Claim]]  # published values and computed ones
    blocks: Callable[["PartResults"], list[Maker]]  # what makes each block that is shown

    @property
    def tasks(self) -> list[Task]:
        """The computations under the names by which they are stored: those of all parts lie side by side."""
        return [replace(task, key=f"{self.key}/{task.key}") for task in self.runs]


class PartResults:
    """What the computations of a part returned, by their names; asking for one that failed says why.

    What `hbvm_bench.measure.computation.split` divided is put together again. ``records`` are the cases of
    the run, by method.
    """

    def __init__(self, part: Part, results: Results) -> None:
        self.part, self.computed = part.key, results.computed
        self.records: Mapping[str, Record] = {record.case.method: record for record in results.records}
        self.tasks = {task.key: task for task in part.tasks}
        self.read: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        key = f"{self.part}/{name}"
        if key not in self.read:
            whole = key in self.tasks
            pieces = [] if whole else [p for p in self.tasks if re.fullmatch(rf"{re.escape(key)} \d+", p)]
            rows = [row for piece in pieces for row in self._result(piece)]
            self.read[key] = rows if pieces else self._result(key)
        return self.read[key]

    def outcome(self, name: str) -> str:
        """Return how a computation ended: ``"ok"``, ``"timeout"``, ...; ``""`` where it was not run."""
        key = f"{self.part}/{name}"
        return self.computed[key][0].result.outcome if key in self.computed else ""

    def each(self, name: str, values: Iterable[Any]) -> dict[Any, Any]:
        """Return what the tasks of `hbvm_bench.measure.computation.each` returned, by their values."""
        return {value: self[f"{name} {value}"] for value in values}

    def _result(self, key: str) -> Any:
        if key not in self.computed:
            raise InputError(f"the computation {key!r} was not run.")
        record, arrays = self.computed[key]
        if record.result.outcome != "ok":
            raise InputError(f"the computation {key!r} {record.result.reason or record.result.outcome}.")
        return unpacked(arrays[VALUE], self.tasks[key].run)


def tasks_of(parts: Sequence[Part]) -> list[Task]:
    """Return the computations of all parts."""
    return [task for part in parts for task in part.tasks]


def claims_of(parts: Sequence[Part], results: Results, title: str, nav: str, given: str = "paper") -> Section:
    """Return every claim of the parts with the published value, called ``given``, and the computed one."""

    def claims(part: Part) -> Claims:
        return Claims([(part.title, part.key, part.claims(PartResults(part, results)))])

    blocks = attempt(*((f"the claims of {part.title}", partial(claims, part)) for part in parts))
    groups = [group for block in blocks if isinstance(block, Claims) for group in block.groups if group[2]]
    failed: list[Block] = [block for block in blocks if not isinstance(block, Claims)]
    return Section(title, [Claims(groups, given), *failed], "all-claims", nav=nav)


def sections_of(parts: Sequence[Part], results: Results) -> list[Section]:
    """Return the section of each part of which anything was computed: results may be older than a part."""
    return [
        Section(part.title, attempt(*part.blocks(PartResults(part, results))), part.key, nav=part.title)
        for part in parts
        if any(task.key in results.computed for task in part.tasks)
    ]
