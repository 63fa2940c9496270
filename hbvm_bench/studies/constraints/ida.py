"""SUNDIALS' IDA on the equations of index 2: ``constraints.ida:IDA(rtol=1e-8)`` in a campaign."""

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numba
import numpy as np

from hbvm_bench.studies.constraints.equations import Equations, refusal
from integrators.options import Share
from integrators.peers import load
from integrators.protocol import Array, MethodBase, Status, cite
from integrators.stepping import ProgramBase, StepperBase
from problems import Constrained, targets
from problems.problem import Problem, System

FREE = 1e3
"""Absolute tolerance of the multipliers: their error is one of the momenta divided by the step, and they have
no influence on the following steps."""
MOST_STEPS = 2**31 - 1


@dataclass(frozen=True, kw_only=True, repr=False)
class IDA(MethodBase):
    """SUNDIALS' IDA, multistep formulas of order 1 to 5 for ``q' = c p, p' = f - G' lambda, G c p = 0``.

    Parameters
    ----------
    rtol : float
        Relative tolerance, > 0; the absolute one of positions and momenta is the same.
    """

    rtol: Share

    library, family, citation = "scikit-sundae", "multistep", cite("HindmarshEtAl2005")
    computes_with = ("numpy", "numba")
    built = "generic wheel; residual compiled on this machine by numba"

    def accepts(self, problem: Problem) -> str | None:
        """Say why it does not integrate a problem."""
        return refusal(problem)

    def compile(self, system: System) -> "Program":
        """Compile the residual."""
        return Program(system, self)


class Program(ProgramBase):
    """A residual compiled for IDA."""

    def __init__(self, system: System, method: IDA):
        super().__init__(system, method)
        self._solver = load("scikit-sundae", "sksundae.ida").IDA
        assert isinstance(system, Constrained)
        started = perf_counter()
        self._equations, self._residual = Equations.of(system), _residual(system)
        self._field, self._multipliers = (targets.numpy(system, of) for of in ("field", system.multipliers))
        size = system.dim + self._equations.n
        self._residual(0.0, np.ones(size), np.ones(size), system.pack({}), np.empty(size))  # compiles it
        self.compile_seconds = perf_counter() - started

    def solver(self, y: Array, par: Array, t: float) -> Any:
        """Return IDA at a start, with the multipliers of that."""
        n, dim, residual = self._equations.n, self.system.dim, self._residual

        def function(t: float, y: Array, slope: Array, out: Array) -> None:
            residual(t, y, slope, par, out)

        solver = self._solver(
            function,
            rtol=self.method.rtol,
            atol=np.array([self.method.rtol] * dim + [FREE] * n),
            algebraic_idx=list(range(dim, dim + n)),
            max_num_steps=MOST_STEPS,
        )
        start = np.concatenate([y, self._multipliers(t, y, par)])
        solver.init_step(t, start, np.concatenate([self._field(t, y, par), np.zeros(n)]))
        return solver

    def stepper(self, y: Array, par: Array, t: float) -> "Stepper":
        """Return a trajectory."""
        return Stepper(self, y, par, t)


class Stepper(StepperBase):
    """A trajectory of IDA: the steps that it chooses, and its polynomial at times between them.

    IDA does not tell how many steps a call took: to several times it takes them one by one, and they are
    counted. To a single time it is one call, which takes half as long.
    """

    samplings = ("partial",)

    def __init__(self, program: Program, y: Array, par: Array, t: float):
        super().__init__(y, t)
        self._solver, self._ahead = program.solver(y, par, t), t

    def _serve(self, grid: Array, how: str) -> tuple[Array, Array]:
        states = np.empty((grid.size, self._y.size))
        for i, t in enumerate(grid.tolist()):
            while grid.size > 1 and self._ahead < t:
                ahead = self._solver.step(t, "onestep")
                if not ahead.success:
                    break
                self._ahead = float(ahead.t)
                self._stats.steps += 1
            result = self._solver.step(t)
            self._stats.evaluations = int(result.nfev)
            if not result.success:
                reached, y = float(result.t), np.array(result.y[: self._y.size])
                self._fail(Status.STEP_UNDERFLOW, reached, y, f"IDA gave up: {result.message}")
                return grid[:i], states[:i]
            states[i] = result.y[: self._y.size]
        return grid, states


def _residual(system: System) -> Any:
    scale, force, _, entries, rows, columns, dof, _ = Equations.of(system)

    @numba.njit(error_model="numpy")
    def residual(t, y, slope, par, out):
        state, multipliers = y[: 2 * dof], y[2 * dof :]
        c, f, values = np.empty(dof), np.empty(dof), np.empty(rows.size)
        scale(t, state, par, c)
        force(t, state, par, f)
        entries(t, state, par, values)
        out[:dof] = slope[:dof] - c * state[dof:]
        out[dof : 2 * dof] = slope[dof : 2 * dof] - f
        out[2 * dof :] = 0.0
        for i in range(rows.size):
            constraint, d = rows[i], columns[i]
            out[dof + d] += values[i] * multipliers[constraint]
            out[2 * dof + constraint] += values[i] * c[d] * state[dof + d]

    return residual


METHODS = {"IDA": IDA}
