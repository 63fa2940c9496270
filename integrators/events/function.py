"""An event's function on many states at once."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from integrators.protocol import Array, UserError
from problems import Problem, emit
from problems.errors import InputError

ROUNDING = 4 * float(np.finfo(np.float64).eps)
UNDEFINED = (ArithmeticError, ValueError)  # 1/0, math.sqrt(-1): not a number, as in compiled code
NUDGE = 1e-6  # relative change of a component that shows how g depends on it


class EventFunction:
    """``g`` for one problem, from times (n,) and states (n, dim) to values (n,).

    Attributes
    ----------
    name : str
        Of the event.
    traced : bool
        Whether g runs on whole arrays, or is called for one state after another.

    Raises
    ------
    problems.errors.InputError
        If g can neither be traced nor called with numbers.
    """

    def __init__(self, name: str, g: Callable[..., Any], problem: Problem):
        self.name = name
        self._par = problem.par
        what = f"event {name!r}"
        try:
            function = problem.system.trace(g, what)
        except InputError as refused:
            value: Any = np.nan
            try:
                self._one = _caller(g, problem)
                with np.errstate(all="ignore"):
                    value = self._one(problem.t0, problem.y0.copy())
            except UNDEFINED:
                pass
            except Exception:
                raise refused from None
            try:
                float(value)
            except Exception:
                raise refused from None
            self.traced = False
            return
        self.traced = True
        self._all = emit.numpy_of(function, "event")

    def __call__(self, t: Array, y: Array) -> Array:
        if self.traced:
            return self._all(t, y.T, self._par)[0]
        # Raises a `UserError` for what g raises.
        values = np.full(t.size, np.nan)
        with np.errstate(all="ignore"):
            for i in range(t.size):
                try:
                    values[i] = self._one(float(t[i]), y[i].copy())
                except UNDEFINED:
                    continue
                except Exception as error:
                    raise UserError(error) from error
        return values

    def noise(self, t: float, y: Array) -> float:
        """Return how much of g(t, y) rounding of the state may account for."""
        states = np.tile(y, (y.size + 1, 1))
        steps = NUDGE * np.abs(y)
        states[np.arange(1, y.size + 1), np.arange(y.size)] += steps
        values = self(np.full(y.size + 1, t), states)
        with np.errstate(all="ignore"):
            slopes = np.abs(values[1:] - values[0]) / NUDGE
        return ROUNDING * float(slopes[np.isfinite(slopes)].sum())


def _caller(g: Callable[..., Any], problem: Problem) -> Callable[[float, Array], Any]:
    """Return ``g`` as a function of time and state, with the arguments that it names."""
    import inspect

    system = problem.system
    wanted = [
        parameter.name
        for parameter in inspect.signature(g).parameters.values()
        if parameter.default is parameter.empty
    ]
    par = SimpleNamespace(**system.unpack(problem.par))
    dof = system.dof

    def call(t: float, y: Array) -> Any:
        offered: dict[str, Any] = {"t": t, "y": y, "par": par, "m": np}
        if dof is not None:
            offered |= {"q": y[:dof], "p": y[dof:]}
        return g(*[offered[name] for name in wanted])

    return call
