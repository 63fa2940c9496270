"""Functions of time and state behind ``void(times, states, par, values)``, on eight states at once."""

import ctypes
import inspect
import threading
from collections.abc import Callable
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import numpy as np

from integrators.kernel.native import binary, raised, store
from integrators.kernel.native.field import BUILT_BY
from integrators.kernel.native.stages import build
from problems import Problem, targets
from problems.derive.function import Function
from problems.errors import InputError

LANES = 8
UNDEFINED = (ArithmeticError, ValueError)  # 1/0, math.sqrt(-1): not a number, as in compiled code


class UserFunction:
    """A user's function for one system, traced and compiled, or called back where it cannot be traced.

    Parameters
    ----------
    label : str
        What it is, for messages.
    function : callable
        The function.
    problem : Problem
        What it is a function of the states of. Other starts and parameters may follow.
    trace : callable
        ``trace(function, label)`` makes a graph of it.
    count : int
        How many numbers it has.

    Attributes
    ----------
    address : int
        Of the C function.
    calls_back : bool
        Whether Python runs it.

    Raises
    ------
    problems.errors.InputError
        If it can neither be traced nor called with numbers.
    """

    def __init__(
        self,
        label: str,
        function: Callable[..., Any],
        problem: Problem,
        trace: Callable[..., Any],
        count: int,
    ):
        self._system, self._label, self._raised, self._count = problem.system, label, _Raised(), count
        try:
            traced = trace(function, label)
        except InputError as refused:
            self._function, self._wanted = function, _wanted(function, refused)
            with np.errstate(all="ignore"):
                try:
                    self._check(problem.t0, problem.y0.copy(), problem.par.copy())
                except InputError:
                    raise
                except Exception:
                    raise refused from None
            # What keeps a Python function alive that compiled code calls.
            self._alive = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(self._call)
            address = ctypes.cast(self._alive, ctypes.c_void_p).value
            assert address is not None
            self.address = address
        else:
            self.address = _compiled(traced).address
        self.calls_back = hasattr(self, "_alive")

    @property
    def error(self) -> BaseException | None:
        """What the function raised last in this thread, if Python runs it.

        The values are NaN then, and the flag behind them is set.
        """
        return self._raised.error

    def _check(self, t: float, y: Any, par: Any) -> None:
        """Raise what says that the function is of no use."""
        raise NotImplementedError

    def _fill(self, times: list[float], states: Any, par: Any, values: Any) -> None:
        """Set the values, shape (count, `LANES`), at so many times and states."""
        raise NotImplementedError

    def _evaluate(self, t: float, y: Any, par: Any) -> Any:
        """Return what the function makes of the arguments that it wants."""
        dof, parameters = self._system.dof, SimpleNamespace(**self._system.unpack(par))
        offered: dict[str, Any] = {"t": t, "y": y, "par": parameters, "m": np}
        if dof is not None:
            offered |= {"q": y[:dof], "p": y[dof:]}
        return self._function(*[offered[name] for name in self._wanted])

    def _call(self, t: int, states: int, par: int, values: int) -> None:
        dim, n_par, end = self._system.dim, self._system.n_par, LANES * self._count
        try:
            outputs = _numbers(values, end + 1)
            outputs[:end] = np.nan
            if raised.kept() is not None:
                outputs[end] = 1.0
                return
            columns = _numbers(states, LANES * dim).reshape(dim, LANES).T.copy()
            given = _numbers(par, n_par).copy()
            self._fill(_numbers(t, LANES).tolist(), columns, given, outputs[:end].reshape(-1, LANES))
        except BaseException as error:  # also Ctrl-C: nothing passes through compiled code
            self._raised.error = error
            _numbers(values, end + 1)[end] = 1.0


class EventFunction(UserFunction):
    """The function of the event ``name`` for one system; see `UserFunction`."""

    def __init__(self, name: str, g: Callable[..., Any], problem: Problem):
        super().__init__(f"event {name!r}", g, problem, problem.system.trace, 1)

    def _check(self, t: float, y: Any, par: Any) -> None:
        value: Any = np.nan
        with suppress(*UNDEFINED):
            value = self._evaluate(t, y, par)
        float(value)

    def _fill(self, times: list[float], states: Any, par: Any, values: Any) -> None:
        """Evaluate state by state; equal ones that follow each other only once."""
        for i in range(LANES):
            if i and times[i] == times[i - 1] and np.array_equal(states[i], states[i - 1]):
                values[0, i] = values[0, i - 1]
                continue
            value: Any = np.nan
            with suppress(*UNDEFINED), np.errstate(all="ignore"):
                value = self._evaluate(times[i], states[i].copy(), par)
            values[0, i] = float(value)  # what is no number is an error, and not a place without a value


class Action(UserFunction):
    """What the event ``name`` makes of the state and the parameters, for one system; see `UserFunction`.

    It has dim values, or dim + n_par where it changes parameters; the state in the first lane is the one that
    counts. One that does not return a state is refused.
    """

    def __init__(self, name: str, then: Callable[..., Any], problem: Problem):
        system = problem.system
        label = f"then of event {name!r}"
        super().__init__(label, then, problem, system.trace_change, system.dim + system.n_par)

    def _check(self, t: float, y: Any, par: Any) -> None:
        self._change(t, y, par)

    def _change(self, t: float, y: Any, par: Any) -> Any:
        """Return the new state, and behind it the new parameters."""
        changed = self._system.changed(self._evaluate(t, y, par), y, par, self._label)
        return np.concatenate([np.asarray(part, np.float64) for part in changed])

    def _fill(self, times: list[float], states: Any, par: Any, values: Any) -> None:
        values[:, 0] = self._change(times[0], states[0].copy(), par)


class _Raised(threading.local):
    """What a function has raised; a callback runs in the thread that has called the kernel."""

    error: BaseException | None = None


def _numbers(address: int, count: int) -> Any:
    room: Any = (ctypes.c_double * count).from_address(address) if count else b""
    return np.frombuffer(room)


def _compiled(traced: Function) -> binary.Native:
    """Compile a traced function on lanes, or load it."""
    text, function = targets.numba_of(traced, "event")
    name = store.key("event", text, binary.sources(BUILT_BY))
    return binary.obtain(name, lambda: build(function, LANES))


def _wanted(g: Callable[..., Any], refused: InputError) -> list[str]:
    """Return the names of the arguments that a function has no value for."""
    try:
        parameters = inspect.signature(g).parameters.values()
    except (TypeError, ValueError):
        raise refused from None
    return [parameter.name for parameter in parameters if parameter.default is parameter.empty]
