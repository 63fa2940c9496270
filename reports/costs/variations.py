"""What tangent vectors cost: the time with one and with four, relative to the trajectory alone.

The same problem goes through HBVM and through heyoka's `var_ode_sys` of first order, all of them in turn in
one process: with the derivative with respect to one component of the start, and to all four.
"""

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

from .experiments import Times, finished, seconds_of, taken_on_a_core

KEY, TITLE = "variations", "Tangent vectors"
END = 1000.0
TOLERANCE = 1e-15
COUNTS = (0, 1, 4)
LIBRARIES = {"hbvm": "HBVM()", "heyoka": f"heyoka, var_ode_sys, tol={TOLERANCE:g}"}


def problem() -> Problem:
    """Return the Hénon–Heiles problem over the interval that is timed."""
    return problems.load("henon_heiles", t_end=END)


class Variational:
    """A problem with the derivatives with respect to its first components and parameters, by heyoka.

    Parameters
    ----------
    given : Problem
        Traced.
    count, parameters : int
        How many; with none the problem alone.
    tol, compact_mode
        Options of heyoka.
    """

    def __init__(
        self,
        given: Problem,
        count: int,
        parameters: int = 0,
        *,
        tol: float = TOLERANCE,
        compact_mode: bool = False,
    ):
        import heyoka as hy

        self._problem, self._done = given, hy.taylor_outcome.time_limit
        equations = targets.heyoka(given.system)
        if wrt := [equations[i][0] for i in range(count)] + [hy.par[i] for i in range(parameters)]:
            equations = hy.var_ode_sys(equations, wrt, order=1)
        self._taylor = hy.taylor_adaptive(
            equations, given.y0.tolist(), tol=tol, pars=given.par, compact_mode=compact_mode
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
        if self._taylor.propagate_until(self._problem.t_end)[0] != self._done:
            raise InputError(f"heyoka ended at t = {self._taylor.time!r} of {self._problem.t_end!r}.")
        return self._taylor.state


def times(rounds: int) -> Times:
    """Return the seconds of both libraries, by ``"library vectors"``, the first round left out."""
    henon_heiles, method = problem(), HBVM()

    def ours(count: int) -> None:
        vectors = np.eye(henon_heiles.system.dim)[:, :count] if count else None
        finished(integrate(henon_heiles, method, [END], variations=vectors))

    runs: dict[str, Callable[[], object]] = {f"hbvm {n}": partial(ours, n) for n in COUNTS}
    runs |= {f"heyoka {n}": Variational(henon_heiles, n).run for n in COUNTS}
    return taken_on_a_core({name: partial(seconds_of, run) for name, run in runs.items()}, rounds)


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
