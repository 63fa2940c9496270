"""HBVM(k, s) and Gauss(s) as methods of ``scipy.integrate.solve_ivp``.

    from scipy.integrate import solve_ivp
    from integrators.plugins.scipy import HBVM

    solution = solve_ivp(fun, (0.0, 100.0), y0, method=HBVM, k=12, s=6, rtol=1e-8, atol=1e-8)

The step sizes follow from SciPy's tolerances; the energy of a Hamiltonian system is conserved to round-off
for any step sizes. If ``fun`` is compiled, a numba function or the `field` of a problem, the kernel of
`integrators.HBVM` takes the steps.
"""

import warnings
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DenseOutput, OdeSolver

from integrators.options import Count, Stages, Step
from integrators.plugins.scipy.field import Field, field, recognised
from integrators.plugins.scipy.native import NativeSteps
from integrators.plugins.scipy.python import PythonSteps
from problems.checks import Positive, checked
from problems.errors import InputError, shown
from problems.quantities import plain_numbers

__all__ = ["HBVM", "Field", "Gauss", "field"]

SMALLEST_RTOL = 100.0 * float(np.finfo(float).eps)
"""The smallest ``rtol``, as of SciPy's own methods."""

Array = NDArray[Any]


def _counter(name: str) -> Any:
    """Return a property for a counter of SciPy's: what Python has counted, and what the kernel has so far."""

    def get(solver: "HBVM") -> int:
        return solver._counted.get(name, 0) + getattr(solver._steps, name, 0)

    def put(solver: "HBVM", count: int) -> None:
        solver._counted[name] = count - getattr(solver._steps, name, 0)

    return property(get, put)


class HBVM(OdeSolver):
    """HBVM(k, s), which conserves the energy: ``solve_ivp(fun, t_span, y0, method=HBVM)``.

    Equations and properties: see `integrators.HBVM`.

    Parameters
    ----------
    fun : callable
        ``fun(t, y)``. If it is compiled, the kernel of `integrators.HBVM` takes the steps: a numba function
        ``fun(t, y)`` or ``fun(t, y, dy)``, which writes the derivative to ``dy``; or the `field` of a problem
        or system.
    t0, y0, t_bound, first_step, max_step, rtol, atol, jac, jac_sparsity
        As for `scipy.integrate.Radau`. The local error of a step is kept below
        ``atol + rtol * abs(y)``; by the kernel below ``max(rtol * size, atol)`` for each block of the
        state (the momenta of one body, else each component). The stage equations are solved to round-off for
        any tolerances: by fixed-point iteration, or by simplified Newton iteration if that does not converge;
        only then ``jac`` is needed. The kernel computes its own Jacobians.
    vectorized : bool
        Whether ``fun`` takes y of shape (n, m). All stages are then evaluated in one call, if ``fun`` also
        takes the m times as an array, which is tested once.
    k : int, optional
        Nodes of the quadrature, k >= s. Default: as many as energy conservation to round-off needs: 2s
        initially, or, for compiled fields, 16 or more with sufficiently short steps.
    s : int
        Degree of the polynomial; the order is 2s.
    h : float, optional
        Fixed step size, > 0, of all steps except the last, independent of the tolerances; k must then be
        given.
    every : int
        Number of steps of the kernel that are one step of SciPy, for compiled fields: SciPy's loop costs more
        than a step of the kernel. ``t_eval`` and ``dense_output`` still give states between them, but two
        sign changes of an event function within one such step are missed.
    interpolant : {"step", "polynomial"}
        How states between the steps (``t_eval``, ``dense_output``, ``events``) are computed: by a partial
        step from the start of the step, of order 2s, which conserves the energy, or by the step's polynomial,
        which costs nothing but has order s + 1 (functions in Python only).

    Attributes
    ----------
    nfev : int
        Number of states at which ``fun`` was evaluated; one call may evaluate several.
    """

    nfev, njev, nlu = map(_counter, ("nfev", "njev", "nlu"))

    def __init__(
        self, fun: Any, t0: float, y0: Any, t_bound: float, max_step: float = np.inf, rtol: Any = 1e-3,
        atol: Any = 1e-6, jac: Any = None, jac_sparsity: Any = None, vectorized: bool = False,
        first_step: float | None = None, k: int | None = None, s: int = 6, h: float | None = None,
        every: int = 1, interpolant: str = "step", **extraneous: Any,
    ) -> None:  # fmt: skip
        name = type(self).__name__
        if extraneous:
            warnings.warn(f"{name} has no option {', '.join(extraneous)}: it has no effect.", stacklevel=2)
        self._steps: NativeSteps | PythonSteps | None = None
        self._counted: dict[str, int] = {}
        real = not np.iscomplexobj(y0)
        compiled = recognised(fun, np.size(y0), vectorized=vectorized) if real else None
        super().__init__(compiled or fun, t0, y0, t_bound, vectorized, support_complex=True)
        self.s, every = checked(name, "s", s, Stages), checked(name, "every", every, Count)
        k = checked(name, "k", k, Stages | None)
        if k is not None and k < self.s:
            raise InputError(f"HBVM needs k >= s; k={k} is less than s={self.s}: raise k or lower s.")
        interpolant = checked(name, "interpolant", interpolant, Literal["step", "polynomial"])
        self.max_step = (
            np.inf
            if isinstance(max_step, float) and max_step == np.inf
            else checked(name, "max_step", max_step, Positive)
        )
        first_step = checked(name, "first_step", first_step, Positive | None)
        if first_step is not None and first_step > (span := abs(self.t_bound - self.t)):
            raise InputError(
                f"first_step={first_step!r} must not be beyond the end, {span!r} from the start."
            )
        self._tolerate(rtol, atol)
        if h is not None:
            h = checked(name, "h", h, Step)
            if k is None:
                raise InputError(f"HBVM needs k with fixed step size, h={h!r}; 2s or 3s, say.")
            if first_step is not None or self.max_step < np.inf:
                raise InputError(f"h={h!r} is the length of every step; leave out first_step and max_step.")
        one_stage = k == 1 and h is None  # tells the kernel nothing about the error of a step
        if compiled is not None and not one_stage:
            if interpolant != "step":
                raise InputError(
                    "interpolant='polynomial' is for functions in Python; with a compiled field states "
                    "between the steps come from the kernel's steps: leave it out."
                )
            self._steps = self._native(fun, compiled, k, h, first_step, every)
        if self._steps is None:
            if every != 1:
                raise InputError(
                    f"every={shown(every)} is for compiled fields, whose steps cost less than SciPy's loop "
                    "over them; leave it out, or compile the function with numba."
                )
            self._steps = PythonSteps(
                self, k=k, s=self.s, h=h, first_step=first_step, jac=jac, jac_sparsity=jac_sparsity,
                interpolant=interpolant,
            )  # fmt: skip

    def _tolerate(self, rtol: Any, atol: Any) -> None:
        """Keep the tolerances, each a number or an array, or refuse them."""
        relative, self.atol = plain_numbers("rtol", rtol), plain_numbers("atol", atol)
        if np.any(relative < SMALLEST_RTOL):
            warnings.warn(
                f"At least one element of rtol={rtol!r} is too small: {SMALLEST_RTOL:.3g} takes its place.",
                stacklevel=3,
            )
        self.rtol = np.maximum(relative, SMALLEST_RTOL)
        for which, values in (("rtol", self.rtol), ("atol", self.atol)):
            if values.ndim > 0 and values.shape != (self.n,):
                raise InputError(
                    f"{which} of shape {values.shape} must be a number, or have shape ({self.n},)."
                )
        if not (np.all(self.atol >= 0.0) and np.isfinite(self.rtol).all()):
            raise InputError(f"rtol={shown(rtol)} must be finite, and atol={shown(atol)} must be >= 0.")

    def _native(
        self, fun: Any, compiled: Field, k: int | None, h: float | None, first_step: float | None, every: int
    ) -> NativeSteps | None:
        """Return steps in compiled code; ``None``, with a warning, if numba cannot compile the function."""
        from numba import NumbaError

        try:
            return NativeSteps(self, compiled, k=k, s=self.s, h=h, first_step=first_step, every=every)
        except (NumbaError, InputError) as error:
            said = error if isinstance(error, NumbaError) else error.__cause__
            if not isinstance(said, NumbaError):
                raise
            reason = str(said).strip().splitlines()[0]
            message = f"{fun!r} cannot be compiled for an array of {self.n} numbers: {reason}"
            if compiled is fun or getattr(compiled.system, "in_place", False):
                raise InputError(message) from error
            warnings.warn(f"{message} Its steps are taken in Python.", stacklevel=3)
            return None

    @property
    def k(self) -> int:
        """Nodes of the quadrature in use."""
        assert self._steps is not None
        return self._steps.k

    def _step_impl(self) -> tuple[bool, str | None]:
        assert self._steps is not None
        step = self._steps.take(self.t, self.y)
        if isinstance(step, str):
            return False, step
        self.t, self.y = step
        return True, None

    def _dense_output_impl(self) -> DenseOutput:
        assert self._steps is not None
        return self._steps.dense_output()


class Gauss(HBVM):
    """Gauss(s), collocation at the Gauss nodes, which is HBVM(s, s): ``solve_ivp(..., method=Gauss)``.

    Symplectic with a fixed step size, ``h=...``; with an adaptive one it conserves the energy no better than
    other methods of its order. Its s nodes do not determine gamma_s, from which HBVM estimates the error;
    gamma_{s-1} is used in its place. The steps are therefore shorter than those of HBVM, much shorter for s <
    4, for a Python function as in the kernel. Parameters as for `HBVM`, without k.
    """

    def __init__(self, fun: Any, t0: float, y0: Any, t_bound: float, *, s: int = 6, **options: Any) -> None:
        if "k" in options:
            raise InputError(f"Gauss has s={s!r} nodes, no k: leave out k={options['k']!r}, or take HBVM.")
        super().__init__(fun, t0, y0, t_bound, k=s, s=s, **options)
