"""What tangent vectors cost: the time with one and with four, relative to the trajectory alone.

The same problem goes through HBVM and through heyoka's `var_ode_sys` of first order, all of them in turn in
one process: with the derivative with respect to one component of the start, and to all four.
"""

import time
from collections.abc import Callable
from functools import partial

import numpy as np

import problems
from hbvm_bench.measure.computation import Task
from hbvm_bench.measure.timing import Spread
from hbvm_bench.report.document import Maker
from hbvm_bench.report.parts import Part, PartResults
from hbvm_bench.summaries.table import NONE, Table
from integrators import HBVM, integrate
from integrators.protocol import Array
from problems import targets
from problems.errors import InputError
from problems.problem import Problem

from .experiments import Times, finished, taken_on_a_core

KEY, TITLE = "variations", "Tangent vectors"
END = 1000.0
TOLERANCE = 1e-15
COUNTS = (0, 1, 4)
LIBRARIES = {"hbvm": "HBVM()", "heyoka": f"heyoka, var_ode_sys, tol={TOLERANCE:g}"}


def problem() -> Problem:
    """Return the Hénon–Heiles problem over the interval that is timed."""
    return problems.load("henon_heiles", t_end=END)


class Variational:
    """The problem with the derivatives with respect to its first components, compiled by heyoka.

    Parameters
    ----------
    count : int
        How many; with 0 the problem alone.
    """

    def __init__(self, count: int):
        import heyoka as hy

        self._problem, self._done = problem(), hy.taylor_outcome.time_limit
        equations = targets.heyoka(self._problem.system)
        if count:
            equations = hy.var_ode_sys(equations, [equations[i][0] for i in range(count)], order=1)
        self._taylor = hy.taylor_adaptive(
            equations, self._problem.y0.tolist(), tol=TOLERANCE, pars=self._problem.par
        )
        self._start = self._taylor.state.copy()

    def run(self) -> Array:
        """Return the state and the derivatives at the end, as heyoka has them.

        Raises
        ------
        problems.errors.InputError
            If heyoka does not reach the end.
        """
        self._taylor.time = self._problem.t0
        self._taylor.state[:] = self._start
        if self._taylor.propagate_until(END)[0] != self._done:
            raise InputError(f"heyoka ended at t = {self._taylor.time!r} of {END!r}.")
        return self._taylor.state


def times(rounds: int) -> Times:
    """Return the seconds of both libraries, by ``"library vectors"``, the first round left out."""
    henon_heiles, method = problem(), HBVM()

    def ours(count: int) -> None:
        vectors = np.eye(henon_heiles.system.dim)[:, :count] if count else None
        finished(integrate(henon_heiles, method, [END], variations=vectors))

    runs: dict[str, Callable[[], object]] = {f"hbvm {n}": partial(ours, n) for n in COUNTS}
    runs |= {f"heyoka {n}": Variational(n).run for n in COUNTS}
    return taken_on_a_core({name: partial(_seconds, run) for name, run in runs.items()}, rounds)


def _seconds(run: Callable[[], object]) -> float:
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun


def part(rounds: int) -> Part:
    """Return the computation and its section."""

    def blocks(results: PartResults) -> list[Maker]:
        return [("the times with tangent vectors", lambda: table(results["times"]))]

    return Part(KEY, TITLE, [Task("times", partial(times, rounds), timed=True)], lambda results: [], blocks)


def table(taken: Times) -> Table:
    """Return the time of a trajectory alone, and of one with vectors relative to it, for both libraries."""
    rows = []
    for key, name in LIBRARIES.items():
        alone = taken.seconds[f"{key} 0"]
        ratios = [
            Spread.from_samples(
                [with_them / without for with_them, without in zip(seconds, alone, strict=True)]
            )
            for seconds in (taken.seconds[f"{key} {n}"] for n in COUNTS[1:])
        ]
        median = Spread.from_samples([1e6 * seconds for seconds in alone]).median
        rows.append((name, f"{median:.3g}", *map(_text, ratios), f"{len(alone)}", taken.verdict))
    return Table(
        "Time with tangent vectors, relative to the trajectory alone",
        ("method", "alone (µs)", *(f"{n} vector{'s' * (n > 1)}" for n in COUNTS[1:]), "samples", "verdict"),
        rows,
        f"The Hénon–Heiles problem to t = {END:g}, in one process: the median of the ratio within each "
        "round, and its quartiles. A vector is the derivative with respect to one component of the "
        "initial state; the orbit is chaotic, and the vectors grow.",
        words=(0, 5),
        key="costs-variations",
    )


def _text(spread: Spread) -> str:
    quartiles = NONE if spread.low is None else f"{spread.low:.2f}–{spread.high:.2f}"
    return f"{spread.median:.2f}× ({quartiles})"
