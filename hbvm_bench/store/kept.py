"""A run in one file: what was asked for and all records, without the series; small enough to be published."""

from pathlib import Path

import msgspec

from hbvm_bench.store.files import atomic, ensure_writable
from hbvm_bench.store.records import SCHEMA, Record, decoded
from hbvm_bench.store.store import Index, Store
from problems.errors import InputError


class Kept(msgspec.Struct, frozen=True, kw_only=True):
    """A run.

    Attributes
    ----------
    index : Index
        What was asked for.
    records : list of Record
        What came out, in the order of the campaign.
    """

    index: Index
    records: list[Record]
    schema: int = SCHEMA

    @property
    def machine(self) -> dict[str, str | int]:
        """Where it was timed, or else measured."""
        timed = [one.timing.machine for one in self.records if one.timing is not None]
        return (timed or [one.machine for one in self.records])[0]

    @property
    def versions(self) -> dict[str, str]:
        """Of all libraries."""
        return {name: number for one in self.records for name, number in one.versions.items()}

    @property
    def started(self) -> str:
        """When the first of its cases had ended."""
        return min(one.finished for one in self.records)

    @property
    def command(self) -> str:
        """How to run it again."""
        return self.index.command


def of(store: Store, name: str, records: list[Record]) -> Kept:
    """Return the run of a campaign in a store, with records of it as `hbvm_bench.measure.reading` reads them.

    Raises
    ------
    problems.errors.InputError
        If there is none, or another campaign's.
    """
    index = store.index()
    if index.campaign.name != name:
        raise InputError(f"{str(store.directory)!r} has results of {index.campaign.name!r}, not of {name}.")
    if not records:
        raise InputError(
            f"the run in {str(store.directory)!r} has no finished case yet; run: {index.command}."
        )
    return Kept(index=index, records=records)


def keep(run: Kept, path: Path, name: str) -> None:
    """Write a run into one file, beside the problems in it that were not run this time.

    Those keep the machine, the versions, the command and the date that they were measured with.

    Raises
    ------
    problems.errors.InputError
        If the directory cannot be written, or what lies there is something else.
    """
    ensure_writable(path.parent)
    again = {one.case.problem for one in run.records}
    old = [
        msgspec.structs.replace(one, records=[kept for kept in one.records if kept.case.problem not in again])
        for one in load(path, name)
    ]
    with atomic(path) as temporary:  # in one line: a race has a thousand records
        temporary.write_bytes(msgspec.json.encode([*(one for one in old if one.records), run]))


def load(path: Path, name: str) -> list[Kept]:
    """Read runs of a campaign from one file, in the order in which they were measured; none without it.

    Raises
    ------
    problems.errors.InputError
        If the file is something else.
    """
    if not path.is_file():
        return []
    try:
        runs = decoded(path.read_bytes(), list[Kept])
    except (OSError, msgspec.MsgspecError, ValueError) as error:
        raise InputError(f"{str(path)!r} is not the result of {name}: {error}.") from None
    if any(one.schema != SCHEMA or one.index.campaign.name != name or not one.records for one in runs):
        raise InputError(f"{str(path)!r} was written by another version; run {name} again.")
    return runs
