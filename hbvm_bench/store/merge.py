"""Several runs, from one machine or many, as one."""

import functools
import operator
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import msgspec

from hbvm_bench.campaign.file import Campaign, Case
from hbvm_bench.store.store import Index, Store, progress
from problems.errors import InputError

T = TypeVar("T")


def merge(runs: Sequence[Store], out: Store) -> tuple[int, int, int]:
    """Write the cases of several runs into a new one.

    A case that several runs have, by its id, is taken from the run that is more
    complete (`hbvm_bench.store.store.progress`). The same case under other versions or sources has
    another id and stays a row of its own.

    Returns
    -------
    cases, records, left_out : int
        How many there are now, how many of them have run, and how many have only records that are
        damaged.

    Raises
    ------
    problems.errors.InputError
        If a directory holds no run, or ``out`` holds one.
    """
    if out.path.exists():
        raise InputError(f"{str(out.directory)!r} holds a run already; merge into a new directory.")
    indices = [run.index() for run in runs]
    cases: dict[str, Case] = {}
    for index in indices:
        for case_id, case in index.listed():
            cases.setdefault(case_id, case)
    out.prepare()
    with out.locked():
        written = left_out = 0
        for case_id in cases:
            copies = [(record, run) for run in runs if (record := run.load(case_id)) is not None]
            if copies:
                record, run = max(copies, key=lambda pair: progress(pair[0]))
                out.save(record, run.packed_series(case_id) or None)
                written += 1
            else:
                left_out += any(run.has(case_id) for run in runs)
        places = [shlex.quote(str(run.directory)) for run in runs]
        index = Index(
            campaign=_together([index.campaign for index in indices]),
            ids=list(cases),
            version=indices[-1].version,
            command=f"hbvm-bench merge {' '.join(places)} --out {shlex.quote(str(out.directory))}",
            cases=list(cases.values()),
        )
        out.write_index(index, functools.reduce(operator.or_, [run.known() for run in runs]))
    return len(cases), written, left_out


def stores(directories: Sequence[Path]) -> list[Store]:
    """Return the stores of at least two different directories."""
    if len({path.resolve() for path in directories}) < 2:
        raise InputError("merge needs two runs or more, as in: hbvm-bench merge runs/a runs/b --out runs/c.")
    return [Store(path) for path in directories]


def _together(campaigns: Sequence[Campaign]) -> Campaign:
    first = campaigns[0]
    if all(campaign == first for campaign in campaigns):
        return first

    def joined(texts: Sequence[str], glue: str) -> str:
        return glue.join(dict.fromkeys(text for text in texts if text))

    return msgspec.structs.replace(
        first,
        name=joined([c.name for c in campaigns], "-and-")[:64],
        title=joined([c.title for c in campaigns], "; "),
        description=joined([c.description for c in campaigns], "\n\n"),
        problems=_union([c.problems for c in campaigns]),
        methods=_union([c.methods for c in campaigns]),
        ensembles=_union([c.ensembles for c in campaigns]),
    )


def _union(lists: Sequence[Sequence[T]]) -> list[T]:
    union: list[T] = []
    for items in lists:
        union += [item for item in items if item not in union]
    return union
