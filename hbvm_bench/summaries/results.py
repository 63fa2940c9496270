"""Stored results, read from Python."""

from pathlib import Path

from hbvm_bench.store.store import opened
from hbvm_bench.summaries import frame as frames
from hbvm_bench.summaries.frame import Frame
from integrators.protocol import Array
from problems.errors import InputError, shown


class Results:
    """What runs have stored; reading it runs nothing again.

    Parameters
    ----------
    *places : str or Path
        Runs, such as ``"runs/sitnikov"``, or reports, one after the other.

    Raises
    ------
    problems.errors.InputError
        If one of them holds no run.
    """

    def __init__(self, *places: str | Path) -> None:
        self._stores = opened([Path(place) for place in places])

    def frame(self, table: str = "cases") -> Frame:
        """Return a data frame of pandas.

        Parameters
        ----------
        table : {"cases", "timings", "series"}
            A row per case, with its metrics, settings, versions and times; per sample of the timing pass; or
            per number of its arrays.

        Raises
        ------
        problems.errors.InputError
            For another table.
        """
        return frames.frame(self._stores, table)

    def arrays(self, case: str) -> dict[str, Array]:
        """Return the arrays of a case by name: times ``t`` (n,), states ``y`` (n, dim), and what was checked.

        A report has those alone that its figures are drawn from.

        Parameters
        ----------
        case : str
            Its ``id`` in the frame of cases, or as much of its beginning as no other case shares.

        Raises
        ------
        problems.errors.InputError
            If there is no such case, or its arrays are damaged.
        """
        ids = {number: store for store in self._stores for number in store.index().ids}
        found = [number for number in ids if number.startswith(case)]
        if len(found) != 1:
            count = "no case has" if not found else f"{len(found)} cases have"
            raise InputError(f"{count} an id that begins with {shown(case)}; the frame of cases has all ids.")
        return ids[found[0]].series(found[0])
