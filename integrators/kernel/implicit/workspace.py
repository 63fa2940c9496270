"""The implicit solver's code for a system, and its memory for a trajectory."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.kernel import layout
from integrators.kernel.context import Shape
from integrators.kernel.implicit import layout as of
from integrators.kernel.implicit.constants import Method, method, solver_of
from integrators.kernel.implicit.factors import Factors
from integrators.kernel.native import binary as native
from integrators.kernel.native import field as fields
from integrators.kernel.native import store
from integrators.kernel.tables import aligned, packed
from problems import emit
from problems.calculus.jacobian import Jacobian, jacobian
from problems.errors import InputError
from problems.systems.base import System

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

LARGEST_DENSE = 64  # rows up to which the factors are dense and in the solver's memory
LARGEST_WHOLE = 128  # rows up to which there is a matrix with a Jacobian for each stage

# The modules whose code is in the solver: an edit of any of them makes another one.
SOURCES = ("simd", "native", "layout", "step", "line", "implicit")


@lru_cache(maxsize=1)
def solver() -> native.Native:
    """Return the solver's C function ``int64(context, memory, started)``, compiled or loaded."""

    def make() -> tuple[str, bytes]:
        from integrators.kernel.implicit import entry  # imports numba

        return " ", entry.build()

    return native.obtain(store.key("implicit solver", native.sources(*SOURCES)), make)


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
    code: native.Native | None

    @property
    def address(self) -> int:
        """Of the code; 0 for differences."""
        return 0 if self.code is None else self.code.address

    def places(self, rows: int) -> tuple[Integers, Integers]:
        """Return the rows and the columns of the entries; by differences they are all of them."""
        if self.jacobian is not None:
            return self.jacobian.rows, self.jacobian.columns
        grid = np.indices((rows, rows)).reshape(2, -1)
        return grid[0], grid[1]


def linearization(system: System, *, second: bool) -> Linearization:
    """Compile the Jacobian of a system's field, or of its force, or load it."""
    what = "jacobian:force" if second else "jacobian"
    found = jacobian(system, what)
    if found is None:
        return Linearization(None, None)
    try:
        emit.compilable(system, what)
    except InputError:  # differences take the field alone
        return Linearization(None, None)
    text = emit.source(system, what, "numba").text
    name = store.key("jacobian", text, native.sources(*fields.SOURCES))
    made = native.obtain(
        name, lambda: (fields.ONE_BY_ONE, fields.build_one_by_one(emit.numba(system, what).py_func, 1))
    )
    return Linearization(found, made)


@dataclass(frozen=True)
class Solver:
    """Which nonlinear solver a method uses.

    Attributes
    ----------
    strategy : {FIXED_POINT, AUTO, ALWAYS_IMPLICIT}
        Of `integrators.kernel.layout`.
    kind : {NEWTON, BLENDED}
        The implicit solver.
    """

    strategy: int
    kind: int


SOLVERS = {
    "auto": Solver(layout.AUTO, of.NEWTON),
    "fixed_point": Solver(layout.FIXED_POINT, of.NEWTON),
    "newton": Solver(layout.ALWAYS_IMPLICIT, of.NEWTON),
    "blended": Solver(layout.ALWAYS_IMPLICIT, of.BLENDED),
}


class Workspace:
    """The memory of a solver for the steps of one context.

    Parameters
    ----------
    shape : Shape
        Of the context.
    kind : {NEWTON, BLENDED}
        How corrections are computed; beyond some degree they are blended.
    linearization : Linearization
        The Jacobian.

    Attributes
    ----------
    count, real : ndarray
        See `integrators.kernel.implicit.layout`.
    increment : ndarray, shape (dim,)
        What the solved step adds to the state.
    traced : bool
        Whether the Jacobian is traced, or taken by differences.
    factors : Factors or None
        What keeps the factors, where they are not dense and small.
    """

    def __init__(self, shape: Shape, kind: int, linearization: Linearization):
        c = shape.constants
        kind = solver_of(c.s, kind)
        self.method: Method = method(c.k, c.s, shape.second, c.lanes, kind)
        elsewhere = shape.rows > LARGEST_DENSE
        self._kept = _arrays(shape, self.method, linearization.places(shape.rows), elsewhere)
        self.count: Integers = self._kept["count"]
        self.real: Array = self._kept["real"]
        self.increment: Array = self._kept["increment"]
        self.real[of.RADIUS] = self.method.radius
        self.factors = Factors(self._kept, second=shape.second) if elsewhere else None
        self.traced = linearization.jacobian is not None
        head = np.zeros(of.HEAD, dtype=np.int64)
        head[of.METHOD], head[of.JACOBIAN] = kind, linearization.address
        head[of.ROWS], head[of.STAGES], head[of.DEGREE] = shape.rows, c.k, c.s
        head[of.WHOLE] = self._kept["whole_x"].size
        head[of.PAIRS], head[of.ENTRIES] = self.method.eigenvalues.size, self._kept["rows"].size
        head[of.FACTORS] = 0 if self.factors is None else self.factors.address
        addresses = [self._kept[name].ctypes.data for name in of.Memory._fields]
        self._words = np.concatenate([head, np.array(addresses, dtype=np.int64)])

    @property
    def address(self) -> int:
        """Of the memory, for compiled functions."""
        return self._words.ctypes.data

    @property
    def name(self) -> str:
        """Of the iteration."""
        return "blended" if self._words[of.METHOD] == of.BLENDED else "Newton"

    @property
    def _lasting(self) -> tuple[Any, ...]:
        """What goes from step to step, but for the factors, which follow from the Jacobian's entries."""
        return self.count, self.real, self.increment, self._kept["entries"]

    def save(self) -> tuple[Any, ...]:
        """Return copies of all that the continuation depends on."""
        return tuple(array.copy() for array in self._lasting)

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what `save` returned; the counters of the work done keep counting."""
        work = self.count[of.TRIED :].copy()
        for array, kept in zip(self._lasting, saved, strict=True):
            array[:] = kept
        self.count[of.TRIED :] = work
        self.count[of.FACTORED] = 0

    def raise_what_is_no_failure(self) -> None:
        """Raise what stopped a factorization, unless that is a singular matrix: Ctrl-C, no memory left."""
        if self.factors is not None and self.factors.error is not None:
            error, self.factors.error = self.factors.error, None
            if not isinstance(error, (ArithmeticError, RuntimeError, ValueError)):
                raise error


def _arrays(shape: Shape, m: Method, places: tuple[Integers, Integers], elsewhere: bool) -> dict[str, Any]:
    c = shape.constants
    rows, s, pairs, dim = shape.rows, c.s, m.eigenvalues.size, shape.dim
    padded, blocks = -(-rows // 8) * 8, -(-c.k // c.lanes)
    weights = np.zeros(blocks * c.lanes)
    weights[: c.k] = c.arrays["weights"].reshape(-1)
    low = m.integrals_low.shape[1]
    factors = 0 if elsewhere else pairs * rows
    whole = s * rows if s * rows <= LARGEST_WHOLE else 0
    tables: dict[str, Any] = {
        "stage_table": packed(np.hstack([m.integrals_low, m.integrals]), repeat=True),
        "projection": packed(c.arrays["projection"]),
        "basis": packed(m.basis, repeat=True),
        "weights": weights,
        "integrals": m.integrals, "reach": m.integrals @ m.x if shape.second else m.integrals,
        "moments": c.arrays["projection"],
        "left_re": m.left.real, "left_im": m.left.imag,
        "right_re": m.right.real, "right_im": m.right.imag,
        "eigen_re": m.eigenvalues.real, "eigen_im": m.eigenvalues.imag,
        "x": m.x, "inverse": m.inverse,
        "rows": places[0], "columns": places[1],
        "packed": aligned(8 * padded * -(-(s + low) // 8)),
        "trial": aligned(c.lanes * (1 + 2 * padded)),
        "count": np.zeros(of.COUNTS, dtype=np.int64),
        "pivots": np.zeros(factors, dtype=np.int64), "whole_pivots": np.zeros(whole, dtype=np.int64),
    }  # fmt: skip
    sizes = {
        "real": of.REALS, "point": rows, "gamma": s * dim, "increment": dim, "predicted": s * dim,
        "residual": s * dim, "correction": s * dim, "factor": rows, "slope_strict": rows,
        "slope_floored": rows, "entries": places[0].size, "lu_re": factors * rows, "lu_im": factors * rows,
        "whole_re": whole**2, "whole_im": whole**2, "whole_x": whole, "whole_y": whole,
        "b_re": rows, "b_im": rows, "v_re": dim, "v_im": dim,
    }  # fmt: skip
    room = {name: np.zeros(n) for name, n in sizes.items()}
    return {name: np.ascontiguousarray(array) for name, array in {**tables, **room}.items()}


def report(workspaces: tuple[Workspace, Workspace]) -> dict[str, Any]:
    """Return what solvers have done, for `Stats.extra`."""
    counts = workspaces[0].count + workspaces[1].count
    return {
        "jacobians": int(counts[of.JACOBIANS]),
        "jacobian": "traced" if workspaces[0].traced else "differences",
        "factorizations": int(counts[of.FACTORIZATIONS]),
        "corrections": int(counts[of.CORRECTIONS]),
        "rescues": int(counts[of.RESCUES]),
    }
