"""The implicit solver's code for a system, and its memory for a trajectory."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.context import Shape
from integrators.kernel.implicit.constants import method, solver_of
from integrators.kernel.implicit.factors import Factors, is_dense
from integrators.kernel.implicit.groups import Groups
from integrators.kernel.implicit.memory import BLENDED, NEWTON, Corrections
from integrators.kernel.native import binary, stages, store
from integrators.kernel.native.field import BUILT_BY
from integrators.kernel.native.memory import aligned
from integrators.kernel.parts.implicit import ALWAYS_IMPLICIT, AUTO, FIXED_POINT
from integrators.kernel.tables import packed
from problems import targets
from problems.derive.jacobian import Jacobian
from problems.errors import InputError
from problems.systems.base import System

Integers = NDArray[np.int64]

LARGEST_DENSE = 64  # rows up to which the factors are dense and in the solver's memory
TARGET_CORRECTIONS = 20.0  # Newton corrections of a step to aim at, at most, where steps vary
LARGEST_WHOLE = 128  # rows up to which there is a matrix with a Jacobian for each stage


@dataclass(frozen=True, eq=False)
class Linearization:
    """A system's Jacobian as the solvers take it.

    Attributes
    ----------
    jacobian : Jacobian or None
        Its entries; ``None`` where it is taken by differences.
    code : Native or None
        ``void(t, y, par, entries)``, all of them addresses.
    pattern : tuple of ndarray, optional
        Rows and columns of the entries that are not zero, where they are taken by differences and known.
    """

    jacobian: Jacobian | None
    code: binary.Native | None
    pattern: tuple[Integers, Integers] | None = None

    def entry_indices(self, rows: int) -> tuple[Integers, Integers]:
        """Return the rows and the columns of the entries; by differences they are all of them."""
        if self.jacobian is not None:
            return self.jacobian.rows, self.jacobian.columns
        if self.pattern is not None:
            return self.pattern
        grid = np.indices((rows, rows)).reshape(2, -1)
        return grid[0], grid[1]


def linearization(system: System, *, second: bool) -> Linearization:
    """Compile the Jacobian of a system's field, or of its force, or load it."""
    jacobian = system.jacobian("force" if second else "field")
    if jacobian is None:
        return Linearization(None, None, system.sparsity)
    try:
        targets.compilable(system, jacobian)
    except InputError:  # differences take the field alone
        return Linearization(None, None)
    text = targets.source(system, jacobian, "numba").text
    name = store.key("jacobian", text, binary.sources(BUILT_BY))
    native = binary.obtain(
        name, lambda: (stages.ONE_BY_ONE, stages.build_one_by_one(targets.numba(system, jacobian).py_func, 1))
    )
    return Linearization(jacobian, native)


@dataclass(frozen=True)
class Solver:
    """Which nonlinear solver a method uses.

    Attributes
    ----------
    strategy : {FIXED_POINT, AUTO, ALWAYS_IMPLICIT}
        Of `integrators.kernel.context`.
    kind : {NEWTON, BLENDED} or None
        The implicit solver; ``None``: which one follows from the Jacobian.
    """

    strategy: int
    kind: int | None


SOLVERS = {
    "auto": Solver(AUTO, None),
    "fixed_point": Solver(FIXED_POINT, NEWTON),
    "newton": Solver(ALWAYS_IMPLICIT, NEWTON),
    "blended": Solver(ALWAYS_IMPLICIT, BLENDED),
}


class Workspace(Corrections):
    """The memory of a solver for the steps of one context, as Python sees it.

    Parameters
    ----------
    shape : Shape
        Of the context.
    kind : {NEWTON, BLENDED} or None
        How corrections are computed; beyond some degree they are blended. ``None``: blended with a sparse
        Jacobian, whose one real matrix is factored much faster than the complex ones of Newton's
        iteration, but for the second-order form, where the blended iteration converges slowly.
    linearization : Linearization
        The Jacobian, of R / copies rows.
    copies : int
        How many times it stands on the diagonal.
    padded : int, optional
        `Context.padded`; by default it follows from the rows.
    """

    def __init__(
        self,
        shape: Shape,
        kind: int | None,
        linearization: Linearization,
        copies: int = 1,
        padded: int | None = None,
    ):
        c = shape.constants
        unknowns = shape.rows // copies
        rows, columns = linearization.entry_indices(unknowns)
        if kind is None:
            sparse = unknowns > LARGEST_DENSE and not is_dense(rows.size, unknowns)
            kind = BLENDED if sparse and not shape.second else NEWTON
        m = method(c.k, c.s, shape.second, c.lanes, solver_of(c.s, kind))
        groups_of = Groups.of(rows, columns, unknowns) if linearization.code is None else Groups.none()
        pairs, whole = m.eigenvalues.size, c.s * unknowns
        padded = -(-shape.rows // 8) * 8 if padded is None else padded
        parts, groups, pair_groups = 2 if shape.second else 1, -(-c.s // 8), -(-pairs // 8)
        kept = 0 if unknowns > LARGEST_DENSE else pair_groups * unknowns
        whole = whole if whole <= LARGEST_WHOLE else 0
        weights = np.zeros(-(-c.k // c.lanes) * c.lanes)
        weights[: c.k] = c.arrays["weights"].reshape(-1)
        low = np.zeros((c.k, 8))
        low[:, : m.integrals_low.shape[1]] = m.integrals_low
        values = np.full(8 * pair_groups, m.eigenvalues[0])  # no lane's matrix is singular
        values[:pairs] = m.eigenvalues
        powers = values**2 if shape.second else values
        numbers = {
            "method": solver_of(c.s, kind), "rows": shape.rows,
            "copies": copies, "unknowns": unknowns, "padded": padded,
            "k": c.k, "s": c.s, "dim": shape.dim, "entry_count": rows.size,
            **groups_of.numbers, "parts": parts, "groups": groups, "block": 8 * groups * padded,
            "pair_groups": pair_groups, "wide": 16 * pair_groups * padded,
            "lu_rows": kept, "lu_size": 16 * kept * unknowns,
            "whole": whole, "whole_size": whole * -(-whole // 8) * 8,
            "trial_size": c.lanes * (1 + 2 * padded), "radius": m.radius,
        }  # fmt: skip
        tables: dict[str, Any] = {
            "stage_table": packed(np.hstack([low, m.integrals]), repeat=True),
            "projection": packed(c.arrays["projection"]),
            "basis": packed(m.basis, repeat=True),
            "weights": weights,
            "integrals": m.integrals, "force_integrals": m.integrals @ m.x if shape.second else m.integrals,
            "moments": c.arrays["projection"],
            "left": packed(_in_eights(m.left)), "right": packed(_in_eights(m.right.T.conj()).T),
            "eigen": _in_eights(values), "powers": _in_eights(powers),
            "x": m.x, "derivatives": packed(m.x), "inverse": packed(m.eigenvalues[0].real * m.inverse),
            "entry_rows": rows, "entry_columns": columns, **groups_of.tables,
        }  # fmt: skip
        arrays = {name: np.ascontiguousarray(array) for name, array in tables.items()}
        super().__init__(numbers, arrays, {"source": linearization.code})
        self.kind, self.linearization = kind, linearization
        self.traced = linearization.jacobian is not None
        """Whether the Jacobian is traced, or taken by differences."""
        self._values = m.eigenvalues ** (2 if shape.second else 1)
        self._find_factors()

    def _find_factors(self) -> None:
        self.external_factors = None if self.lu_rows else Factors(self, self._values)
        """What keeps the factors, where they are not dense and small."""
        self.factors = self.external_factors

    def along(self, shape: Shape, padded: int, pulls: NDArray[np.float64] | None) -> "Workspace":
        """Return memory for tangent vectors along the trajectory that this is the memory of.

        Parameters
        ----------
        shape : Shape
            Of the vectors' context.
        padded : int
            Of the same.
        pulls : ndarray or None
            Relative derivatives of velocities, by row; ``None``: they are 0.
        """
        workspace = Workspace(shape, self.kind, self.linearization, shape.rows // self.rows, padded)
        workspace.first, workspace.trajectory, workspace.pulls = shape.rows, self, pulls
        return workspace

    def copy(self) -> Self:
        """Return memory of its own, with factors of its own."""
        other = super().copy()
        other._find_factors()
        return other

    @property
    def target_corrections(self) -> float:
        """Corrections of a step to aim at, at most."""
        return np.inf if self.method == BLENDED else TARGET_CORRECTIONS

    @property
    def name(self) -> str:
        """Of the iteration."""
        return "blended" if self.method == BLENDED else "Newton"

    def save(self) -> tuple[Any, ...]:
        """Return copies of all that the continuation depends on."""
        return self.lasting()

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what `save` returned; the counters of the work done keep counting."""
        self.go_on(*saved)
        self.factored = 0

    def forget(self) -> None:
        """Forget the previous steps; the counters of the work done keep counting."""
        self.words[list(self.lasting_words.values())] = 0
        self.factored = 0

    def raise_what_is_no_failure(self) -> None:
        """Raise what stopped a factorization, unless that is a singular matrix: Ctrl-C, no memory left."""
        if self.external_factors is not None and self.external_factors.error is not None:
            error, self.external_factors.error = self.external_factors.error, None
            if not isinstance(error, (ArithmeticError, RuntimeError, ValueError)):
                raise error


def _in_eights(rows: Any) -> Any:
    """Return eight real parts, eight imaginary ones and so on, of numbers or of the rows of a matrix."""
    shape = (-(-len(rows) // 8), 8, *rows.shape[1:])
    padded: Any = np.zeros((shape[0] * 8, *rows.shape[1:]), dtype=complex)
    padded[: len(rows)] = rows
    parts = np.stack([padded.real.reshape(shape), padded.imag.reshape(shape)], axis=1)
    flat = aligned(parts.size)
    flat[:] = parts.reshape(-1)
    return flat.reshape(-1, *rows.shape[1:])


def report(own: Workspace, part: Workspace) -> dict[str, Any]:
    """Return what the solvers of own and of partial steps have done, for `Stats.extra`."""
    return {
        "jacobians": own.jacobians + part.jacobians,
        "jacobian": "traced" if own.traced else "differences",
        "factorizations": own.factorizations + part.factorizations,
        "corrections": own.corrections + part.corrections,
        "rescues": own.full_newton + part.full_newton,
        "partial_jacobians": part.jacobians,
        "partial_corrections": part.corrections,
    }
