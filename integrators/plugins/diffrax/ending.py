"""The end of a trajectory as a JAX function whose derivatives are those of the native steps."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import numpy as np

from integrators.dynamics.recorded import Recorded
from integrators.protocol import Array, MethodBase, check_problem
from problems.errors import InputError
from problems.problem import Problem


def end_state(
    problem: Problem, method: MethodBase, *, t_end: float | None = None
) -> Callable[[Any, Any], Any]:
    """Return a function of the start and the parameters that JAX can differentiate in reverse.

    The steps are the native ones, on the processor, and so is their adjoint (`integrators.gradient`), which
    JAX calls: one pass for all derivatives, which are those of the numerical map to rounding. It works in
    ``jax.jit``, ``jax.grad`` and ``jax.vjp``; ``jax.vmap`` calls it for one after another. There is no
    forward mode: ``jax.jacfwd`` and ``jax.hessian`` fail.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced. The time that it begins at, too.
    method : MethodBase
        `integrators.Gauss` or `integrators.HBVM`.
    t_end : float, optional
        Time of the end; by default the problem's.

    Returns
    -------
    callable
        ``end(y0, par)``, arrays of shape (dim,) and (n_par,), such as ``problem.y0`` and ``problem.par``; the
        state at the end, shape (dim,).

    Raises
    ------
    problems.errors.InputError
        For a problem that the method does not accept, and without JAX's double precision.

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
    check_problem(problem, method)
    if not jax.config.read("jax_enable_x64"):
        raise InputError(
            "the end of a trajectory is in double precision; call jax.config.update('jax_enable_x64', True)."
        )
    stop = problem.t_end if t_end is None else t_end

    program = method.compile(problem.system)

    def recorded(y0: Array, par: Array) -> Recorded:
        return Recorded(program, problem, [stop], y0=np.asarray(y0), par=np.asarray(par))

    def forward(y0: Array, par: Array) -> Array:
        return recorded(y0, par).y[0]

    def backward(y0: Array, par: Array, gradient: Array) -> tuple[Array, Array]:
        return recorded(y0, par).pulled_back(np.asarray(gradient)[np.newaxis], parameters=par.size > 0)

    shapes = [jax.ShapeDtypeStruct((size,), np.float64) for size in (problem.system.dim, problem.par.size)]
    call = partial(jax.pure_callback, vmap_method="sequential")

    @jax.custom_vjp
    def end(y0: Any, par: Any) -> Any:
        return call(forward, shapes[0], y0, par)

    def ahead(y0: Any, par: Any) -> tuple[Any, Any]:
        return end(y0, par), (y0, par)

    def back(kept: Any, gradient: Any) -> Any:
        return call(backward, tuple(shapes), *kept, gradient)

    end.defvjp(ahead, back)
    return end
