"""Many trajectories with a value of each, in lanes or in threads, with progress and a checkpoint."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators import registry
from integrators.dynamics.together import Together
from integrators.protocol import Array, MethodBase, Status, check_problem
from integrators.running.many import members
from integrators.running.watch import Bar, Report, Watch, check_progress, files, identity
from problems.problem import Problem

Outcome = tuple[ArrayLike, Status, str, int]
"""The values of one trajectory, how it ended with the reason, and how many steps it took."""
Outcomes = tuple[Any, Sequence[Status], Sequence[str], Any]
"""The same of several."""


@dataclass(frozen=True)
class OnTheWay:
    """What is shown and written on the way: arguments that every map has."""

    progress: bool | Report
    checkpoint: Any
    every_seconds: float
    resume: Any


@dataclass(frozen=True, eq=False)
class Many:
    """The trajectories of a map."""

    problem: Problem
    method: MethodBase
    rows: Array
    par: Array
    threads: int

    @classmethod
    def of(
        cls,
        name: str,
        problem: Problem,
        method: MethodBase | None,
        starts: Any,
        parameters: Any,
        threads: int,
    ) -> "Many":
        """Return what the arguments of the function of this name say, or refuse them."""
        method = registry.create("HBVM") if method is None else method
        check_problem(problem, method)
        return cls(problem, method, *members(name, problem, starts, parameters), threads)

    def ends(self, state: Mapping[str, Any]) -> dict[str, Any]:
        """Return the arguments of a map that say how the trajectories ended."""
        return {
            "status": state["status"], "reason": state["reason"], "starts": self.rows, "par": self.par
        }  # fmt: skip

    def followed(
        self,
        told: str,
        shape: tuple[int, ...],
        vectors: Array,
        in_lanes: Callable[[Together, Array, Array], Outcomes] | None,
        one: Callable[[Problem], Outcome],
        file: OnTheWay,
    ) -> tuple[dict[str, Any], str]:
        """Return the values of all, one in each row, and their ends; and why no file was written.

        Parameters
        ----------
        told : str
            What is computed, by which a file is known.
        shape : tuple of int
            Of the values of one.
        vectors : ndarray, shape (dim, k)
            Tangent vectors at each start.
        in_lanes : callable or None
            What makes the values of several in lanes, where there are lanes;
        one : callable
            what makes those of one, in threads, where there are not.
        file : OnTheWay
            What is shown and written.
        """
        if in_lanes is not None:
            together = Together(self.problem, self.method, vectors, self.threads)
            if together.available:
                piece = together.piece
                return self._over(told, shape, partial(in_lanes, together), piece, piece, file)

        def of_one(y0: Array, values: Array) -> Outcome:
            parameters: Any = self.problem.system.unpack(values)
            return one(self.problem.replace(y0=y0, parameters=parameters))

        with ThreadPoolExecutor(self.threads) as pool:

            def in_threads(rows: Array, par: Array) -> Outcomes:
                return tuple(zip(*pool.map(of_one, rows, par), strict=True))  # type: ignore[return-value]

            return self._over(told, shape, in_threads, self.threads, 1, file)  # 1 compiles what all need

    def _over(
        self,
        told: str,
        shape: tuple[int, ...],
        of_several: Callable[[Array, Array], Outcomes],
        piece: int,
        first: int,
        file: OnTheWay,
    ) -> tuple[dict[str, Any], str]:
        """Do what `followed` says, for so many at a time, and at first."""
        progress, n = file.progress, len(self.rows)
        check_progress(progress)
        state: dict[str, Any] = {
            "values": np.full((n, *shape), np.nan),
            "status": [Status.INTERRUPTED] * n,
            "reason": ["Ctrl-C was pressed before it was at its end."] * n,
            "made": 0,
            "steps": 0,
        }
        starts = np.concatenate([self.rows.ravel(), self.par.ravel()])
        belongs = identity(self.problem, self.method, starts, told, {})
        path, kept = files(file.checkpoint, file.resume, belongs)
        state = state if kept is None else kept
        with Bar() if progress is True else nullcontext(progress or None) as report:
            watch = Watch(0.0, float(n), report, path, file.every_seconds, belongs)
            with suppress(KeyboardInterrupt):
                while (made := state["made"]) < n:
                    here = slice(made, made + (piece if made else first))
                    values, status, reason, steps = of_several(self.rows[here], self.par[here])
                    state["values"][here] = values
                    state["status"][here] = status
                    state["reason"][here] = reason
                    state["made"] = made + len(status)
                    state["steps"] += sum(steps)
                    watch.keep(state)
                    watch.look(float(state["made"]), state["steps"])
            watch.write()
        return state, watch.failure
