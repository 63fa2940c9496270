"""Opaque systems, whose right-hand side is not traced: a numba function, or any Python function."""

import inspect
import threading
import warnings
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from problems.checks import NOTHING, Named, at_least, checked_arguments
from problems.derive.function import Function
from problems.errors import InputError, shown
from problems.quantities import plain_numbers
from problems.systems.base import System, Value

Array = NDArray[np.float64]

_UNWRITTEN = np.array(0x7FF8_0000_5EED_0001).view(np.float64)  # a NaN that no arithmetic makes
UNDEFINED = (ArithmeticError, ValueError)  # 1/0, math.sqrt(-1): not a number, as in compiled code
SPLIT = "split the state into real and imaginary parts, as in y0=[*z.real, *z.imag]"


class _Undefined(threading.local):
    """The last field that was not defined somewhere, in this thread, and what it raised there."""

    system: "Opaque | None" = None
    error: Exception | None = None


_last = _Undefined()


class Opaque(System):
    """A system y' = f(t, y) whose right-hand side is code and is not traced.

    A numba function is called from compiled code at full speed. Any other Python function is called back from
    compiled code, which adds a few microseconds to each evaluation: it is slow, and
    ``Solution.stats.extra["field"]`` says so.

    Parameters
    ----------
    f : callable
        ``f(t, y)``, which returns the derivative, or ``f(t, y, dy)``, which writes it to ``dy``; ``y`` and
        ``dy`` are arrays of shape (dim,). If the third argument is called ``par``, it receives the parameters
        as one flat array, in the order of declaration.
    dim : int
        Length of the state.
    parameters, invariants, guards, name
        As for `VectorField`; invariants and guards are traced, and evaluated in double-double.
    jac_sparsity : array_like or sparse matrix, shape (dim, dim), optional
        Which entries of the Jacobian are not zero, as for SciPy's `solve_ivp`: differences of columns
        without a common row are taken together, and matrices are factored sparse.

    Raises
    ------
    problems.errors.InputError
        For a function with other arguments, or a ``jac_sparsity`` of another shape.

    Notes
    -----
    If f divides by zero or leaves a function's domain (`ArithmeticError`, `ValueError`), its value is NaN and
    the integration ends with the status ``not_finite``. Other exceptions of a Python function are raised in
    the first step; later they end the integration with the status ``user_error``. Exceptions of a numba
    function are printed, and its value is NaN. Jacobians are approximated by differences. Methods that need
    formulas (LineIntegral, Taylor, those of diffrax) refuse such a system.

    Examples
    --------
    >>> from problems import Opaque
    >>> def van_der_pol(t, y):
    ...     return [y[1], (1 - y[0]**2)*y[1] - y[0]]
    >>> Opaque(van_der_pol, dim=2)
    Opaque(van_der_pol, dim=2)
    """

    kind = "vector_field"
    traced = False

    @checked_arguments
    def __init__(
        self,
        f: Callable[..., Any],
        *,
        dim: Annotated[int, at_least(1)],
        parameters: Named[Value] = NOTHING,
        invariants: Named[Callable[..., Any]] = NOTHING,
        guards: Named[Callable[..., Any]] = NOTHING,
        name: str | None = None,
        jac_sparsity: Any = None,
    ) -> None:
        if not callable(f):
            raise InputError(f"f must be a function, not {shown(f)}.")
        super().__init__(f, dim, None, parameters, invariants, guards, name)
        self._sparsity = None if jac_sparsity is None else _pattern(jac_sparsity, dim)
        self._take(f)
        self._trace_declared(invariants, guards)

    def _take(self, f: Callable[..., Any]) -> None:
        self.f, self._called = f, False
        self.takes_parameters, self.in_place = _form(f)
        self.numba = hasattr(f, "py_func") and hasattr(f, "inspect_llvm")

    def __getstate__(self) -> dict[str, Any]:
        """Return the state with the function itself, which pickle can keep and JSON cannot."""
        return {**super().__getstate__(), "f": self.f, "sparsity": self._sparsity}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        super().__setstate__(state)
        self._sparsity = state.get("sparsity")
        self._take(state["f"])

    @property
    def sparsity(self) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
        """Rows and columns of what is not zero in the Jacobian; ``None`` if not known."""
        return self._sparsity

    def __repr__(self) -> str:
        return f"Opaque({self.name}, dim={self.dim})"

    @property
    def written(self) -> str:
        """Kind of the function, for statistics."""
        return "numba function" if self.numba else "Python function, slow"

    def function(self, name: str) -> Function:
        """Return a traced function as `System.function` does; the field is not traced."""
        if name == "field":
            kind = self.written.partition(",")[0]
            raise InputError(
                f"{self.name} is not traced: its field is a {kind}; write it as a VectorField or "
                "Hamiltonian for what needs the formula."
            )
        return super().function(name)

    @property
    def undefined(self) -> Exception | None:
        """What f raised in this thread where its value is NaN, if it was the last to do so."""
        return _last.error if _last.system is self else None

    def forget_undefined(self) -> None:
        """Forget it: a trajectory begins."""
        if _last.system is self:
            _last.system = _last.error = None

    def evaluate(self, t: float, y: Array, par: Array, out: Array) -> None:
        """Write the derivative at one state to ``out``; NaN if it is not defined.

        NumPy warns of that, unless the caller suppresses it with ``np.errstate``.

        Raises
        ------
        problems.errors.InputError
            If f does not return dim numbers, writes complex ones, or cannot be compiled.
        """
        arguments = (t, y, par) if self.takes_parameters else (t, y)
        try:
            if self.in_place:
                out[:] = _UNWRITTEN
                arguments += (out,)
            value = self.f(*arguments) if self._called else self._first_call(arguments)
        except InputError:  # which is a ValueError
            raise
        except UNDEFINED as error:
            _last.system, _last.error = self, error.with_traceback(None)  # whose frames hold the arrays
            out[:] = np.nan
            return
        except TypeError as error:
            if self.in_place and "complex" in str(error):  # NumPy's own, of dy[0] = 1j
                raise self._complex() from error
            raise
        if self.in_place:
            self._check_written(out, value)
            return
        array = plain_numbers(f"what {self.name} returns", value)
        if array.shape != (self.dim,):
            raise InputError(
                f"{self.name} returns an array of shape {array.shape}, not ({self.dim},): "
                "one derivative for each component of y."
            )
        out[:] = array

    def _first_call(self, arguments: tuple[Any, ...]) -> Any:
        """Call f, where NumPy must not drop an imaginary part and numba compiles it."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", np.exceptions.ComplexWarning)
                value = self.f(*arguments)
        except np.exceptions.ComplexWarning as error:
            raise self._complex() from error
        except Exception as error:
            if self.numba and (refused := self.not_compiled(error)) is not None:
                raise refused from error
            raise
        self._called = True
        return value

    def _complex(self) -> InputError:
        return InputError(f"{self.name} writes complex numbers to dy, which is real; {SPLIT}.")

    def not_compiled(self, error: Exception) -> InputError | None:
        """Return why numba does not compile f, in a sentence; ``None`` for an error of another kind."""
        from numba import NumbaError  # has been imported by who compiled f

        if not isinstance(error, NumbaError):
            return None
        said = str(error)
        if "complex128" in said:
            return InputError(f"{self.name} calculates with complex numbers; {SPLIT}.")
        told = [line.strip() for line in said.splitlines() if line.strip()]
        told = [line for line in told if not line.startswith("Failed in nopython mode")] or told
        return InputError(f"numba does not compile {self.name} for arrays of doubles: {told[0]:.200}")

    def _check_written(self, out: Array, value: Any) -> None:
        """Refuse a result of which components were not written: they are not the field's own NaN."""
        missing = out.view(np.int64) == _UNWRITTEN.view(np.int64)
        if not missing.any():
            return
        if value is not None:
            raise InputError(
                f"{self.name} returns {shown(value)}, though it takes a third argument, which is the array "
                "for the derivative; write to that, or give a constant as a parameter, f(t, y, par)."
            )
        raise InputError(
            f"{self.name} has not written dy[{int(missing.argmax())}]; a function f(t, y, dy) writes all "
            f"{self.dim} derivatives, as in dy[:] = ..."
        )


def _pattern(given: Any, dim: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    from scipy.sparse import csr_matrix, issparse

    try:
        matrix = csr_matrix(given if issparse(given) else np.asarray(given, dtype=np.float64))
    except (TypeError, ValueError):
        matrix = csr_matrix((0, 0))
    if matrix.shape != (dim, dim):
        raise InputError(f"jac_sparsity={shown(given)} must be a matrix of shape ({dim}, {dim}).")
    rows, columns = matrix.nonzero()
    return rows.astype(np.int64), columns.astype(np.int64)


def _form(f: Callable[..., Any]) -> tuple[bool, bool]:
    """Return whether a function takes parameters, and whether it takes the array for its result."""
    try:
        signature = inspect.signature(getattr(f, "py_func", f))
    except (TypeError, ValueError):
        return False, False  # a builtin: f(t, y)
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    names = [p.name for p in signature.parameters.values() if p.kind in kinds and p.default is p.empty]
    takes_parameters = names[2:3] == ["par"]
    rest = len(names) - 2 - takes_parameters
    if rest not in (0, 1):
        raise InputError(
            f"a field has the arguments (t, y), (t, y, dy), (t, y, par) or (t, y, par, dy), not {names!r}."
        )
    return takes_parameters, rest == 1
