"""What a line integral keeps: the functions and the memory that a program needs for it."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.context import Context, Shape
from integrators.kernel.engines import line
from integrators.kernel.line.context import INVARIANTS, POISSON, LineContext
from integrators.kernel.line.dependence import independent
from integrators.kernel.line.pattern import Pattern
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
        functions = [function_of(system, name) for name in invariants]
        self.names = [part for name in invariants for part in system.components(name)]
        whole = [name.partition("[")[0] for name in self.names]
        self._on_manifold = [name in system.on_manifold for name in whole]
        self._derived = [name in system.derived for name in whole]
        self._independent = np.array([name in system.independent for name in whole], dtype=bool)
        n, dim = len(self.names), system.dim
        self.code = [line.code()]
        pattern = Pattern.of(system, [])
        if n:
            assert system.field is not None  # LineIntegral refuses code
            slopes = [system.slopes(name) for name in invariants]
            pattern = Pattern.of(system, slopes)
            entries = [part.function for part in slopes]
            # Forces of constraints cancel others, and rounding is a part of each
            sizes = [with_sizes(system.field).part(dim, 2 * dim)] if system.on_manifold else []
            self.values = system.together(system.field, *entries, *sizes)
            measure = system.together(*entries, *functions)
            self.code.append(compile_field(system, measure, constants.lanes))
        else:
            assert isinstance(system, Poisson)
            self.values = system.together(system.slope, system.structure)
        self._pattern = pattern
        basis = legendre(constants.arrays["nodes"].reshape(-1), constants.s)
        self._tables: dict[str, NDArray[Any]] = {
            "onto": packed(constants.arrays["projection"]), "back": packed(basis, repeat=True),
            **pattern.tables,
        }  # fmt: skip
        self._numbers = {
            "mode": INVARIANTS if n else POISSON,
            "invariants": n,
            "entries": pattern.count,
            "pairs": len(pattern.tables["pair_first"]) - 1,
            "lower_entries": len(pattern.tables["lower_column"]),
            "every": dim + pattern.count + max(dim, n) if n else dim * (1 + dim),
            "sized": int(bool(system.on_manifold)),
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
        partial.point({"blocks.terms": own.blocks.terms})

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
        if not math.isfinite(culprit.change_rate):
            return (
                f"the rate of change of {self.names[culprit.culprit]} is not finite in the step from "
                f"t = {t!r}; take units in which it is in the range of doubles."
            )
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
            own.active[:] = independent(
                self.system, self.values, self._pattern, own.metric, y, par, t0, self._independent
            )


def function_of(system: System, name: str) -> Function:
    """Return an invariant, or one component of it.

    Raises
    ------
    problems.errors.InputError
        If there is none of this name, or it depends on time.
    """
    parts = system.components(name)
    if any(node.flags & T for function in parts.values() for node in function.roots):
        raise InputError(f"the invariant {name!r} of {system.name} depends on time; leave it out.")
    return system.invariants.get(name) or parts[name]


def metric_of(system: System, par: Array) -> Array:
    """Return the diagonal of W: for H = sum c p^2/2 + V, c with q and 1/c with p; otherwise 1.

    With masses m, c = 1/m: corrections are then accelerations of one size for light
    and heavy bodies alike. W does not depend on the state, so the method is symmetric.
    """
    free = getattr(system, "free", system)
    if free.separable and system.dof is not None:
        c = targets.numpy(free, "velocity_scale")(0.0, np.zeros(system.dim), par)
        if np.isfinite(c).all() and (c > 0.0).all():
            return np.concatenate([c, 1.0 / c])
    return np.ones(system.dim)
