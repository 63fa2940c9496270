"""The implicit solver's code for a system, and its memory for a trajectory."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.context import Shape
from integrators.kernel.implicit.constants import BLENDED, NEWTON, method, solver_of
from integrators.kernel.implicit.factors import Factors
from integrators.kernel.native import binary, store
from integrators.kernel.native import field as fields
from integrators.kernel.native.memory import Array, Integer, Memory, Real, Table, aligned
from integrators.kernel.parts.implicit import ALWAYS_IMPLICIT, AUTO, FIXED_POINT
from integrators.kernel.tables import packed
from problems import emit
from problems.calculus.jacobian import Jacobian
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
    """

    jacobian: Jacobian | None
    code: binary.Native | None

    @property
    def address(self) -> int:
        """Of the code; 0 for differences."""
        return 0 if self.code is None else self.code.address

    def entry_indices(self, rows: int) -> tuple[Integers, Integers]:
        """Return the rows and the columns of the entries; by differences they are all of them."""
        if self.jacobian is not None:
            return self.jacobian.rows, self.jacobian.columns
        grid = np.indices((rows, rows)).reshape(2, -1)
        return grid[0], grid[1]


def linearization(system: System, *, second: bool) -> Linearization:
    """Compile the Jacobian of a system's field, or of its force, or load it."""
    jacobian = system.jacobian("force" if second else "field")
    if jacobian is None:
        return Linearization(None, None)
    try:
        emit.compilable(system, jacobian)
    except InputError:  # differences take the field alone
        return Linearization(None, None)
    text = emit.source(system, jacobian, "numba").text
    name = store.key("jacobian", text, binary.sources(*fields.SOURCES))
    native = binary.obtain(
        name, lambda: (fields.ONE_BY_ONE, fields.build_one_by_one(emit.numba(system, jacobian).py_func, 1))
    )
    return Linearization(jacobian, native)


@dataclass(frozen=True)
class Solver:
    """Which nonlinear solver a method uses.

    Attributes
    ----------
    strategy : {FIXED_POINT, AUTO, ALWAYS_IMPLICIT}
        Of `integrators.kernel.context`.
    kind : {NEWTON, BLENDED}
        The implicit solver.
    """

    strategy: int
    kind: int


SOLVERS = {
    "auto": Solver(AUTO, NEWTON),
    "fixed_point": Solver(FIXED_POINT, NEWTON),
    "newton": Solver(ALWAYS_IMPLICIT, NEWTON),
    "blended": Solver(ALWAYS_IMPLICIT, BLENDED),
}


class Workspace(Memory):
    """The memory of a solver for the steps of one context: degree s, R rows, p pairs of eigenvalues of X_s.

    There are R unknowns of each degree, and in the second-order form 2 R, in two blocks: the
    coefficients of q' and then those of p'; see `integrators.kernel.implicit.stages`. Tables are packed as
    in `integrators.kernel.tables`. The rows of tangent vectors along a trajectory are ``copies`` of its rows,
    for which its Jacobian holds; the trajectory's stages follow theirs.

    Parameters
    ----------
    shape : Shape
        Of the context.
    kind : {NEWTON, BLENDED}
        How corrections are computed; beyond some degree they are blended.
    linearization : Linearization
        The Jacobian, of R / copies rows.
    copies : int
        How many times it stands on the diagonal.
    padded : int, optional
        `Context.padded`; by default it follows from the rows.
    """

    method = Integer()  # how corrections are computed: NEWTON, BLENDED
    source = Integer()  # address of the Jacobian, void(t, y, par, entries); 0 for differences
    factors = Integer()  # address of what keeps the factors, int64(operation, pair); 0: they are here
    rows = Integer()
    copies = Integer()
    unknowns = Integer()  # rows of a copy
    first = Integer()  # row of the stages at which the Jacobian's state begins
    trajectory = Integer()  # address of the solver's memory that the Jacobian is taken from; 0: of none
    pulls = Integer()  # address of relative derivatives of velocities, by row; 0: none
    padded = Integer()
    k = Integer()
    s = Integer()
    dim = Integer()
    parts = Integer()  # blocks of coefficients: 2 in the second-order form
    groups = Integer()  # of eight coefficients
    block = Integer()  # doubles in a block
    pair_groups = Integer()  # of eight pairs of eigenvalues
    wide = Integer()  # doubles that such a group's vectors take, in all groups
    entry_count = Integer()
    factored = Integer()  # 1: the factors are those of the entries and of `factored_h`
    lu_size = Integer()
    lu_rows = Integer()
    whole = Integer()  # s R, rows of a matrix with a Jacobian for each stage; 0 if that is too large
    whole_size = Integer()
    trial_size = Integer()

    # --- of the method ---
    stage_table = Array()  # coefficients to stages, the low parts of its first columns before it
    projection = Array()  # values -> coefficients
    basis = Array()  # coefficients -> the polynomial at the nodes
    weights = Array()  # of the stages in a mean, one per lane of stage memory
    integrals = Table("k", "s")  # the stage table
    force_integrals = Table("k", "s")  # the same; in the second-order form times X_s
    moments = Table("s", "k")  # the projection
    left = Array()  # rows of the inverse of the eigenvectors' matrix, eight real parts, eight imaginary ones
    right = Array()  # eigenvectors, in the same way, twice where a conjugate belongs to them
    eigen = Array()  # eigenvalues: eight real parts, eight imaginary ones
    powers = Array()  # the same; in the second-order form their squares
    x = Table("s", "s")  # X_s
    derivatives = Array()  # X_s, packed
    inverse = Array()  # rho X_s^{-1}, of blended iteration
    radius = Real()  # part of X_s in a fixed-point iteration's contraction: its spectral radius, or squared

    # --- the unknowns ---
    gamma = Array("parts", "block")
    increment = Table("dim")  # h gamma_0, what the step adds to the state
    predicted = Array("parts", "block")
    residual = Array("parts", "block")
    correction = Array("parts", "block")
    moving = Array("parts", "block", 2)  # coefficients in front of the stage table
    factor = Table("rows")  # h, or h^2 q'/p in the second-order form
    slope_weights = Table("rows")  # 1 / size of a row's block in h q', second-order form
    floored_slope_weights = Table("rows")  # small blocks raised
    predict = Integer()  # 1: the extrapolated start is nearer than the constant one
    change = Real()  # of the last correction
    rate = Real()  # by which corrections have contracted with this Jacobian; 1 where that is not known
    contraction = Real()  # by which one fixed-point iteration contracts, an estimate ...
    contraction_h = Real()  # ... of a step of this length

    # --- the Jacobian and the factors ---
    entry_rows = Table("entry_count", kind=int)
    entry_columns = Table("entry_count", kind=int)
    entries = Table("entry_count")
    state = Table("unknowns")  # where the Jacobian is taken
    lu = Array("lu_size")  # factors of eight matrices at a time; see `integrators.kernel.implicit.linear`
    pivots = Array("lu_rows", kind=int)
    begins = Array("lu_rows", kind=int)
    ends = Array("lu_rows", kind=int)
    whole_matrix = Array("whole_size")
    whole_x = Array("whole")
    linearized = Integer()  # 1: the entries are those at `state`
    stale = Integer()  # 1: take a new Jacobian at the next step
    since = Integer()  # steps since the Jacobian was taken
    factored_h = Real()  # length of the step that the factors are for

    # --- room ---
    slopes = Table("unknowns")
    next_slopes = Table("unknowns")
    v = Array("parts", "wide")  # vectors of the first-order form, one for each pair
    b = Array(16, "padded")  # right-hand sides and solutions of eight systems
    trial = Array("trial_size")  # one block of stages, its times, and the field there

    # --- counters ---
    tried = Integer()
    corrections = Integer()
    jacobians = Integer()
    factorizations = Integer()
    full_newton = Integer()

    def __init__(
        self,
        shape: Shape,
        kind: int,
        linearization: Linearization,
        copies: int = 1,
        padded: int | None = None,
    ):
        c = shape.constants
        m = method(c.k, c.s, shape.second, c.lanes, solver_of(c.s, kind))
        unknowns = shape.rows // copies
        rows, columns = linearization.entry_indices(unknowns)
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
            "method": solver_of(c.s, kind), "source": linearization.address, "rows": shape.rows,
            "copies": copies, "unknowns": unknowns, "padded": padded,
            "k": c.k, "s": c.s, "dim": shape.dim, "entry_count": rows.size,
            "parts": parts, "groups": groups, "block": 8 * groups * padded,
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
            "entry_rows": rows, "entry_columns": columns,
        }  # fmt: skip
        super().__init__(numbers, {name: np.ascontiguousarray(array) for name, array in tables.items()})
        self.kind, self.linearization = kind, linearization
        self.traced = linearization.jacobian is not None
        """Whether the Jacobian is traced, or taken by differences."""
        self._values = m.eigenvalues ** (2 if shape.second else 1)
        self._find_factors()

    def _find_factors(self) -> None:
        self.external_factors = None if self.lu_rows else Factors(self, self._values)
        """What keeps the factors, where they are not dense and small."""
        self.factors = 0 if self.external_factors is None else self.external_factors.address

    def along(self, shape: Shape, padded: int, pulls: int) -> "Workspace":
        """Return memory for tangent vectors along the trajectory that this is the memory of.

        Parameters
        ----------
        shape : Shape
            Of the vectors' context.
        padded : int
            Of the same.
        pulls : int
            Address of relative derivatives of velocities, or 0.
        """
        workspace = Workspace(shape, self.kind, self.linearization, shape.rows // self.rows, padded)
        workspace.first, workspace.trajectory, workspace.pulls = shape.rows, self.address, pulls
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
        return self.words[_LASTING], self.increment.copy(), self.entries.copy()

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what `save` returned; the counters of the work done keep counting."""
        self.words[_LASTING], self.increment[:], self.entries[:] = saved
        self.factored = 0

    def forget(self) -> None:
        """Forget the previous steps; the counters of the work done keep counting."""
        self.words[_LASTING] = 0
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


# What goes from step to step, but for the factors, which follow from the Jacobian's entries.
_LASTING = [
    slot.index
    for slot in (
        Workspace.linearized, Workspace.stale, Workspace.predict, Workspace.since, Workspace.factored_h,
        Workspace.change, Workspace.rate, Workspace.contraction, Workspace.contraction_h,
    )
]  # fmt: skip


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
