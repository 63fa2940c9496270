"""Endurance: its campaign, what its trajectories give (errors, growth, times, goals), and its page."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from hbvm_bench.campaign.file import Campaign, load
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.measure import drift, machine
from hbvm_bench.measure.starts import PERTURBATION
from hbvm_bench.report.document import Note, Section
from hbvm_bench.report.figures.canvas import Picture, log_axis, new, picture, styled
from hbvm_bench.report.figures.style import MUTED, Look
from hbvm_bench.report.page import Results
from hbvm_bench.report.provenance import again
from hbvm_bench.store.records import ErrorGrowth
from hbvm_bench.store.stored_run import StoredRun
from hbvm_bench.summaries import outcomes, standings
from hbvm_bench.summaries.goals import Verdict, verdicts
from hbvm_bench.summaries.goals import table as goals_table
from hbvm_bench.summaries.growth import clear, power_of
from hbvm_bench.summaries.points import number
from hbvm_bench.summaries.rows import seconds
from hbvm_bench.summaries.table import NONE, Table

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
    run : StoredRun
        What was asked for, and the records.
    t : ndarray, shape (n,)
        Sampling times after the start, in years.
    errors : dict of ndarray, shape (starts, n)
        Signed relative errors of the energy from each start that reached the end, by method.
    """

    run: StoredRun
    t: Array
    errors: dict[str, Array]

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
        return [record.case.method for record in self.run.records]


def campaign(
    years: float | None = None, starts: int | None = None, methods: Sequence[str] | None = None
) -> Campaign:
    """Return the campaign with another span, other starts or methods than are declared.

    The goals are about a million years and are left out of shorter runs.
    """
    loaded = load(NAME)
    (entry,) = loaded.entries()
    if years is not None:
        loaded = replace(loaded, problems=[replace(entry, values={"years": years})])
        loaded = loaded if years >= DECADES[-1] else replace(loaded, goals=[])
    if starts is not None:
        loaded = replace(loaded, checks=replace(loaded.checks, starts=starts))
    if methods:
        loaded = replace(loaded, methods=[replace(loaded.methods[0], use=list(methods))])
    return loaded


def measured_last(results: Results) -> Endurance:
    """Return the run that was measured last."""
    run = results.runs[-1]
    series = {record.case.method: results.series.get(record.id, {}) for record in run.records}
    times = [record["drift.t"] for record in series.values() if "drift.t" in record]
    return Endurance(
        run,
        t=times[0] if times else np.empty(0),
        errors={
            method: record["drift.energy"] for method, record in series.items() if "drift.energy" in record
        },
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
        Root mean square over the initial conditions of the relative energy error, by time in years.
    drift : ErrorGrowth or None
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
    drift: ErrorGrowth | None
    seconds: float | None
    times_ours: float | None


def lines(result: Endurance) -> list[Line]:
    """Return one line per method, in the order of declaration."""
    ours = standings.best(standings.among(result.run.records, ""), {})
    years = sorted({*DECADES, result.years}.intersection(result.t.tolist()))
    result_lines = []
    for record in result.run.records:
        errors = result.errors.get(record.case.method, np.empty((0, 0)))
        rms = drift.rms(errors[:, np.isin(result.t, years)]).tolist() if errors.size else []
        ratio = standings.compare(ours, record, chosen=True).ratio
        result_lines.append(
            Line(
                method=record.case.method,
                starts=len(errors),
                failed=max(result.starts, 1) - len(errors),
                rms=dict(zip(years, rms, strict=False)),
                drift=clear(record.result.growth["energy"])
                if errors.size and "energy" in record.result.growth
                else None,
                seconds=number(record, standings.TIME),
                times_ours=ratio.median if ratio else None,
            )
        )
    return result_lines


def goals(result: Endurance) -> list[Verdict]:
    """Return the verdicts on what was asked for; none for a span short of a million years."""
    return verdicts(result.run.index.campaign, result.run.records)


METHOD = """
The methods run one after the other from each initial condition, in one process on one core. The energy is
evaluated in double-double arithmetic at whole years, spaced evenly in log time, at ends of steps or in a way
that does not change the steps. The time of a trajectory contains these few samples and no compilation. Error
growth: a floor and a power of t are fitted together to the logarithm of the rms over time windows
(`hbvm_bench.measure.drift`).
"""


def about(results: Results) -> str:
    """Return what was run."""
    result = measured_last(results)
    return (
        f"`{result.problem}` from {result.starts} initial conditions: the problem's, and others in which "
        f"every position and momentum is changed by up to {PERTURBATION} of itself "
        "(`hbvm_bench.measure.starts`)."
    )


def measured_on(results: Results) -> Note:
    """Return on what machine, and what else it did."""
    run = measured_last(results).run
    return Note(
        " ".join(
            [
                machine.sentence(run.machine),
                *outcomes.compilations(run.records),
                *outcomes.beside(run.records),
            ]
        )
    )


def errors_and_goals(results: Results) -> list[Table]:
    """Return the tables: the errors with their growth, and the goals."""
    return tables(measured_last(results))


def energy_over_time(results: Results) -> Picture | None:
    """Draw the rms over the initial conditions against time."""
    return over_time(measured_last(results), results.look)


def how(results: Results) -> Note:
    """Return how it is measured."""
    del results
    return Note(METHOD)


def run_again(results: Results) -> Section:
    """Return the command, and what was measured with what."""
    run = measured_last(results).run
    return again(run.command, run.started[:10], run.machine, run.versions)


def tables(result: Endurance) -> list[Table]:
    """Return the tables: the errors with their growth, and the goals."""
    shown = lines(result)
    years = sorted({year for line in shown for year in line.rms})
    rows = []
    for line in shown:
        growth = line.drift
        rows.append(
            (
                line.method,
                f"{line.starts}" + (f", {line.failed} failed" if line.failed else ""),
                *(f"{line.rms[year]:.1e}" if year in line.rms else NONE for year in years),
                NONE if growth is None else _named(growth),
                NONE if growth is None or not growth.kind else power_of(growth),
                NONE if growth is None or growth.mean is None else _mean(growth),
                NONE if growth is None or growth.rate is None else _rate(growth),
                NONE if line.seconds is None else seconds(line.seconds),
                NONE if line.times_ours is None else f"{line.times_ours:.3g}",
            )
        )
    heads = tuple(f"{year:g}" for year in years)
    after = ("growth", "power of t", "mean", "a year", "time", "× HBVM and Gauss")
    tables_ = [
        Table(
            f"Relative energy error over {result.years:g} years",
            ("method", "starts", *heads, *after),
            rows,
            "rms over the initial conditions, after so many years. Mean: over the initial conditions at "
            "the end, with its standard error, after the offset of each was subtracted. "
            + (f"{drift.told(result.starts)}, whatever the power of t. " if result.starts > 1 else "")
            + (
                "Power of t and drift per year with 95 % intervals over the initial conditions. Time: "
                "median of one trajectory."
            )
            + drift.uncertainty(result.starts),
            words=(0, 2 + len(heads)),
            groups=(("", 2), ("rms", len(heads)), ("", 2), ("drift", 2), ("", 2)),
        )
    ]
    if asked := goals(result):
        tables_.append(goals_table(asked))
    return tables_


def _named(growth: ErrorGrowth) -> str:
    if growth.kind is None:
        return growth.why
    return "grows" if growth.kind == "power" else drift.KINDS[growth.kind]


def _mean(growth: ErrorGrowth) -> str:
    """Return the mean over the initial conditions with its standard error and the count of signs."""
    spread = "" if growth.mean_error is None else f" ± {growth.mean_error:.1e}"
    return f"{growth.mean:+.1e}{spread} ({growth.positive} of {growth.starts} positive)"


def _rate(growth: ErrorGrowth) -> str:
    """Return the mean drift per year with its interval, which one start does not have."""
    bare = growth.rate_low is None or growth.rate_high is None
    return f"{growth.rate:+.1e}" + ("" if bare else f" ({growth.rate_low:+.1e} to {growth.rate_high:+.1e})")


@styled
def over_time(result: Endurance, look: Mapping[str, Look]) -> Picture | None:
    """Draw the rms over the trajectories against time, with each of them behind it; ``None`` without any."""
    t = result.t
    shown = [(method, errors) for method, errors in result.errors.items() if errors.size]
    if not shown:
        return None
    values = np.array([drift.rms(errors) for _, errors in shown])
    positive = values[values > 0.0]
    low = math.floor(math.log10(positive.min())) if positive.size else -17
    high = math.ceil(math.log10(positive.max())) if positive.size else -14
    figure = new(8.4, 5.0)
    axes = figure.subplots()
    figure.subplots_adjust(left=0.08, right=0.94, top=0.94, bottom=0.1)
    log_axis(axes, "x", math.floor(math.log10(t[0])), math.ceil(math.log10(t[-1])))
    log_axis(axes, "y", low, max(high, low + 1))
    line_of = {line.method: line for line in lines(result)}
    for (method, errors), rms in zip(shown, values, strict=True):
        colour, dash = look[method].light, look[method].dash
        for row in np.abs(errors):
            axes.plot(t, np.where(row > 0.0, row, np.nan), color=colour, linewidth=0.4, alpha=0.18)
        axes.plot(
            t,
            rms,
            color=colour,
            dashes=dash or (None, None),
            marker=look[method].marker,
            markevery=24,
            markersize=5,
            linewidth=1.6,
            label=method,
        )
    guide = t[t >= t[-1] / 1e3]
    axes.plot(guide, 10.0 ** (low + 0.4) * np.sqrt(guide / guide[0]), color=MUTED, linewidth=0.8)
    axes.annotate(" √t", (guide[-1], 10.0 ** (low + 0.4) * math.sqrt(guide[-1] / guide[0])), color=MUTED)
    title = "relative energy error, root mean square over the initial conditions"
    axes.set(xlabel="years", title=title)
    axes.legend(loc="upper left", handlelength=4.5)
    said = "; ".join(
        f"{line.method}: {', '.join(f'{value:.1e} at {year:g} years' for year, value in line.rms.items())}"
        for line in line_of.values()
    )
    return picture(
        figure,
        "endure",
        "Energy error of the outer Solar System over time",
        "Thick: root mean square over the initial conditions; thin: each of them. The grey line grows like "
        "the square root of time, as unbiased rounding errors do.",
        said,
    )
