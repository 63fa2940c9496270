"""What a line integral keeps: the functions and the memory that a program needs for it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.context import Context, Shape
from integrators.kernel.engines import line
from integrators.kernel.line.context import INVARIANTS, POISSON, LineContext
from integrators.kernel.line.dependence import independent
from integrators.kernel.native.field import compile_field
from integrators.kernel.tables import Constants, packed
from integrators.protocol import Array
from problems import targets
from problems.analysis.sizes import with_sizes
from problems.derive.function import Function
from problems.errors import InputError
from problems.graph.nodes import T
from problems.problem import System
from problems.systems.poisson import Poisson

KEPT = (
    "reference", "owed", "active", "gradients", "alpha", "legendre", "largest", "lost", "first_loss"
)  # fmt: skip
"""Arrays of a `LineContext` that the steps ahead depend on."""


class Kept:
    """Several invariants of a system, or the energy of a Poisson system.

    Parameters
    ----------
    system : System
        What is integrated.
    constants : Constants
        The method's.
    invariants : sequence of str
        What is kept, by name; ``name[i]`` for one component of a vector. None for
        a Poisson system's own energy, by coefficients of its own.

    Raises
    ------
    problems.errors.InputError
        For an invariant that the system does not have, or that depends on time.
    """

    def __init__(self, system: System, constants: Constants, invariants: Sequence[str]):
        from integrators.coefficients.legendre import (
            legendre,  # 50 digits, which take their time to be imported
        )

        self.system = system
        scalars = {part: scalar for name in invariants for part, scalar in components(system, name).items()}
        self.names = list(scalars)
        whole = [name.partition("[")[0] for name in self.names]
        self._on_manifold = [name in system.on_manifold for name in whole]
        self._derived = [name in system.derived for name in whole]
        n, dim = len(self.names), system.dim
        self.code = [line.code()]
        if n:
            assert system.field is not None  # LineIntegral refuses code
            gradients = [system.gradient(scalar) for scalar in scalars.values()]
            self.values = system.together(system.field, *gradients)
            sizes = with_sizes(system.field).part(dim, 2 * dim)
            measure = system.together(*gradients, *scalars.values(), sizes)
            self.code.append(compile_field(system, measure, constants.lanes))
        else:
            assert isinstance(system, Poisson)
            self.values = system.together(system.slope, system.structure)
        basis = legendre(constants.arrays["nodes"].reshape(-1), constants.s)
        order, ends = order_of_sums(system)
        self._tables: dict[str, NDArray[Any]] = {
            "onto": packed(constants.arrays["projection"]), "back": packed(basis, repeat=True),
            "order": order, "ends": ends,
        }  # fmt: skip
        self._numbers = {
            "mode": INVARIANTS if n else POISSON,
            "invariants": n,
            "every": dim * n + dim + n if n else dim * (1 + dim),
            "coefficient_groups": -(-constants.s // 8),
        }

    @property
    def description(self) -> str:
        """What is kept, as text."""
        return f"invariants={self.names!r}" if self.names else "Poisson form"

    def context(self, shape: Shape, tables: dict[str, Array]) -> LineContext:
        """Return fresh memory for a trajectory."""
        pointers = {"line": self.code[0], "measure": self.code[-1]}
        return LineContext(shape, tables, self._numbers, self._tables, pointers)

    def share(self, own: Context, partial: Context) -> None:
        """Let partial steps keep what the steps do."""
        for name in ("active", "owed", "metric", "on_manifold", "derived") if self.names else ():
            partial.point({name: getattr(own, name)})

    @property
    def arrays(self) -> tuple[str, ...]:
        """What a checkpoint holds of it, by the names in `LineContext`."""
        return KEPT if self.names else ()

    def report(self, context: Any) -> dict[str, Any]:
        """Return what `stats.extra` says of a trajectory."""
        if not self.names:
            return {}
        seen = zip(context.first_loss.tolist(), context.lost.tolist(), context.largest.tolist(), strict=True)
        return {
            "lost": {name: loss for name, loss in zip(self.names, seen, strict=True) if loss[1] > 0.0},
            "left_out": [name for name, on in zip(self.names, context.active, strict=True) if not on],
        }

    def refusal(self, contexts: tuple[Any, Any], t: float) -> str:
        """Return why the step from t has ended as `NOT_KEPT`: the step of a pair of contexts, or a part."""
        culprit = next(context for context in contexts if context.change_rate != 0.0)
        return (
            f"{self.names[culprit.culprit]} is not an invariant: in the step from t = {t!r} the terms of its "
            f"rate of change do not cancel, but leave {culprit.change_rate:.1e} of their size; leave it out."
        )

    def load(self, contexts: tuple[Any, Any], y: Array, par: Array, t0: float) -> None:
        """Put into a pair of contexts what follows from the start (t0, y) and from the parameters."""
        own, partial = contexts
        own.change_rate = partial.change_rate = 0.0
        if self.names:
            own.largest[:] = own.lost[:] = own.first_loss[:] = 0.0
            own.on_manifold[:], own.derived[:] = self._on_manifold, self._derived
            own.metric[:] = metric_of(self.system, par)
            own.active[:] = independent(self.system, self.values, own.metric, y, par, t0)


def components(system: System, name: str) -> Mapping[str, Function]:
    """Return the scalars that an invariant consists of, as `System.components` does.

    Raises
    ------
    problems.errors.InputError
        If there is none of this name, or it depends on time.
    """
    functions = system.components(name)
    if any(node.flags & T for function in functions.values() for node in function.roots):
        raise InputError(f"the invariant {name!r} of {system.name} depends on time; leave it out.")
    return functions


def metric_of(system: System, par: Array) -> Array:
    """Return the diagonal of W: for H = sum c p^2/2 + V, c with q and 1/c with p; otherwise 1.

    With masses m, c = 1/m: corrections are then accelerations of one size for light
    and heavy bodies alike. W does not depend on the state, so the method is symmetric.
    """
    if system.separable and system.dof is not None:
        c = targets.numpy(system, "velocity_scale")(0.0, np.zeros(system.dim), par)
        if np.isfinite(c).all() and (c > 0.0).all():
            return np.concatenate([c, 1.0 / c])
    return np.ones(system.dim)


def order_of_sums(system: System) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the order in which components are summed up, and where its partial sums end.

    The same coordinate of all bodies, body by body, makes a partial sum: in an
    odd sum over two bodies that mirror each other it is exactly 0. Without bodies,
    positions and momenta make one each.
    """
    indices = np.arange(system.dim)
    if system.bodies is not None and system.dof is not None:
        groups = list(
            indices.reshape(2, -1, system.bodies.dimension)
            .transpose(0, 2, 1)
            .reshape(2 * system.bodies.dimension, -1)
        )
    else:
        groups = np.array_split(indices, 1 if system.dof is None else 2)
    ends = [np.arange(group.size) == group.size - 1 for group in groups]
    return np.concatenate(groups).astype(np.int64), np.concatenate(ends).astype(np.int64)
