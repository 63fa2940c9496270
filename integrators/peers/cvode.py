"""A whole integration of CVODE by its own C functions, whose callbacks are compiled.

scikit-sundae calls a Python function for every evaluation of the vector field, which on small systems takes
most of the time: the same steps take 12 to 30 times as long as here. The functions are those of the SUNDIALS
that scikit-sundae has loaded, called as C programs call them; with the same linear solver the states are
bitwise those that scikit-sundae returns.
"""

import ctypes
import math
import weakref
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import carray, types  # pyright: ignore[reportPrivateImportUsage]

from integrators.peers.rebound.hooks import _pointer
from integrators.protocol import Array

P = ctypes.c_void_p
D, LONG, INT, INDEX = ctypes.c_double, ctypes.c_long, ctypes.c_int, ctypes.c_int32
SIGNATURES: dict[str, tuple[Any, ...]] = {  # what a function returns, and its arguments
    "SUNContext_Create": (INT, INT, ctypes.POINTER(P)),
    "SUNContext_ClearErrHandlers": (INT, P),
    "SUNContext_Free": (INT, ctypes.POINTER(P)),
    "N_VMake_Serial": (P, INDEX, P, P),
    "N_VGetArrayPointer": (P, P),
    "N_VDestroy": (None, P),
    "SUNDenseMatrix": (P, INDEX, INDEX, P),
    "SUNDenseMatrix_Data": (P, P),
    "SUNBandMatrix": (P, INDEX, INDEX, INDEX, P),
    "SUNBandMatrix_Data": (P, P),
    "SUNSparseMatrix": (P, INDEX, INDEX, INDEX, INT, P),
    "SUNSparseMatrix_Data": (P, P),
    "SUNSparseMatrix_IndexValues": (P, P),
    "SUNSparseMatrix_IndexPointers": (P, P),
    "SUNMatDestroy": (None, P),
    "SUNLinSol_Dense": (P, P, P, P),
    "SUNLinSol_Band": (P, P, P, P),
    "SUNLinSol_SuperLUMT": (P, P, P, INT, P),
    "SUNLinSolFree": (INT, P),
    "CVodeCreate": (P, INT, P),
    "CVodeFree": (None, ctypes.POINTER(P)),
    "CVodeInit": (INT, P, P, D, P),
    "CVodeSStolerances": (INT, P, D, D),
    "CVodeSetUserData": (INT, P, P),
    "CVodeSetLinearSolver": (INT, P, P, P),
    "CVodeSetJacFn": (INT, P, P),
    "CVodeSetMaxNumSteps": (INT, P, LONG),
    "CVodeSetMaxHnilWarns": (INT, P, INT),
    "CVodeSetStopTime": (INT, P, D),
    "CVode": (INT, P, D, P, ctypes.POINTER(D), INT),
    "CVodeGetNumSteps": (INT, P, ctypes.POINTER(LONG)),
    "CVodeGetNumRhsEvals": (INT, P, ctypes.POINTER(LONG)),
    "CVodeGetNumJacEvals": (INT, P, ctypes.POINTER(LONG)),
    "CVodeGetReturnFlagName": (ctypes.c_char_p, LONG),
}
FORMULAS = {"Adams": 1, "BDF": 2}
NORMAL, TOO_MUCH_WORK, CSC = 1, -1, 0
NO_INDICES = np.zeros(0, np.int32), np.zeros(0, np.int32)
STEPS = 100_000  # of one call, after which Python may be interrupted
SMALL = 16  # rows up to which a band saves nothing


class Ended(NamedTuple):
    """How an integration ended: at ``t_end`` where ``failed`` is empty."""

    t: float
    y: Array
    failed: str
    steps: int
    evaluations: int
    jacobians: int


def library() -> ctypes.CDLL | None:
    """Return SUNDIALS as scikit-sundae has loaded it; ``None`` where its functions or types are others."""
    import sksundae._cy_common as built  # pyright: ignore[reportMissingImports]
    import sksundae._cy_cvode  # pyright: ignore[reportMissingImports]

    if (built.SUNDIALS_INT_TYPE, built.SUNDIALS_FLOAT_TYPE) != ("int", "double"):
        return None
    loaded = ctypes.CDLL(sksundae._cy_cvode.__file__)  # names are looked up in what it depends on, too
    try:
        for name, (result, *arguments) in SIGNATURES.items():
            function = getattr(loaded, name)
            function.restype, function.argtypes = result, arguments
    except AttributeError:
        return None
    return loaded


class Matrix(NamedTuple):
    """Where the entries of a Jacobian go in a matrix of SUNDIALS, and how that is made and factored."""

    kind: str  # "Dense", "Band" or "Sparse"
    places: np.ndarray  # of each entry in the matrix's data
    make: Callable[[ctypes.CDLL, P], int]
    indices: tuple[np.ndarray, np.ndarray] = NO_INDICES  # of a sparse one

    @classmethod
    def of(cls, jacobian: Any, sparse: bool) -> "Matrix":
        """Return the matrix that fits the places of the entries: banded where few diagonals hold them all."""
        n, rows, columns = jacobian.shape[0], jacobian.rows, jacobian.columns
        below, above = int((rows - columns).max(initial=0)), int((columns - rows).max(initial=0))
        if n > SMALL and below + above < n // 3:
            wide = below + above  # above the diagonal, with room for the pivots
            places = columns * (wide + below + 1) + rows - columns + wide
            return cls("Band", places, lambda lib, ctx: lib.SUNBandMatrix(n, above, below, ctx))
        if not sparse:
            return cls("Dense", columns * n + rows, lambda lib, ctx: lib.SUNDenseMatrix(n, n, ctx))
        order = np.lexsort((rows, columns))
        places = np.empty_like(order)
        places[order] = np.arange(order.size)
        pointers = np.searchsorted(columns[order], np.arange(n + 1)).astype(np.int32)
        return cls(
            "Sparse",
            places,
            lambda lib, ctx: lib.SUNSparseMatrix(n, n, order.size, CSC, ctx),
            (rows[order].astype(np.int32), pointers),
        )


class CompiledCVODE:
    """CVODE for one vector field and one method, whose callbacks are compiled.

    Parameters
    ----------
    sundials : ctypes.CDLL
        See `library`.
    method : CVODE
        Its options.
    dim : int
        Number of components.
    field, entries : compiled functions
        Of the vector field and of the Jacobian, as `problems.targets.numba` makes them.
    jacobian : Jacobian or None
        Without one, CVODE takes differences.
    sparse : bool
        Whether a Jacobian without a narrow band is a sparse matrix.
    """

    def __init__(
        self,
        sundials: ctypes.CDLL,
        method: Any,
        dim: int,
        field: Any,
        jacobian: Any,
        entries: Any,
        sparse: bool,
    ):
        self.lib, self.method, self.dim = sundials, method, dim
        self.field = _field_callback(sundials, field)
        self.matrix = None if jacobian is None else Matrix.of(jacobian, sparse)
        self.entries = None
        if self.matrix is not None:
            self.entries = _jacobian_callback(sundials, entries, self.matrix.kind)

    def start(self, t0: float, y0: Array, par: Array) -> "Integration":
        """Return an integration that is set up."""
        return Integration(self, t0, y0, par)


class Integration:
    """One integration by CVODE; what it holds of SUNDIALS is freed with it."""

    def __init__(self, program: CompiledCVODE, t0: float, y0: Array, par: Array):
        lib, method, n = program.lib, program.method, program.dim
        matrix, context = program.matrix, P()
        lib.SUNContext_Create(0, ctypes.byref(context))
        lib.SUNContext_ClearErrHandlers(context)  # which print
        self._lib, self._t, self._y = lib, D(t0), np.array(y0, dtype=np.float64)
        self._state = lib.N_VMake_Serial(n, self._y.ctypes.data, context)
        self._memory = lib.CVodeCreate(FORMULAS[method.method], context)
        lib.CVodeInit(self._memory, program.field.address, t0, self._state)
        lib.CVodeSStolerances(self._memory, method.rtol, method.atol)
        kind = "Dense" if matrix is None else matrix.kind
        held = lib.SUNDenseMatrix(n, n, context) if matrix is None else matrix.make(lib, context)
        if kind == "Sparse":
            linear = lib.SUNLinSol_SuperLUMT(self._state, held, 1, context)
        else:
            linear = getattr(lib, f"SUNLinSol_{kind}")(self._state, held, context)
        lib.CVodeSetLinearSolver(self._memory, linear, held)
        self._user = _user_data(n, par, matrix)
        lib.CVodeSetUserData(self._memory, self._user[0].ctypes.data)
        if program.entries is not None:
            lib.CVodeSetJacFn(self._memory, program.entries.address)
        lib.CVodeSetMaxNumSteps(self._memory, STEPS)
        lib.CVodeSetMaxHnilWarns(self._memory, -1)
        self._linear = linear
        self._factored: list[int] = [] if kind == "Sparse" else [linear]
        weakref.finalize(self, _free, lib, self._memory, self._factored, held, self._state, context)

    def go(self, t_end: float) -> Ended:
        """Integrate to a time, as far as CVODE gets."""
        lib, memory, t = self._lib, self._memory, self._t
        lib.CVodeSetStopTime(memory, t_end)
        flag, before = TOO_MUCH_WORK, math.nan
        while flag == TOO_MUCH_WORK and t.value != before:
            before = t.value
            flag = lib.CVode(memory, t_end, self._state, ctypes.byref(t), NORMAL)
        failed = "" if flag >= 0 else lib.CVodeGetReturnFlagName(flag).decode()
        counts = [self._count(f"CVodeGetNum{of}") for of in ("Steps", "RhsEvals", "JacEvals")]
        self._factored[:] = [self._linear] if counts[-1] else self._factored
        return Ended(t.value, self._y.copy(), failed, *counts)

    def _count(self, function: str) -> int:
        count = LONG()
        getattr(self._lib, function)(self._memory, ctypes.byref(count))
        return count.value


def _free(lib: ctypes.CDLL, memory: int, factored: list[int], matrix: int, state: int, context: P) -> None:
    lib.CVodeFree(ctypes.byref(P(memory)))
    for linear in factored:  # SuperLU_MT would free factors that it has not made
        lib.SUNLinSolFree(linear)
    lib.SUNMatDestroy(matrix)
    lib.N_VDestroy(state)
    lib.SUNContext_Free(ctypes.byref(context))


def _user_data(n: int, par: Array, matrix: Matrix | None) -> list[np.ndarray]:
    """Return the addresses and sizes that the callbacks read, and then the arrays that they belong to."""
    places = np.zeros(0, np.int64) if matrix is None else matrix.places.astype(np.int64)
    rows, pointers = NO_INDICES if matrix is None else matrix.indices
    values = np.empty(places.size)
    arrays = [np.array(par), places, rows, pointers, values]
    return [np.array([*(array.ctypes.data for array in arrays), n, par.size, places.size]), *arrays]


def _field_callback(sundials: ctypes.CDLL, field: Any) -> Any:
    """Return CVODE's right-hand side: ``f(t, y, ydot, user_data)``."""
    data, at = sundials.N_VGetArrayPointer, _pointer

    @numba.cfunc(types.int32(types.float64, types.voidptr, types.voidptr, types.voidptr))
    def right(t: float, y: Any, slope: Any, user: Any) -> int:
        known = carray(user, (8,), np.int64)
        n, n_par = known[5], known[6]
        state = carray(at(np.int64(data(y))), (n,), np.float64)
        out = carray(at(np.int64(data(slope))), (n,), np.float64)
        field(t, state, carray(at(known[0]), (n_par,), np.float64), out)
        return 0

    return right


def _jacobian_callback(sundials: ctypes.CDLL, entries: Any, kind: str) -> Any:
    """Return CVODE's Jacobian: ``J(t, y, fy, matrix, user_data, ...)``, for a matrix that is all zeros."""
    vector, content = sundials.N_VGetArrayPointer, getattr(sundials, f"SUN{kind}Matrix_Data")
    its_rows, its_columns = sundials.SUNSparseMatrix_IndexValues, sundials.SUNSparseMatrix_IndexPointers
    sparse, at = kind == "Sparse", _pointer

    @numba.cfunc(types.int32(types.float64, *(types.voidptr,) * 7))
    def fill(t: float, y: Any, slope: Any, matrix: Any, user: Any, a: Any, b: Any, c: Any) -> int:
        known = carray(user, (8,), np.int64)
        n, n_par, size = known[5], known[6], known[7]
        places, values = carray(at(known[1]), (size,), np.int64), carray(at(known[4]), (size,), np.float64)
        state = carray(at(np.int64(vector(y))), (n,), np.float64)
        entries(t, state, carray(at(known[0]), (n_par,), np.float64), values)
        held = carray(at(np.int64(content(matrix))), (n * n,), np.float64)
        for i in range(size):
            held[places[i]] = values[i]
        if sparse:
            rows = carray(at(np.int64(its_rows(matrix))), (size,), np.int32)
            columns = carray(at(np.int64(its_columns(matrix))), (n + 1,), np.int32)
            rows[:] = carray(at(known[2]), (size,), np.int32)
            columns[:] = carray(at(known[3]), (n + 1,), np.int32)
        return 0

    return fill
