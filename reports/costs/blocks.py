"""The page on costs, from stored results alone."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median

from hbvm_bench.campaign.spec import Spec
from hbvm_bench.measure.computation import Task
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.measure.timing import Spread
from hbvm_bench.report.document import Maker, Note, Section, attempt
from hbvm_bench.report.page import Results
from hbvm_bench.report.parts import Part, PartResults, sections_of, tasks_of
from hbvm_bench.store.records import OTHER_WORK, Record
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.goals import other_work, ratio_text
from hbvm_bench.summaries.points import family_of
from hbvm_bench.summaries.rows import format_metric, grouped_by, status_of
from hbvm_bench.summaries.table import NONE, Table
from integrators.methods.hbvm import HBVM

from . import experiments, gradients, threads, variations
from .beside_c import ECCENTRICITY, IN_C, OURS, SOURCE, STEP, BesideC, beside_c
from .experiments import CALLED, FIRST, ON_LATTICES, STEPPED, Iterations, Times

DEFAULT = "HBVM()"
METRICS = ("warm_seconds", "steps", "evaluations", "energy_max", "position_end")
SIZES, QUICK_SIZES = (10, 100, 1000, 4000), (10, 100)
ROUNDS, QUICK_ROUNDS = 40, 3
FEW, QUICK_FEW = 7, 1  # rounds of longer runs
FRESH, QUICK_FRESH = 3, 1
C_STEPS, QUICK_C_STEPS = 100_000, 2_000  # long enough for the overhead of a call, some 50 µs, not to count
LATTICE_END, QUICK_END = 10.0, 2.0


@dataclass(frozen=True)
class Ratio:
    """A setting's time relative to that of `DEFAULT` on one problem, and whether it is judged.

    Attributes
    ----------
    record, default : Record
        Both cases.
    spread : Spread or None
        Of the ratio within each round; ``None`` where one of them was not timed.
    """

    record: Record
    default: Record
    spread: Spread | None

    @classmethod
    def from_records(cls, record: Record, default: Record) -> "Ratio":
        """Compare a case with that of the default on the same problem."""
        return cls(record, default, standings.compare(default, record).ratio)

    @property
    def busy(self) -> str:
        """Why it is not judged; empty otherwise."""
        return other_work([self.record, self.default])

    @property
    def verdict(self) -> str:
        """Whether the setting takes less time than the default, by the quartiles of the ratio."""
        spread = self.spread
        if spread is None:
            return next((status_of(case) for case in (self.record, self.default) if not case.timing), NONE)
        if self.busy:
            return f"not judged: {self.busy}"
        if spread.low is None or spread.high is None:
            return NONE
        return "less time" if spread.high < 1.0 else "more time" if spread.low > 1.0 else "no difference"


def parts(*, quick: bool) -> list[Part]:
    """Return what is computed and shown beside the cases, in a quick run or a whole one."""
    sizes, t_end = (QUICK_SIZES, QUICK_END) if quick else (SIZES, LATTICE_END)
    rounds, few, fresh = (QUICK_ROUNDS, QUICK_FEW, QUICK_FRESH) if quick else (ROUNDS, FEW, FRESH)
    c_task = Task("times", partial(beside_c, QUICK_C_STEPS if quick else C_STEPS, rounds), timed=True)
    lattices = [Task(f"of {n}", partial(experiments.iterations, n, t_end), cost=n / 100) for n in sizes]

    def on_lattices(results: PartResults) -> list[Maker]:
        return [("the iterations", lambda: iterations({n: results[f"of {n}"] for n in sizes}, t_end))]

    def measured(
        key: str, title: str, run: Callable[[int], Times], rounds: int, make: Callable[[Times], Table]
    ) -> Part:
        task = Task("times", partial(run, rounds), timed=True)
        return Part(key, title, [task], _none, lambda results: [(title, lambda: make(results["times"]))])

    return [
        Part("lattices", "Iterations on a lattice", lattices, _none, on_lattices),
        measured("calls", "A second call of integrate", experiments.calls, rounds, calls),
        measured("steps", "run.step() beyond the kernel's step", experiments.steps, rounds, steps),
        Part(
            "c",
            "Kepler's problem beside C",
            [c_task],
            _none,
            lambda results: [("the steps in C", lambda: in_c(results["times"]))],
        ),
        variations.part(rounds),
        gradients.part(few),
        threads.part(few, quick=quick),
        measured("first", "The first result of a fresh process", experiments.first_results, fresh, fresh_),
    ]


def tasks(quick: bool) -> list[Task]:
    """Return the computations of a quick run, or of a whole one."""
    return tasks_of(parts(quick=quick))


def tolerances(run: Results) -> list[Section]:
    """Return the times at looser tolerances, of HBVM and of its projection apart, with the errors."""
    members = ratios(run)
    blocks = attempt(
        ("times by tolerance", partial(summary, members)),
        ("errors and times", partial(details, members)),
    )
    note = Note(
        f"{POSITION} Here: at the end. Ratios: the median of the ratio of CPU times within each interleaved "
        "round, all settings of a problem in one process."
    )
    return [Section("Looser tolerances", [note, *blocks], "tolerances", nav="Tolerances")]


def beside(run: Results) -> list[Section]:
    """Return what was computed beside the cases."""
    return sections_of(parts(quick=run.runs[-1].index.campaign.quick), run)


def ratios(run: Results) -> dict[str, list[Ratio]]:
    """Return the settings of each problem beside `DEFAULT`, which comes first, by the problem's title."""
    campaign = run.runs[-1].index.campaign
    members: dict[str, list[Ratio]] = {}
    for entry, records in standings.entries(campaign, run.records):
        default = next(iter(standings.among(records, str(Spec("HBVM", HBVM().options())))), None)
        if default is not None:
            members[standings.title_of(entry)] = [Ratio.from_records(record, default) for record in records]
    return members


def medians(run: Results) -> dict[str, float]:
    """Return the median ratio over the problems of each setting but the default."""
    others = [ratio for problem in ratios(run).values() for ratio in problem if ratio.record != ratio.default]
    grouped = grouped_by(lambda ratio: ratio.record.case.method, others)
    return {method: median(r.spread.median for r in here if r.spread) for method, here in grouped.items()}


def summary(members: Mapping[str, Sequence[Ratio]]) -> list[Table]:
    """Return the ratios, one table for each family: a column for each problem, the median and the largest."""
    others = [ratio for problem in members.values() for ratio in problem if ratio.record != ratio.default]
    tables = []
    for family, of_family in grouped_by(lambda ratio: family_of(ratio.record), others).items():
        rows = []
        for method, here in grouped_by(lambda ratio: ratio.record.case.method, of_family).items():
            by_problem = {ratio.record.case.problem: ratio for ratio in here}
            columns = (by_problem.get(problem[0].record.case.problem) for problem in members.values())
            medians = [ratio.spread.median for ratio in here if ratio.spread is not None]
            judged = len(medians) == len(members) and not any(ratio.busy for ratio in here)
            rows.append(
                (
                    method,
                    *(NONE if r is None else ratio_text(r.spread).partition(" (")[0] for r in columns),
                    f"{median(medians):.2f}×" if medians else NONE,
                    f"{max(medians):.2f}×" if medians else NONE,
                    "judged" if judged else "not judged",
                )
            )
        tables.append(
            Table(
                f"Time relative to {DEFAULT}: {family}",
                ("setting", *members, "median", "largest", "verdict"),
                rows,
                f"Not judged: a problem has no time, or other work took more than {OTHER_WORK:.0%} of a core "
                "while its times were taken.",
                words=(0, len(members) + 3),
                key=f"tolerances-{'projection' if tables else 'hbvm'}",
            )
        )
    return tables


def details(members: Mapping[str, Sequence[Ratio]]) -> Table:
    """Return times, counts and errors of every setting on every problem."""
    rows = [
        (
            title if place == 0 else "",
            ratio.record.case.method,
            "1" if ratio.record == ratio.default else ratio_text(ratio.spread),
            *(format_metric(ratio.record, key) for key in METRICS),
            "" if ratio.record == ratio.default else ratio.verdict,
        )
        for title, problem in members.items()
        for place, ratio in enumerate(problem)
    ]
    return Table(
        "Errors and times",
        (
            *("problem", "setting", f"× {DEFAULT}", "time", "steps", "evaluations"),
            *("energy", "position", "verdict"),
        ),
        rows,
        "In brackets: the quartiles. Less or more time: both quartiles are on one side of 1.",
        words=(0, 1, 8),
        key="tolerances-details",
    )


def iterations(counted: Mapping[int, Mapping[str, Iterations]], t_end: float) -> Table:
    """Return the iterations per step by the size of the lattice."""
    rows = []
    for n, by_method in counted.items():
        cells = []
        for method in ON_LATTICES:
            cost = by_method[method]
            a_step = f"{cost.iterations / cost.steps:.1f}" if cost.steps and not cost.reason else cost.reason
            cells += [a_step, f"{cost.steps}", cost.solver]
        rows.append((f"{n}", *cells))
    heads = [
        f"{method}, {what}" for method in ON_LATTICES for what in ("iterations per step", "steps", "solver")
    ]
    return Table(
        "Iterations per step on the discrete nonlinear Schroedinger equation",
        ("sites", *heads),
        rows,
        f"From a rough start to t = {t_end:g}: `reports/costs/lattice.py`.",
        words=(3, 6),
        key="costs-lattices",
    )


def calls(times: Times) -> Table:
    """Return the time of a call."""
    return _timed(
        "A second call of integrate on a problem of one step",
        CALLED,
        times,
        1e6,
        "µs",
        f"Kepler's problem to t = {experiments.SHORT:g}; a sample is the mean of {experiments.BATCH} calls, "
        "each with a new method object; the system is the same.",
    )


def steps(times: Times) -> Table:
    """Return the time of `run.step()` beyond that of the kernel."""
    return _timed(
        "Time of run.step() beyond that of the kernel's step",
        STEPPED,
        times,
        1e6,
        "µs",
        f"Kepler's problem to t = {experiments.LONG:g}: the mean time of a step of `integrators.start`, with "
        "the loop around it, less that of a step of one integration, of the same round.",
    )


def fresh_(times: Times) -> Table:
    """Return the time to a first result."""
    return _timed(
        "Seconds to the first result of a fresh process with empty caches",
        FIRST,
        times,
        1.0,
        "s",
        "From the start of Python to the end of `integrate(problems.load('kepler'), method)`, with all "
        "imports; the caches of compiled code are empty.",
    )


def in_c(found: BesideC) -> Table | Note:
    """Return times, iterations and errors beside the same algorithm in C, or why there are none."""
    if found.times is None:
        return Note(f"Not run: {found.compiler}.")
    verdict = found.times.verdict
    ours = found.times.seconds[OURS]
    rows = []
    for name in (OURS, IN_C):
        outcome, seconds = found.outcomes[name], found.times.seconds[name]
        nanoseconds = Spread.from_samples([1e9 * second for second in seconds])
        ratio = Spread.from_samples([second / our for second, our in zip(seconds, ours, strict=True)])
        rows.append(
            (
                name,
                f"{nanoseconds.median:.1f}",
                f"{1e9 * min(seconds):.1f}",
                "1" if name == OURS else ratio_text(ratio),
                f"{outcome.iterations / outcome.steps:.3f}",
                f"{outcome.energy:.1e}",
                f"{outcome.position:.1e}",
                verdict,
            )
        )
    steps = found.outcomes[OURS].steps
    return Table(
        f"A step of Gauss(8) on Kepler's problem, e = {ECCENTRICITY:g}, beside the same algorithm in C",
        ("code", "median (ns)", "best", f"× {OURS}", "iterations per step", "energy", "position", "verdict"),
        rows,
        f"{steps:,} steps of length {STEP:g} in the second-order form, in turn; errors at the end. Both have "
        "the same tables, first stages, stopping rule and compensated update; "
        f"`{SOURCE.name}` by {found.compiler}. Ratios: the median within each round, in brackets the "
        "quartiles.",
        words=(0, 7),
        key="costs-c",
    )


def _timed(title: str, methods: Sequence[str], times: Times, scale: float, unit: str, note: str) -> Table:
    rows = []
    for method in methods:
        samples = [scale * seconds for seconds in times.seconds[method]]
        spread = Spread.from_samples(samples)
        quartiles = NONE if spread.low is None else f"{spread.low:.3g} to {spread.high:.3g}"
        rows.append(
            (
                method,
                f"{spread.median:.3g}",
                quartiles,
                f"{min(samples):.3g}",
                f"{len(samples)}",
                times.verdict,
            )
        )
    return Table(
        title,
        ("method", f"median ({unit})", "quartiles", "best", "samples", "verdict"),
        rows,
        note,
        words=(0, 5),
        key=f"costs-{title.split()[0].lower()}-{unit}",
    )


def _none(results: PartResults) -> list:
    del results
    return []
