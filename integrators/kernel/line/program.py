"""A line integral method compiled for one system: a `Program` over the compiled steps."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators.kernel.context import blocks
from integrators.kernel.line.dependence import independent
from integrators.kernel.line.engine import steps
from integrators.kernel.line.memory import INVARIANTS, POISSON, Trajectory
from integrators.kernel.line.stepper import LineStepper, VaryingLineStepper
from integrators.kernel.native import binary
from integrators.kernel.native import field as fields
from integrators.kernel.stepper import HBVMStepper
from integrators.legendre import tables
from integrators.protocol import Array, Compiled, check_parameters, check_start, check_state
from problems import emit
from problems.errors import InputError
from problems.problem import System
from problems.trace.graph import T


class LineProgram(Compiled):
    """A line integral method with k stages and degree s, compiled for one system.

    Parameters
    ----------
    system : System
        What to integrate.
    k, s : int
        Stages and degree, k >= s >= 1.
    h : float or None
        Length of a step, > 0; the first one's, if there is a ``tol``.
    tol : float, optional
        Local error per step, relative to the size of each block of the state.
    invariants : sequence of str
        What is kept, by name; ``name[i]`` for one component of a vector. None for
        a Poisson system's own energy, by coefficients of its own.

    Raises
    ------
    problems.errors.InputError
        For an invariant that the system does not have, or that depends on time.
    """

    def __init__(
        self,
        system: System,
        *,
        k: int,
        s: int,
        h: float | None = None,
        tol: float | None = None,
        invariants: Sequence[str] = (),
    ):
        started = binary.clock()
        self.system = system
        self.k, self.s, self.h, self.tol = k, s, h, tol
        self.first, self.max_step, self.max_steps, self.breakpoints = h, None, None, np.empty(0)
        self.mode = INVARIANTS if invariants else POISSON
        self.components = [part for name in invariants for part in components(system, name)]
        if self.mode == POISSON:
            parts = [fields.compile_field(system, "gradient, structure", 1)]
            self.values = 0
        else:
            what = ", ".join(["field", *(f"gradient:{name}" for name in self.components)])
            parts = [
                fields.compile_field(system, what, 1),
                fields.compile_field(system, ", ".join(f"invariant:{name}" for name in self.components), 1),
            ]
            self.values = parts[1].address
            self.slopes = what
        self.field = parts[0].address
        parts.append(steps.code())
        self.block, self.group = blocks(system)
        self.order, self.ends = order_of_sums(system)
        self.tables = _shared(k, s)
        self.from_cache = all(part.from_cache for part in parts)
        self.compile_seconds = binary.clock() - started

    @property
    def description(self) -> str:
        """The method with all that steps depend on, as text."""
        kept = f"invariants={self.components!r}" if self.components else "Poisson form"
        return f"LineIntegral(k={self.k}, s={self.s}, h={self.h!r}, tol={self.tol!r}, {kept})"

    def start(self, y0: ArrayLike, par: ArrayLike | None = None, t0: float = 0.0) -> HBVMStepper:
        """Return a stepper at ``t0``; ``par`` defaults to the system's own parameters.

        Raises
        ------
        problems.errors.InputError
            If ``y0`` is not finite, or ``y0`` or ``par`` is not of the system's length.
        """
        values = check_parameters(par, self.system)
        kind: Any = LineStepper if self.tol is None else VaryingLineStepper
        return kind(self, check_state(y0, self.system.dim), values, check_start(t0))

    def memory(self, y: Array, par: Array, t0: float) -> Trajectory:
        """Return the memory of a trajectory that starts at (t0, y)."""
        dim, n = y.size, len(self.components)
        numbers = {
            "mode": self.mode, "field": self.field, "values": self.values,
            "k": self.k, "s": self.s, "dim": dim, "invariants": n,
            "row": dim * (1 + (n if self.mode == INVARIANTS else dim)), "width": dim * (1 + n),
            "after": self.s + 1, "rows": max(2, n), "blocks": self.group.size,
            "tolerance": self.tol or 0.0, "length_limit": np.inf,
        }  # fmt: skip
        metric = metric_of(self.system, par)
        given: dict[str, Any] = {
            "par": par, **self.tables, "metric": metric,
            "order": self.order, "ends": self.ends, "block": self.block, "group": self.group,
        }  # fmt: skip
        if n:
            given["active"] = independent(self.system, self.slopes, metric, y, par, t0).astype(np.int64)
        return Trajectory(numbers, {name: np.ascontiguousarray(array) for name, array in given.items()})


def components(system: System, name: str) -> list[str]:
    """Return the scalars that an invariant consists of, as ``name`` or ``name[0]``, ``name[1]``, ...

    Raises
    ------
    problems.errors.InputError
        If there is none of this name, or it depends on time.
    """
    function = system.function(f"invariant:{name}")
    if any(term.node.flags & T for terms in function.outputs for term in terms):
        raise InputError(f"the invariant {name!r} of {system.name} depends on time; leave it out.")
    if len(function.outputs) == 1:
        return [name]
    return [f"{name}[{i}]" for i in range(len(function.outputs))]


def metric_of(system: System, par: Array) -> Array:
    """Return the diagonal of W: for H = sum c p^2/2 + V, c with q and 1/c with p; otherwise 1.

    With masses m, c = 1/m: corrections are then accelerations of one size for light
    and heavy bodies alike. W does not depend on the state, so the method is symmetric.
    """
    if system.separable and system.dof is not None:
        c = emit.numpy(system, "velocity_scale")(0.0, np.zeros(system.dim), par)
        if np.isfinite(c).all() and (c > 0.0).all():
            return np.concatenate([c, 1.0 / c])
    return np.ones(system.dim)


def order_of_sums(system: System) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the order in which components are summed up, and where its partial sums end.

    The same coordinate of all bodies, body by body, makes a partial sum: in an
    odd sum over two bodies that mirror each other it is exactly 0. Without bodies,
    positions and momenta make one each.
    """
    places = np.arange(system.dim)
    if system.bodies is not None and system.dof is not None:
        groups = list(
            places.reshape(2, -1, system.bodies.dimension)
            .transpose(0, 2, 1)
            .reshape(2 * system.bodies.dimension, -1)
        )
    else:
        groups = np.array_split(places, 1 if system.dof is None else 2)
    ends = [np.arange(group.size) == group.size - 1 for group in groups]
    return np.concatenate(groups).astype(np.int64), np.concatenate(ends).astype(np.int64)


@lru_cache(maxsize=64)
def _shared(k: int, s: int) -> dict[str, Array]:
    """Return the tables of HBVM(k, s) by their names in `Trajectory`."""
    table = tables(k, s)
    projection = np.zeros((s + 1, k))
    projection[:s] = table.projection.hi
    if k > s:
        projection[s] = tables(k, s + 1).projection.hi[s]
    return {
        "nodes": table.nodes.hi, "nodes_low": table.nodes.lo,
        "weights": table.weights.hi, "weights_low": table.weights.lo,
        "integrals": table.integrals.hi, "basis": table.basis.hi, "projection": projection,
    }  # fmt: skip
