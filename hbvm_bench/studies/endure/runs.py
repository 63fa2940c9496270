"""The campaign that `endure` runs, and what its page is drawn from."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from hbvm_bench.campaign.file import Campaign, load
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.measure.starts import PERTURBATION
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Store
from problems.errors import InputError

Array = NDArray[np.float64]

NAME = "endure"
QUICK_YEARS = 1e4
QUICK_STARTS = 3
DECADES = (1e4, 1e5, 1e6)


@dataclass(frozen=True, eq=False)
class Endurance:
    """A run, for its page.

    Attributes
    ----------
    problem : str
        As it prints.
    years : float
        The span.
    starts : int
        Declared starts of each method.
    perturbation : float
        See `hbvm_bench.measure.starts`.
    campaign : Campaign
        As run.
    records : list of Record
        Of the methods, in order.
    t : ndarray, shape (n,)
        Sampling times after the start, in years.
    errors : dict of ndarray, shape (starts, n)
        Signed relative errors of the energy from each start that reached the end, by method.
    command, started
        How to run it again, and when it ran.
    """

    problem: str
    years: float
    starts: int
    perturbation: float
    campaign: Campaign
    records: list[Record]
    t: Array
    errors: dict[str, Array]
    command: str
    started: str

    @property
    def methods(self) -> list[str]:
        """The methods, as they print."""
        return [one.case.method for one in self.records]

    @property
    def machine(self) -> dict[str, str | int]:
        """Where it was timed."""
        timed = [one.timing.machine for one in self.records if one.timing is not None]
        return (timed or [one.machine for one in self.records])[0]

    @property
    def versions(self) -> dict[str, str]:
        """Of all libraries."""
        return {name: number for one in self.records for name, number in one.versions.items()}


def campaign(
    years: float | None = None, starts: int | None = None, methods: Sequence[str] | None = None
) -> Campaign:
    """Return the campaign with another span, other starts or methods than are declared.

    The goals are about a million years and are left out of shorter runs.
    """
    made = load(NAME)
    (entry,) = made.entries()
    if years is not None:
        made = replace(made, problems=[replace(entry, values={"years": years})])
        made = made if years >= DECADES[-1] else replace(made, goals=[])
    if starts is not None:
        made = replace(made, checks=replace(made.checks, starts=starts))
    if methods:
        made = replace(made, methods=[replace(made.methods[0], use=list(methods))])
    return made


def read(directory: Path) -> Endurance:
    """Read a run.

    Raises
    ------
    problems.errors.InputError
        If there is none, or another campaign's.
    """
    store = Store(directory)
    index = store.index()
    if index.campaign.name != NAME:
        raise InputError(f"{str(directory)!r} has results of {index.campaign.name!r}, not of {NAME}.")
    records = store.records()
    if not records:
        raise InputError(f"the run in {str(directory)!r} has no finished case yet; run: {index.command}.")
    series = {one.case.method: store.series(one.id) for one in records}
    problem = make_problem(records[0].case.problem)
    times = [one["drift.t"] for one in series.values() if "drift.t" in one]
    return Endurance(
        problem=records[0].case.problem,
        years=problem.t_end - problem.t0,
        starts=index.campaign.checks.starts,
        perturbation=PERTURBATION,
        campaign=index.campaign,
        records=records,
        t=times[0] if times else np.empty(0),
        errors={method: one["drift.energy"] for method, one in series.items() if "drift.energy" in one},
        command=index.command,
        started=min(one.finished for one in records),
    )
