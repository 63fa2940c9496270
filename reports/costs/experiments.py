"""Costs that no integration of a campaign shows: iterations on lattices, a call, a step, a fresh process."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import problems
from hbvm_bench.campaign.identity import make_method
from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import busy, interleaved, load_between, no_collection
from hbvm_bench.run.child import ENVIRONMENT, caches_in
from hbvm_bench.store.records import Load
from integrators import integrate, start
from integrators.protocol import Status
from integrators.solution import Solution
from problems.errors import InputError

from .lattice import lattice

ON_LATTICES = ("HBVM(k=8, s=4, h=0.1)", "HBVM()")
CALLED = ("HBVM()", "Gauss(s=8, h=0.1)", "Taylor()")
STEPPED = ("HBVM()", "Gauss(s=8, h=0.1)", "HBVM(k=16, s=8, h=0.1)")
FIRST = ("HBVM()", "Gauss(s=8, h=0.1)", "Taylor()")
SHORT = 0.1  # the end of a problem of one step
LONG = 300.0  # of one of many steps
BATCH = 50  # calls of one sample
LIMIT = 120.0  # seconds of a fresh process


@dataclass(frozen=True)
class Iterations:
    """Steps and iterations of the nonlinear solver on a lattice; why there are none where it failed."""

    steps: int
    iterations: int
    solver: str
    reason: str = ""


@dataclass(frozen=True)
class Times:
    """Seconds of samples, by what was measured, and what else the machine did meanwhile.

    Attributes
    ----------
    seconds : dict of list of float
        By method.
    others, stolen : float
        As shares of one core's time.
    """

    seconds: dict[str, list[float]]
    others: float
    stolen: float

    @property
    def verdict(self) -> str:
        """Whether the times are judged, and why not."""
        why = Load(others=self.others, steal=self.stolen).verdict()
        return f"not judged: {why}" if why else "judged"


def iterations(n: int, t_end: float) -> dict[str, Iterations]:
    """Return the costs of `ON_LATTICES` on a lattice of n places."""
    problem, counted = lattice(n, t_end), {}
    for text in ON_LATTICES:
        solution = integrate(problem, make_method(text), [problem.t_end])
        stats = solution.stats
        failed = "" if solution.status is Status.FINISHED else solution.reason
        counted[text] = Iterations(stats.steps, stats.iterations or 0, stats.solver or "", failed)
    return counted


def calls(rounds: int) -> Times:
    """Return the seconds of a call of `integrate` on a problem of one step, the first ones left out."""
    problem = problems.load("kepler", t_end=SHORT)

    def sample(text: str) -> float:
        methods = [make_method(text) for _ in range(BATCH)]  # each call has a new method object
        begun = time.perf_counter()
        for method in methods:
            integrate(problem, method, [SHORT])
        return (time.perf_counter() - begun) / BATCH

    for text in CALLED:
        finished(integrate(problem, make_method(text), [SHORT]))
    return taken_on_a_core({text: partial(sample, text) for text in CALLED}, rounds)


def steps(rounds: int) -> Times:
    """Return the seconds of `run.step()` beyond those of the same step inside one integration."""
    problem = problems.load("kepler", t_end=LONG)

    def sample(text: str) -> float:
        run, count = start(problem, make_method(text)), 0
        begun = time.perf_counter()
        while run.t < LONG:
            run.step()
            count += 1
        stepped = (time.perf_counter() - begun) / count
        begun = time.perf_counter()
        whole = finished(integrate(problem, make_method(text), [LONG]))
        return max(stepped - (time.perf_counter() - begun) / whole.stats.steps, 0.0)

    return taken_on_a_core({text: partial(sample, text) for text in STEPPED}, rounds)


def first_results(rounds: int) -> Times:
    """Return the seconds of a fresh process with empty caches, from its start to its first result."""

    def sample(text: str) -> float:
        with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as cache:
            return _fresh(text, Path(cache))

    return taken({text: partial(sample, text) for text in FIRST}, rounds)


def taken_on_a_core(samples: dict[str, Callable[[], float]], rounds: int) -> Times:
    """Take samples in this process, on one core, after a round that is left out."""
    with machine.staying_on_a_core(), no_collection():
        interleaved([*samples.values()], 1)
        return taken(samples, rounds)


def taken(samples: dict[str, Callable[[], float]], rounds: int) -> Times:
    """Take the samples in turn, and look at what else the machine does."""
    before = busy()
    seconds = interleaved([*samples.values()], rounds)
    load = load_between(before, busy())
    if load is None:
        raise InputError("the clock stood still while times were taken.")
    return Times(dict(zip(samples, seconds, strict=True)), load.others, load.steal)


PROGRAM = """
import integrators, problems
solution = integrators.integrate(problems.load("kepler"), integrators.{method})
print(solution.status.value, flush=True)
"""


def _fresh(method: str, caches: Path) -> float:
    begun = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(method=method)],
        env={**os.environ, **ENVIRONMENT, **caches_in(caches)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as process:
        assert process.stdout is not None
        said = process.stdout.readline().strip()
        seconds = time.perf_counter() - begun
        process.wait(LIMIT)
    if said != Status.FINISHED.value:
        raise InputError(f"the fresh process with {method} gave no result.")
    return seconds


def seconds_of(run: Callable[[], object]) -> float:
    """Return the seconds of one run."""
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun


def finished(solution: Solution) -> Any:
    """Return a solution that has come to its end.

    Raises
    ------
    problems.errors.InputError
        If it has not.
    """
    if solution.status is not Status.FINISHED:
        raise InputError(f"{solution.method!r} ended as {solution.status.value}: {solution.reason}")
    return solution
