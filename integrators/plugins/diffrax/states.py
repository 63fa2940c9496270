"""States of a trajectory as a JAX function whose derivatives are those of the native steps."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import numpy as np
from numpy.typing import ArrayLike

from integrators.dynamics.states import StatesAt
from integrators.protocol import MethodBase
from problems.errors import InputError
from problems.problem import Problem


def states(
    problem: Problem, method: MethodBase, times: ArrayLike, *, threads: int = 1
) -> Callable[[Any, Any], Any]:
    """Return a function of the start and the parameters that JAX can differentiate in reverse.

    The steps are the native ones, on the processor, and so is their adjoint (`integrators.gradient`), which
    JAX calls: one pass for all derivatives, which are those of the numerical map to rounding. It works in
    ``jax.jit``, ``jax.grad`` and ``jax.vjp``; under ``jax.vmap`` trajectories run in threads. There is no
    forward mode: ``jax.jacfwd`` and ``jax.hessian`` fail.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced. The time that it begins at, too.
    method : MethodBase
        `integrators.Gauss` or `integrators.HBVM`.
    times : array_like, shape (m,)
        Times of the states, strictly monotone from ``problem.t0`` on. They change no steps.
    threads : int
        How many trajectories at once under ``jax.vmap``.

    Returns
    -------
    callable
        ``at(y0, par)``, arrays of shape (dim,) and (n_par,), such as ``problem.y0`` and ``problem.par``; the
        states, shape (m, dim).

    Raises
    ------
    problems.errors.InputError
        For a problem that the method does not accept, times that cannot be, and without JAX's double
        precision.

    Examples
    --------
    >>> import jax, problems
    >>> from integrators import Gauss
    >>> from integrators.plugins.diffrax import states
    >>> jax.config.update("jax_enable_x64", True)
    >>> pendulum = problems.load("pendulum")
    >>> at = states(pendulum, Gauss(s=4, h=0.1), [1.0, 2.0, 3.0])
    >>> jax.grad(lambda y0: (at(y0, pendulum.par)[:, 0] ** 2).sum())(pendulum.y0).shape
    (2,)
    """
    if not jax.config.read("jax_enable_x64"):
        raise InputError(
            "states of a trajectory are in double precision; call jax.config.update('jax_enable_x64', True)."
        )
    core = StatesAt(problem, method, times, threads)
    dim, n_par = problem.system.dim, problem.par.size

    def call(function: Callable[..., Any], shapes: Any, *arguments: Any) -> Any:
        return jax.pure_callback(function, shapes, *arguments, vmap_method="broadcast_all")

    shape = partial(jax.ShapeDtypeStruct, dtype=np.float64)

    @jax.custom_vjp
    def at(y0: Any, par: Any) -> Any:
        return call(core.values, shape((core.times.size, dim)), y0, par)

    def ahead(y0: Any, par: Any) -> tuple[Any, Any]:
        return at(y0, par), (y0, par)

    def back(kept: Any, gradient: Any) -> Any:
        return call(core.pulled_back, (shape((dim,)), shape((n_par,))), *kept, gradient)

    at.defvjp(ahead, back)
    return at


def end_state(
    problem: Problem, method: MethodBase, *, t_end: float | None = None, threads: int = 1
) -> Callable[[Any, Any], Any]:
    """Return the function of `states` for the end of a trajectory only: ``end(y0, par)`` of shape (dim,).

    Parameters
    ----------
    problem, method, threads
        As for `states`.
    t_end : float, optional
        Time of the end; by default the problem's.

    Raises
    ------
    problems.errors.InputError
        As for `states`.

    Examples
    --------
    >>> import jax, problems
    >>> from integrators import Gauss
    >>> from integrators.plugins.diffrax import end_state
    >>> jax.config.update("jax_enable_x64", True)
    >>> pendulum = problems.load("pendulum")
    >>> end = end_state(pendulum, Gauss(s=4, h=0.1), t_end=3.0)
    >>> jax.grad(lambda y0: end(y0, pendulum.par)[0] ** 2)(pendulum.y0).shape
    (2,)
    """
    at = states(problem, method, [problem.t_end if t_end is None else t_end], threads=threads)
    return lambda y0, par: at(y0, par)[0]
