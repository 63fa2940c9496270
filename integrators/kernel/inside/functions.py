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


class EventFunction:
    """A user's function for one system.

    Parameters
    ----------
    name : str
        Of the event, for messages.
    g : callable
        The function.
    problem : Problem
        What it is a function of the states of. Other starts and parameters may follow.

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

    def __init__(self, name: str, g: Callable[..., Any], problem: Problem):
        self._system, self._raised = problem.system, _Raised()
        try:
            traced = problem.system.trace(g, f"event {name!r}")
        except InputError as refused:
            self._g, self._wanted = g, _wanted(g, refused)
            self._check(problem, refused)
            self._alive, self.address = _called_back(self._call)
        else:
            self.address = _compiled(traced).address
        self.calls_back = hasattr(self, "_alive")

    @property
    def error(self) -> BaseException | None:
        """What the function raised last in this thread, if Python runs it.

        The values are NaN then, and the flag behind them (the ninth number there) is set.
        """
        return self._raised.error

    def _check(self, problem: Problem, refused: InputError) -> None:
        value: Any = np.nan
        try:
            with np.errstate(all="ignore"):
                value = self._evaluate(problem.t0, problem.y0.copy(), self._parameters(problem.par))
        except UNDEFINED:
            pass
        except Exception:
            raise refused from None
        try:
            float(value)
        except Exception:
            raise refused from None

    def _parameters(self, par: Any) -> SimpleNamespace:
        return SimpleNamespace(**self._system.unpack(par))

    def _evaluate(self, t: float, y: Any, par: SimpleNamespace) -> Any:
        return _called(self._g, self._wanted, self._system.dof, t, y, par)

    def _call(self, t: int, states: int, par: int, values: int) -> None:
        """Evaluate state by state; equal ones that follow each other only once."""
        try:
            outputs = _numbers(values, LANES + 1)
            outputs[:LANES] = np.nan
            if raised.kept() is not None:
                outputs[LANES] = 1.0
                return
            times, dim = _numbers(t, LANES).tolist(), self._system.dim
            columns = _numbers(states, LANES * dim).reshape(dim, LANES).T.copy()
            given = self._parameters(_numbers(par, self._system.n_par).copy())
            for i in range(LANES):
                if i and times[i] == times[i - 1] and np.array_equal(columns[i], columns[i - 1]):
                    outputs[i] = outputs[i - 1]
                    continue
                value: Any = np.nan
                with suppress(*UNDEFINED), np.errstate(all="ignore"):
                    value = self._evaluate(times[i], columns[i].copy(), given)
                outputs[i] = float(value)  # what is no number is an error, and not a place without a value
        except BaseException as error:  # also Ctrl-C: nothing passes through compiled code
            self._raised.error = error
            _numbers(values, LANES + 1)[LANES] = 1.0


class Action:
    """What an event makes of the state and the parameters, for one system: a function like `EventFunction`.

    Parameters
    ----------
    name : str
        Of the event, for messages.
    then : callable
        The function.
    problem : Problem
        What it is a function of the states of.

    Attributes
    ----------
    address : int
        Of the C function, of dim values, or dim + n_par where it changes parameters; the state in the first
        lane is the one that counts.
    calls_back : bool
        Whether Python runs it.

    Raises
    ------
    problems.errors.InputError
        If it can neither be traced nor called with numbers, or does not return a state.
    """

    def __init__(self, name: str, then: Callable[..., Any], problem: Problem):
        self._system, self._raised = problem.system, _Raised()
        label = f"then of event {name!r}"
        try:
            traced = problem.system.trace_change(then, label)
        except InputError as refused:
            self._then, self._wanted, self._label = then, _wanted(then, refused), label
            with np.errstate(all="ignore"):
                try:
                    self._change(problem.t0, problem.y0.copy(), problem.par.copy())
                except InputError:
                    raise
                except Exception:
                    raise refused from None
            self._alive, self.address = _called_back(self._call)
        else:
            self.address = _compiled(traced).address
        self.calls_back = hasattr(self, "_alive")

    @property
    def error(self) -> BaseException | None:
        """What the function raised last in this thread, if Python runs it."""
        return self._raised.error

    def _change(self, t: float, y: Any, par: Any) -> Any:
        """Return the new state, and behind it the new parameters."""
        parameters = SimpleNamespace(**self._system.unpack(par))
        value = _called(self._then, self._wanted, self._system.dof, t, y, parameters)
        return np.concatenate(
            [np.asarray(part, np.float64) for part in self._system.changed(value, y, par, self._label)]
        )

    def _call(self, t: int, states: int, par: int, values: int) -> None:
        dim, n_par = self._system.dim, self._system.n_par
        count = dim + n_par
        try:
            if raised.kept() is not None:
                _numbers(values, LANES * count + 1)[LANES * count] = 1.0
                return
            state = _numbers(states, LANES * dim)[::LANES].copy()
            given = _numbers(par, n_par).copy()
            _numbers(values, LANES * count)[::LANES] = self._change(float(_numbers(t, 1)[0]), state, given)
        except BaseException as error:  # also Ctrl-C: nothing passes through compiled code
            self._raised.error = error
            _numbers(values, LANES * count + 1)[LANES * count] = 1.0


def _called(
    function: Callable[..., Any], wanted: list[str], dof: int | None, t: float, y: Any, par: SimpleNamespace
) -> Any:
    """Return what a function makes of the arguments that it wants."""
    offered: dict[str, Any] = {"t": t, "y": y, "par": par, "m": np}
    if dof is not None:
        offered |= {"q": y[:dof], "p": y[dof:]}
    return function(*[offered[name] for name in wanted])


def _called_back(call: Callable[..., None]) -> tuple[Any, int]:
    """Return what keeps a Python function alive that compiled code calls, and its address."""
    alive = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(call)
    address = ctypes.cast(alive, ctypes.c_void_p).value
    assert address is not None
    return alive, address


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
