"""A run as pages are made of it: what was asked for, and the results."""

from collections.abc import Sequence

import msgspec

from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Index


class StoredRun(msgspec.Struct, frozen=True, kw_only=True):
    """A run.

    Attributes
    ----------
    index : Index
        What was asked for.
    records : list of Record
        The results, in the order of the campaign.
    """

    index: Index
    records: list[Record]

    @property
    def machine(self) -> dict[str, str | int]:
        """Where it was timed, or else measured."""
        return self.machine_of(self.records)

    @staticmethod
    def machine_of(records: Sequence[Record]) -> dict[str, str | int]:
        """Return where records were timed, or else measured."""
        timed = [record.timing.machine for record in records if record.timing is not None]
        return (timed or [record.machine for record in records])[0]
