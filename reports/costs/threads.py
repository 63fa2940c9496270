"""Large systems with one and with two threads, beside REBOUND's IAS15.

The end is bitwise the same with any number of threads, which each run checks.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from hbvm_bench.campaign.identity import make_method, make_problem
from hbvm_bench.measure import machine
from hbvm_bench.measure.computation import Task
from hbvm_bench.measure.timing import Spread
from hbvm_bench.report.document import Maker, Note
from hbvm_bench.report.parts import Part, PartResults
from hbvm_bench.summaries.goals import ratio_text
from hbvm_bench.summaries.rows import seconds as in_words
from hbvm_bench.summaries.table import Table
from integrators import integrate
from problems.errors import InputError

from .experiments import Times, finished, seconds_of, taken

KEY, TITLE = "threads", "Two threads"
REBOUND = 'IAS15(mode="global")'


@dataclass(frozen=True)
class Large:
    """A large system, a shorter one for quick runs, and our settings."""

    title: str
    use: str
    quick: str
    methods: tuple[str, str]
    reference: str


LARGE = {
    "bodies": Large(
        "1,000 bodies",
        "cluster(n=1000, t_end=0.01)",
        "cluster(n=100, t_end=0.001)",
        ("HBVM()", "Gauss(s=16, h=0.00125)"),
        "Gauss(s=12, h=0.001)",
    ),
    "chain": Large(
        "A thermal chain of 100,000",
        'fput(n=100000, start="thermal", seed=2, t_end=0.5)',
        'fput(n=300, start="thermal", seed=2, t_end=0.5)',
        ("HBVM()", "Gauss(s=16, h=0.125)"),
        "Gauss(s=12, h=0.0625)",
    ),
}


@dataclass(frozen=True)
class Shared:
    """Times and errors, by ``"threads method"``.

    Attributes
    ----------
    times : Times
        Of whole integrations, compiled before.
    energy, position : dict of float
        Errors of the energy and, against the reference setting, of the largest component at the end.
    """

    times: Times
    energy: dict[str, float]
    position: dict[str, float]


def measured(name: str, rounds: int, *, quick: bool) -> Shared:
    """Return the times and errors for a system of `LARGE`, compiled before.

    Raises
    ------
    problems.errors.InputError
        If a second thread changes a bit of the end.
    """
    if len(machine.cores()) < 2:
        machine.bind([])  # all: this process may have been started while a core was kept free for timing
    large = LARGE[name]
    problem = make_problem(large.quick if quick else large.use)
    exact = finished(integrate(problem, make_method(large.reference), [problem.t_end])).y[-1]
    ends, energy, samples = {}, {}, {}
    for method, threads in [*product(large.methods, (1, 2)), (REBOUND, 1)]:
        run = partial(integrate, problem, make_method(method), [problem.t_end], threads=threads)
        made, key = finished(run()), f"{threads} {method}"
        ends[key], energy[key] = made.y[-1], float(np.abs(made.errors()["energy"]).max())
        samples[key] = partial(seconds_of, run)
    for method in large.methods:
        if not np.array_equal(ends[f"1 {method}"], ends[f"2 {method}"]):
            raise InputError(f"{method} on {name} has another end with two threads than with one.")
    position = {key: float(np.abs(y - exact).max() / np.abs(exact).max()) for key, y in ends.items()}
    return Shared(taken(samples, rounds), energy, position)


def part(rounds: int, *, quick: bool) -> Part:
    """Return the computations and their section."""
    tasks = [Task(name, partial(measured, name, rounds, quick=quick), timed=True) for name in LARGE]

    def blocks(results: PartResults) -> list[Maker]:
        return [(f"the threads on {name}", partial(shown, name, results)) for name in LARGE]

    return Part(KEY, TITLE, tasks, lambda results: [], blocks)


def shown(name: str, results: PartResults) -> list[Note | Table]:
    """Return the sentence and the table of one system."""
    return [Note(sentence(name, results[name])), table(name, results[name])]


def sentence(name: str, found: Shared) -> str:
    """Return what the second thread saves, and how long REBOUND takes."""
    median = {key: Spread.from_samples(seconds).median for key, seconds in found.times.seconds.items()}
    shares = [f"{relative(found, f'2 {m}').median:.2f} for `{m}`" for m in LARGE[name].methods]
    fastest = min(median[f"1 {m}"] for m in LARGE[name].methods)
    theirs = median[f"1 {REBOUND}"] / fastest
    return (
        f"{LARGE[name].title}: the time with two threads relative to one is {' and '.join(shares)}. "
        f"With one thread each, REBOUND's IAS15 takes {theirs:.2g} times as long as the fastest of these."
    )


def relative(found: Shared, key: str) -> Spread:
    """Return the time relative to that of the same method on one thread, round by round."""
    _, method = key.split(" ", 1)
    pairs = zip(found.times.seconds[key], found.times.seconds[f"1 {method}"], strict=True)
    return Spread.from_samples([time / one for time, one in pairs])


def table(name: str, found: Shared) -> Table:
    """Return the errors and times on one system."""
    rows = []
    for key, seconds in found.times.seconds.items():
        threads, method = key.split(" ", 1)
        rows.append(
            (
                method,
                threads,
                in_words(Spread.from_samples(seconds).median),
                "1" if threads == "1" else ratio_text(relative(found, key)),
                f"{found.energy[key]:.1e}",
                f"{found.position[key]:.1e}",
                found.times.verdict,
            )
        )
    return Table(
        f"One and two threads: {LARGE[name].title}",
        ("method", "threads", "time", "× one thread", "energy", "position", "verdict"),
        rows,
        f"`{LARGE[name].use}`, whole calls of `integrate` after compiling; the end is bitwise the same with "
        "both numbers of threads. Position: the largest difference of a component at the end from "
        f"`{LARGE[name].reference}`. REBOUND has one thread: its wheels are built without OpenMP.",
        words=(0, 6),
        key=f"costs-threads-{name}",
    )
