"""What steps as long as a tolerance allows have besides those of one length: tables, aims, limits."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from integrators.caveats import FEWEST, detects_discontinuities
from integrators.kernel import tables, tolerance
from integrators.kernel.breakpoints import Breakpoints
from integrators.kernel.context import Context, Shape, width_of_blocks
from integrators.kernel.native import binary
from integrators.kernel.native import field as fields
from integrators.kernel.native.memory import aligned
from integrators.kernel.parts.surfaces import MOST_SURFACES
from integrators.kernel.plan import Plan
from integrators.kernel.step.rule import (
    LOG_RESIDUAL_VARYING,
    LONGEST,
    MOST_TRUSTED,
    PART_OF_TOLERANCE,
    TOLERANCE,
    TRUSTED,
    UNTESTED,
)
from integrators.protocol import Array
from problems.analysis.sides import sides
from problems.analysis.structure import depends_on_time
from problems.analysis.switches import Switches
from problems.errors import InputError
from problems.problem import System

OF_A_BODY, OF_A_COMPONENT = 1e-6, 1e-4
"""What the field of a block counts as at least, as a part of the largest in its group.

A light body is an object of its own; single components next to nodes or turning points
of a lattice are moved by the others' rounding.
"""

ENERGY_LANES = 8
"""States at which the energy is evaluated at a time, all of them the same."""

LEAST_NEGLIGIBLE = 1e-12
"""Part of a block's size that the error at a discontinuity of the field may always be."""


class Adaptive:
    """What adaptive steps of a plan have besides.

    Parameters
    ----------
    system : System
        What to integrate.
    plan : Plan
        With a tolerance.
    shape : Shape
        Of the memory.
    keeps : bool
        Whether line integrals keep something.

    Raises
    ------
    problems.errors.InputError
        For as many absolute tolerances as no state has components.
    """

    more: Mapping[str, int] = MappingProxyType({})
    """What further slots of the memory begin with."""

    def __init__(self, system: System, plan: Plan, shape: Shape, *, keeps: bool = False):
        from integrators.coefficients.legendre import (
            legendre,  # 50 digits, which take their time to be imported
        )

        assert plan.tol is not None
        self.system, self.plan, self.tol, k, s = system, plan, plan.tol, plan.k, plan.s
        self._timed = not system.traced or depends_on_time(system)
        self._absolute = self._sizes(shape, plan.atol)
        self._given, self._switches = np.array(sorted(set(plan.breakpoints)), float), Switches(system)
        c = shape.constants
        self._extrapolations = tables.extrapolations(c) if c.route > tables.THROUGH else aligned(0)
        self._degree = tolerance.degree_of_error(k, s)
        basis = legendre(c.arrays["nodes"].reshape(-1), k) * c.arrays["weights"].reshape(-1)[:, None]
        middle = max(1, (k - 4) // 2)
        degrees = [*tables.degrees_judged(k, s), min(middle, k - 1), min(middle + 1, k - 1)]
        rows = [*basis.T[degrees], *(basis @ legendre(np.array([0.0, 1.0]), k).T).T]
        self._estimators = aligned(len(rows) * 8 * -(-k // 8))
        self._estimators.reshape(len(rows), -1)[:, :k] = rows
        # As much as rounding accounts for, and without a bound on the quadrature what the tolerance allows.
        bounded = plan.quadrature_error is not None
        self._negligible = LEAST_NEGLIGIBLE if bounded else max(self.tol, LEAST_NEGLIGIBLE)
        surfaces = None
        if system.traced and not keeps:
            surfaces = sides(system.function("force" if shape.second else "field"), MOST_SURFACES)
        self._sides, self._surfaces = None, 0
        if surfaces is not None:
            self._sides = fields.compile_field(system, surfaces, tables.lanes_for(k))
            self._surfaces = len(surfaces.outputs) - 1
        self._energy = self._energy_code() if plan.projected else None
        if plan.projected:
            self.more = {"energy.rows": system.dim + 1}
        self.code = [self._sides, self._energy]
        self._line = 2.0 ** (-52.0 / middle) if k >= FEWEST else 0.0  # where degrees from that on vanish
        looks = detects_discontinuities(k, system) and not keeps
        self._doubt, self._slowest = _decays(k, self._degree, self.tol, middle, looks)

    @property
    def free(self) -> bool:
        """Whether nothing but the tolerance says where steps end, whatever the parameters."""
        plan = self.plan
        return (
            not plan.projected
            and plan.max_step is None
            and plan.max_steps is None
            and plan.atol is None
            and not self._given.size
            and not self._switches.any
            and self._sides is None
        )

    def _energy_code(self) -> binary.Native:
        """Return what writes the gradient of the energy and the energy itself."""
        energy = self.system.invariants["energy"]
        quantity = self.system.together(self.system.gradient(energy), energy)
        return fields.compile_field(self.system, quantity, ENERGY_LANES)

    def _sizes(self, shape: Shape, atol: float | Sequence[float] | None) -> Array:
        """Return an absolute tolerance as sizes that ``tol`` is relative to, one for each block."""
        sizes = np.full(shape.group.size, 0.0 if atol is None else math.inf)
        if atol is not None:
            if np.ndim(atol) and np.shape(atol) != (self.system.dim,):
                raise InputError(
                    f"atol has {np.size(atol)} numbers, and {self.system.name} {self.system.dim} components; "
                    "give one, or as many."
                )
            each = np.broadcast_to(np.asarray(atol, float), self.system.dim)[-shape.rows :]
            np.minimum.at(sizes, shape.block, each / self.tol)
        return sizes

    def limit(self, context: Context, interval: float) -> None:
        """Set the longest steps of a trajectory over an interval of a certain length; 0: unknown."""
        most = math.inf if self.plan.max_step is None else self.plan.max_step
        part = LONGEST * interval if interval > 0.0 else math.inf
        controller = context.controller.numbers
        controller.longest_constant = min(most, part)
        controller.longest = controller.longest_constant if self._timed else most

    def breakpoints(self, par: Array) -> Breakpoints:
        """Return the times that steps end at: those given, and those of the formulas."""
        return Breakpoints(self._given, self._switches, par)

    def description(self, solver: str, kept: str) -> str:
        """Return the method with all that steps depend on, as text."""
        plan = self.plan
        projected = ", projection='energy'" if plan.projected else ""
        return (
            f"HBVM(k={plan.k}, s={plan.s}, tol={self.tol!r}, defect={plan.quadrature_error!r}, h={plan.h!r}, "
            f"solver={solver!r}, max_step={plan.max_step!r}, breakpoints={self._given.tolist()!r}, "
            f"max_steps={plan.max_steps!r}, atol={plan.atol!r}{kept}{projected})"
        )

    def set(self, context: Context) -> None:
        """Set what fresh memory has of such steps."""
        plan, discontinuities = self.plan, context.discontinuities
        context.solver.log_residual = LOG_RESIDUAL_VARYING
        if self._energy:
            context.energy.code = self._energy
            context.energy.width = width_of_blocks(self.system)
            context.point({"energy.state_indices": context.shape.state_indices})
            context.solver.tolerance = max(PART_OF_TOLERANCE * self.tol, TOLERANCE)
            context.solver.log_residual = max(math.log2(context.solver.tolerance), LOG_RESIDUAL_VARYING)
        context.solver.trusted = min(TRUSTED * context.solver.tolerance, MOST_TRUSTED)
        context.solver.log_trusted = math.log2(UNTESTED * context.solver.tolerance)
        context.point({"estimate.estimators": self._estimators, "tables.extrapolation": self._extrapolations})
        context.varying = 1
        context.controller.error_degree = self._degree
        context.controller.allowed_error = self.tol
        bodies = getattr(self.system, "bodies", None) is not None
        context.estimate.least_slope = OF_A_BODY if bodies else OF_A_COMPONENT
        context.controller.allowed_quadrature_error = (
            math.inf if plan.quadrature_error is None else plan.quadrature_error
        )
        context.controller.error_aim = tolerance.aim(self.tol, self._degree)
        context.estimate.error_decay = tolerance.decay(self.tol, self._degree)
        if plan.quadrature_error is not None:
            last = plan.k - 1
            context.controller.quadrature_error_aim = tolerance.aim(plan.quadrature_error, last)
            context.estimate.quadrature_error_decay = tolerance.decay(plan.quadrature_error, last)
        discontinuities.doubt, discontinuities.slowest_decay = self._doubt, self._slowest
        discontinuities.negligible = self._negligible
        context.surfaces.code = self._sides
        context.surfaces.count = self._surfaces
        context.estimate.absolute[:] = self._absolute
        context.estimate.line, context.estimate.called = self._line, int(not self.system.traced)
        context.estimate.asks = int(plan.atol is None or np.any(np.greater(plan.atol, 0.0)))
        self.limit(context, 0.0)
        context.controller.stop = context.controller.length_limit = math.inf

    def renew(self, own: Context, par: Array) -> None:
        """Put what follows from parameters into the memory of a trajectory."""

    def begin(self, own: Context, y: Array, par: Array, t0: float) -> None:
        """Put what a trajectory from (t0, y) begins with into its memory."""
        own.discontinuities.numbers.doubt_end = t0


def _decays(k: int, m: int, tol: float, middle: int, looks: bool) -> tuple[float, float]:
    """Return `doubt` and `slowest_decay` of `Discontinuities`, which tell a smooth field from others.

    Where the error is the tolerance, coefficients of a smooth field fall off by
    ``tol^(1/2m)`` from one degree to the next. Those of a discontinuity fall off like 1/j^2, from the
    middle ones, of degrees ``middle`` and the next, to the last one. Infinite where
    nobody ``looks``.
    """
    if not looks:
        return math.inf, math.inf
    smooth, last = tolerance.decay(tol, m), k - 1
    at_discontinuity = ((middle + 0.5) / last) ** 2
    doubt = min(10.0 * smooth ** (last - min(3, m - 1)), 0.1 / last**2)
    return doubt, max(at_discontinuity / 4.0, 6.0 * smooth ** (last - middle - 1))
