"""The computations of a study: what of them is missing in a store, and their runs, as those of cases."""

import hashlib
import platform
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgspec
from msgspec.structs import replace

from hbvm_bench.campaign import folder
from hbvm_bench.campaign.file import Campaign, Case
from hbvm_bench.campaign.identity import installed, kernel_digest, version_of
from hbvm_bench.run import executors
from hbvm_bench.run.executors import Pool
from hbvm_bench.run.loop import run_accuracy
from hbvm_bench.run.task import NO_RESULT, Computation, Request
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Store


def plan(campaign: Campaign, place: Path | None) -> list[Request]:
    """Return the computations that a campaign names, the long ones first; ``place`` is its file's folder."""
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
        )
        whole = code.copy()
        whole.update(msgspec.json.encode([asked.place, asked.key, asked.quick]))
        limits = replace(campaign.limits, wall_seconds=task.limit)
        row = Record(
            id=whole.hexdigest(),
            case=Case(problem="", method=task.key),
            role="ours",
            library="hbvm-bench",
            order=None,
            result=NO_RESULT,
            limits=limits,
            versions={"python": platform.python_version(), "hbvm-bench": version_of("hbvm-bench")},
            kernel=kernel_digest(),
        )
        planned.append(Request(rows=[row], limits=limits, computation=asked))
    return planned


def missing(planned: Sequence[Request], store: Store) -> list[Request]:
    """Return the computations without a result; those that failed are tried again."""
    stored = ((item, store.load(item.id)) for item in planned)
    return [item for item, record in stored if record is None or record.result.outcome != "ok"]


def run(
    planned: Sequence[Request], store: Store, pool: Pool, tell: Callable[[Sequence[Request]], None]
) -> Iterator[Record]:
    """Run computations side by side, then those that take times one by one here, and yield each row.

    Raises what `hbvm_bench.run.loop.run_accuracy` does.
    """
    together = [item for item in planned if not _is_timed(item)]
    yield from run_accuracy(together, store, pool, tell)
    if alone := [item for item in planned if _is_timed(item)]:
        with executors.opened(jobs=1) as single:
            yield from run_accuracy(alone, store, single, tell)


def _is_timed(request: Request) -> bool:
    return request.computation is not None and request.computation.timed
