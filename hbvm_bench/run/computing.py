"""The computations of a study: what of them is missing in a store, and their runs, as those of cases."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgspec

from hbvm_bench.campaign import folder
from hbvm_bench.campaign.file import Campaign, Case
from hbvm_bench.campaign.identity import installed
from hbvm_bench.run import executors
from hbvm_bench.run.executors import Pool
from hbvm_bench.run.loop import run_accuracy
from hbvm_bench.run.task import Planned
from hbvm_bench.run.worker import Computation
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Store


def plan(campaign: Campaign, place: Path | None) -> list[Planned]:
    """Return the computations that a campaign names, the long ones first; ``place`` is its file's folder.

    Raises
    ------
    problems.errors.InputError
        If there is no such function beside the campaign's file.
    """
    if not campaign.computes:
        return []
    tasks = folder.named(campaign.computes, place)(campaign.quick)
    assert place is not None
    code = hashlib.sha256((installed() + folder.digest(place)).encode())
    planned = []
    for task in sorted(tasks, key=lambda task: -task.cost):
        asked = Computation(
            folder=str(place.resolve()),
            place=campaign.computes,
            key=task.key,
            quick=campaign.quick,
            timed=task.timed,
            limit=task.limit,
        )
        whole = code.copy()
        whole.update(msgspec.json.encode([asked.place, asked.key, asked.quick]))
        planned.append(Planned(Case(problem="", method=task.key), whole.hexdigest(), asked))
    return planned


def missing(planned: Sequence[Planned], store: Store) -> list[Planned]:
    """Return the computations without a result; those that failed are tried again."""
    stored = ((item, store.load(item.id)) for item in planned)
    return [item for item, record in stored if record is None or record.result.outcome != "ok"]


def run(
    planned: Sequence[Planned],
    store: Store,
    campaign: Campaign,
    pool: Pool,
    tell: Callable[[Sequence[Planned]], None],
) -> Iterator[Record]:
    """Run computations side by side, then those that take times one by one here, and yield each row.

    Raises what `hbvm_bench.run.loop.run_accuracy` does.
    """
    together = [item for item in planned if not item.computation.timed]
    yield from run_accuracy(together, store, campaign.limits, pool, tell)
    if alone := [item for item in planned if item.computation.timed]:
        with executors.opened(jobs=1) as single:
            yield from run_accuracy(alone, store, campaign.limits, single, tell)
