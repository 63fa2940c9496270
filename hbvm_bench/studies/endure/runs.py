"""The campaign that `endure` runs, and what is read off its trajectories: errors, laws, times, goals."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from hbvm_bench.campaign.file import Campaign, load
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.measure import drift, reading
from hbvm_bench.measure.starts import PERTURBATION
from hbvm_bench.store import kept
from hbvm_bench.store.kept import Kept
from hbvm_bench.store.records import Law
from hbvm_bench.store.store import Store
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.goals import Verdict, verdicts
from hbvm_bench.summaries.points import number

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
    run : Kept
        What was asked for, and the records.
    t : ndarray, shape (n,)
        Sampling times after the start, in years.
    errors : dict of ndarray, shape (starts, n)
        Signed relative errors of the energy from each start that reached the end, by method.
    """

    run: Kept
    t: Array
    errors: dict[str, Array]
    perturbation: float = PERTURBATION

    @property
    def problem(self) -> str:
        """The problem, as it prints."""
        return self.run.records[0].case.problem

    @property
    def years(self) -> float:
        """The span."""
        problem = make_problem(self.problem)
        return problem.t_end - problem.t0

    @property
    def starts(self) -> int:
        """Declared starts of each method."""
        return self.run.index.campaign.checks.starts

    @property
    def methods(self) -> list[str]:
        """The methods, as they print."""
        return [one.case.method for one in self.run.records]


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
    run = kept.of(store, NAME, reading.records(store))
    series = {one.case.method: store.series(one.id) for one in run.records}
    times = [one["drift.t"] for one in series.values() if "drift.t" in one]
    return Endurance(
        run,
        t=times[0] if times else np.empty(0),
        errors={method: one["drift.energy"] for method, one in series.items() if "drift.energy" in one},
    )


@dataclass(frozen=True)
class Line:
    """One method.

    Attributes
    ----------
    method : str
        As it prints.
    starts, failed : int
        Trajectories that finished and that did not.
    rms : dict of float to float
        Root mean square over the starts of the relative energy error, by time in years.
    drift : Law or None
        Of its error; ``None`` without a finished trajectory.
    seconds : float or None
        Median of the trajectories.
    times_ours : float or None
        Seconds over ours.
    """

    method: str
    starts: int
    failed: int
    rms: dict[float, float]
    drift: Law | None
    seconds: float | None
    times_ours: float | None


def lines(result: Endurance) -> list[Line]:
    """Return one line per method, in the order of declaration."""
    ours = standings.best(standings.among(result.run.records, ""), {})
    years = sorted({*DECADES, result.years}.intersection(result.t.tolist()))
    made = []
    for record in result.run.records:
        errors = result.errors.get(record.case.method, np.empty((0, 0)))
        rms = drift.rms(errors[:, np.isin(result.t, years)]).tolist() if errors.size else []
        ratio = standings.compare(ours, record).ratio
        made.append(
            Line(
                method=record.case.method,
                starts=len(errors),
                failed=max(result.starts, 1) - len(errors),
                rms=dict(zip(years, rms, strict=False)),
                drift=record.result.laws.get("energy") if errors.size else None,
                seconds=number(record, standings.TIME),
                times_ours=ratio.median if ratio else None,
            )
        )
    return made


def goals(result: Endurance) -> list[Verdict]:
    """Return the verdicts on what was asked for; none for a span short of a million years."""
    return verdicts(result.run.index.campaign, result.run.records)
