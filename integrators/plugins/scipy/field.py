"""Fields that compiled code can evaluate by itself, as ``fun`` of `scipy.integrate.solve_ivp`."""

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from problems import targets
from problems.errors import InputError
from problems.problem import Problem
from problems.systems.base import System, Value
from problems.systems.opaque import Opaque

Array = NDArray[np.float64]


class Field:
    """The vector field of a system with its parameters: ``fun(t, y)`` for any method of SciPy.

    `HBVM` and `Gauss` take their steps in compiled code when they see one.

    Attributes
    ----------
    system : System
        Whose field it is.
    par : ndarray, shape (n_par,)
        Values of the parameters.
    """

    def __init__(self, system: System, par: Array) -> None:
        self.system, self.par = system, par
        self._compiled: Any = None

    def __repr__(self) -> str:
        return f"field({self.system!r})"

    def __call__(self, t: Any, y: Any) -> Array:
        """Return the derivative at one state, (dim,), or at several, (dim, m)."""
        state = np.asarray(y, dtype=np.float64)
        if state.ndim != 1:
            return targets.numpy(self.system, "field")(t, state, self.par)
        if self._compiled is None:
            self._compiled = targets.numba(self.system, "field")
        out = np.empty(state.size)
        self._compiled(float(t), state, self.par, out)
        return out


def field(source: Problem | System, parameters: Mapping[str, Value] = MappingProxyType({})) -> Field:
    """Return the field of a problem or system as a function for `scipy.integrate.solve_ivp`.

        problem = problems.load("kepler", e=0.6)
        solve_ivp(field(problem), (0.0, 1000.0), problem.y0, method=HBVM)

    Parameters
    ----------
    source : Problem or System
        A problem brings the values of its parameters with it.
    parameters : mapping of str to float or sequence of float
        Values for a system's that differ from its own.

    Raises
    ------
    problems.errors.InputError
        For something else than a problem or a system, or parameters that it does not have.
    """
    if isinstance(source, Problem):
        if parameters:
            raise InputError("a problem has the values of its parameters; load it with those you want.")
        return Field(source.system, source.par)
    if not isinstance(source, System):
        raise InputError(
            f"field() takes a Problem or a System, not {source!r}; give solve_ivp a numba function as it is."
        )
    return Field(source, source.pack(parameters))


def recognised(fun: Any, dim: int, *, vectorized: bool) -> Field | None:
    """Return the field that ``fun`` is, or ``None`` for a function in Python.

    Parameters
    ----------
    fun : callable
        What a user gave to SciPy.
    dim : int
        Length of the state.
    vectorized : bool
        Whether ``fun`` takes columns; a numba function that does is called from Python.

    Raises
    ------
    problems.errors.InputError
        If the field is one of another dimension, or a numba function has other arguments than
        ``(t, y)`` or ``(t, y, dy)``.
    """
    if isinstance(fun, Field):
        if fun.system.dim != dim:
            raise InputError(f"{fun!r} needs a state of length {fun.system.dim}, not {dim}.")
        return fun
    if vectorized or dim == 0 or not (hasattr(fun, "py_func") and hasattr(fun, "inspect_llvm")):
        return None
    return _of_numba(fun, dim)


@lru_cache(maxsize=32)
def _of_numba(fun: Any, dim: int) -> Field | None:
    system = Opaque(fun, dim=dim)
    return None if system.takes_parameters else field(system)
