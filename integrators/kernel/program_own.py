"""HBVM(k, s) with steps of varying length, compiled for one system."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from integrators.caveats import sees_kinks
from integrators.kernel import layout, tables
from integrators.kernel.context import Context
from integrators.kernel.native import binary as native
from integrators.kernel.native import engine_own as engine
from integrators.kernel.program import HBVMProgram
from integrators.kernel.stepper_own import AdaptiveStepper
from integrators.kernel.tables import aligned
from integrators.legendre import legendre
from integrators.protocol import check_parameters, check_start, check_state
from problems.problem import System

FIRST_RATE = 0.01

MARGIN = 0.82
"""Part of the length allowed that steps aim at, besides `integrators.kernel.step.control.SAFETY`.

Errors of order 25 and more vary strongly from step to step, and a rejected step costs as
much as one that is taken: with 1 a fifth of the steps are rejected and all problems of the
race take 5 to 20 % longer.
"""

OF_A_BODY, OF_A_COMPONENT = 1e-6, 1e-4
"""What the field of a block counts as at least, as a part of the largest in its group.

A light body is an object of its own; single components next to nodes or turning points
of a lattice are moved by the others' rounding.
"""


UNSEEN = 1e-12
"""Part of a block's size that the error at a kink of the field may always be."""


class AdaptiveProgram(HBVMProgram):
    """HBVM(k, s) with steps as long as a tolerance allows, compiled for one system.

    Parameters
    ----------
    system : System
        What to integrate.
    k, s : int
        Stages and degree, k >= s >= 1, k > 1.
    tol : float
        Local error per step, relative to the size of each block of the state.
    defect : float, optional
        The same for the error of the quadrature, by which the energy changes; by default any.
    h : float, optional
        Length of the first step.
    solver : {"auto", "fixed_point", "newton", "blended"}, optional
        How the stage equations are solved; see `integrators.hbvm.HBVM`.
    max_step : float, optional
        Length that no step exceeds.
    breakpoints : sequence of float, optional
        Times that steps end at, ascending.
    max_steps : int, optional
        Steps of a trajectory, at most.
    """

    varying = True

    def __init__(
        self,
        system: System,
        *,
        k: int,
        s: int,
        tol: float,
        defect: float | None = None,
        h: float | None = None,
        solver: str = "auto",
        max_step: float | None = None,
        breakpoints: Sequence[float] = (),
        max_steps: int | None = None,
    ):
        super().__init__(system, k=k, s=s, h=1.0 if h is None else h, solver=solver)
        started = native.clock()
        self.tol, self.defect, self.first = tol, defect, h
        self.max_step, self.breakpoints, self.max_steps = max_step, np.array(breakpoints, float), max_steps
        made = engine.code()
        self.from_cache = self.from_cache and made.from_cache
        c = self.constants
        if c.route != layout.THROUGH:
            # What rounding does to a row acts in every step; see `integrators.kernel.tables`.
            a = c.arrays
            raw = tables.keep_moments(a["matrix"], a["matrix_low"], a["basis"])
            columns = c.route if c.route > 1 else None
            self._fixed["RAW_MATRIX"] = tables.packed(raw, columns=columns, repeat=True)
        # P_s vanishes at the nodes of the rule with s nodes.
        self.degree = s if k > s else s - 1
        basis = legendre(c.arrays["nodes"].reshape(-1), k) * c.arrays["weights"].reshape(-1)[:, None]
        m = self.degree
        middle = max(1, (k - 4) // 2)
        degrees = [0, *(min(j, m - 1) for j in (1, 2, 3)), m - 1, m, max(k - 2, 0), k - 1]
        degrees += [min(middle, k - 1), min(middle + 1, k - 1)]
        rows = [*basis.T[degrees], *(basis @ legendre(np.array([0.0, 1.0]), k).T).T]
        self._estimators = aligned(len(rows) * 8 * -(-k // 8))
        self._estimators.reshape(len(rows), -1)[:, :k] = rows
        # As much as rounding accounts for, and without a bound on the quadrature what the tolerance allows.
        self._negligible = UNSEEN if defect is not None else max(tol, UNSEEN)
        self._doubt, self._slowest = _decays(k, m, tol, middle, sees_kinks(k, system))
        self.compile_seconds += native.clock() - started

    @property
    def description(self) -> str:
        """The method with all that steps depend on, as text."""
        c = self.constants
        return (
            f"HBVM(k={c.k}, s={c.s}, tol={self.tol!r}, defect={self.defect!r}, h={self.first!r}, "
            f"solver={self._named!r}, max_step={self.max_step!r}, breakpoints={self.breakpoints.tolist()!r}, "
            f"max_steps={self.max_steps!r})"
        )

    def start(self, y0: ArrayLike, par: ArrayLike | None = None, t0: float = 0.0) -> AdaptiveStepper:
        """Return a stepper at ``t0``; as `HBVMProgram.start`."""
        values = check_parameters(par, self.system)
        return AdaptiveStepper(self, check_state(y0, self.system.dim), values, check_start(t0))

    def context(self, *, side: bool = False) -> Context:
        """Return fresh memory for a trajectory, or for its partial steps."""
        context = super().context(side=True)  # with a matrix of its own
        shape = self.shape
        room = 8 * shape.rows + (layout.BLOCK_ROOM + 1) * shape.group.size
        context.point({"ESTIMATORS": self._estimators, "ESTIMATES": aligned(room)})
        reals, order = context.reals, 2 * self.degree + 1
        context.words[layout.ERROR_DEGREE] = self.degree
        reals[layout.ALLOWED_ERROR] = self.tol
        bodies = getattr(self.system, "bodies", None) is not None
        reals[layout.LEAST_SLOPE] = OF_A_BODY if bodies else OF_A_COMPONENT
        reals[layout.ALLOWED_DEFECT] = math.inf if self.defect is None else self.defect
        reals[layout.ERROR_AIM] = math.log(self.tol) / order + math.log(MARGIN)
        reals[layout.ERROR_DECAY] = self.tol ** (0.5 / self.degree)
        if self.defect is not None:
            last = self.constants.k - 1
            reals[layout.DEFECT_AIM] = math.log(self.defect) / (2 * last + 1) + math.log(MARGIN)
            reals[layout.DEFECT_DECAY] = self.defect ** (0.5 / last)
        reals[layout.DOUBT], reals[layout.SLOWEST_DECAY] = self._doubt, self._slowest
        reals[layout.NEGLIGIBLE] = self._negligible
        context.point({"KINK_PLACES": aligned(2 * layout.KINKS_KEPT)})
        reals[layout.LONGEST] = math.inf if self.max_step is None else self.max_step
        reals[layout.STOP] = math.inf
        reals[layout.LENGTH_LIMIT] = math.inf
        reals[layout.LOG_RATE] = math.log(FIRST_RATE)
        return context


def _decays(k: int, m: int, tol: float, middle: int, looks: bool) -> tuple[float, float]:
    """Return DOUBT and SLOWEST_DECAY, which tell a smooth field from one with a kink.

    Where the error is the tolerance, coefficients of a smooth field fall off by
    ``tol^(1/2m)`` from one degree to the next. Those of a kink fall off like 1/j^2, from the
    middle ones, of degrees ``middle`` and the next, to the last one. Infinite where
    nobody ``looks``.
    """
    if not looks:
        return math.inf, math.inf
    smooth, last = tol ** (0.5 / m), k - 1
    at_a_kink = ((middle + 0.5) / last) ** 2
    doubt = min(10.0 * smooth ** (last - min(3, m - 1)), 0.1 / last**2)
    return doubt, max(at_a_kink / 4.0, 6.0 * smooth ** (last - middle - 1))
