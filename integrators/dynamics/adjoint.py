"""Gradients of a function of the end, by the adjoint of the steps."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any

import numpy as np

from integrators import registry
from integrators.dynamics.recorded import MEMORY, Recorded
from integrators.protocol import Array, MethodBase, check_problem
from integrators.running.integrate import prepared
from integrators.running.variations import START, TIME, places
from problems import emit
from problems.calculus.reverse import reverse
from problems.checks import Must, checked_arguments
from problems.errors import InputError, shown, unknown
from problems.problem import Problem

Bytes = Annotated[float, Must("a number of bytes above 0", lambda n: n > 0)]


@checked_arguments
def gradient(
    problem: Problem,
    method: MethodBase | None = None,
    loss: Callable[..., Any] | None = None,
    wrt: str | Sequence[str] = START,
    *,
    t_end: float | None = None,
    memory: Bytes = MEMORY,
) -> tuple[float, dict[str, Array]]:
    r"""Return a function of the end of a trajectory, and its derivatives by the adjoint of the steps.

    With the steps ``y_{n+1} = y_n + h sum_j b_j f(Y_j)`` that were taken, from the last one back,

        V_i = f_y(Y_i)' L_i,    L_i = l_{n+1} + h sum_j (b_j a_ji / b_i) V_j,
        l_n = l_{n+1} + h sum_j b_j V_j,    g_n = g_{n+1} + h sum_i b_i f_par(Y_i)' L_i,

    where l begins as the gradient of the function at the end, and l_0 and g_0 are the derivatives with
    respect to the start and to the parameters. This is the chain rule: they are the derivatives of the
    numerical map, with the lengths of its steps held fixed, to rounding. One pass gives all of them, whatever
    their number. For Gauss the equations of l are the method itself, backwards; for k > s those of another
    Runge-Kutta method.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced.
    method : MethodBase, optional
        `Gauss` or `HBVM`; by default ``HBVM()``.
    loss : callable
        A number, from the arguments that it names among ``t, q, p, y, par, m``: the end, written as a
        Hamiltonian is. By default there is none, which is an error.
    wrt : str or sequence of str
        What to differentiate with respect to: ``"y0"``, ``"t0"``, names of parameters. The start stays where
        it is as parameters and ``t0`` vary.
    t_end : float, optional
        Time of the end; by default the problem's.
    memory : float
        Bytes for the stages of the steps, about. Where there are more, those between two checkpoints are
        made again: each step is taken at most twice.

    Returns
    -------
    value : float
        The function at the end.
    grads : dict of str to ndarray
        Shape (dim,) for ``"y0"``, (n,) for a parameter that is a sequence, () for a number.

    Raises
    ------
    problems.errors.InputError
        For a method, or a system, without adjoints; names of nothing; a function that cannot be traced; and
        where the trajectory does not reach the end.

    References
    ----------
    J. M. Sanz-Serna, *Symplectic Runge-Kutta schemes for adjoint equations, automatic differentiation,
    optimal control, and more*, SIAM Review 58 (2016) 3-33, doi:10.1137/151002769.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss, gradient
    >>> pendulum = problems.load("pendulum")
    >>> value, grads = gradient(pendulum, Gauss(s=4, h=0.1), lambda q: q[0] ** 2, ["y0"], t_end=3.0)
    >>> grads["y0"].shape
    (2,)
    """
    method = registry.create("HBVM") if method is None else method
    check_problem(problem, method)
    system = problem.system
    if not callable(loss):
        raise InputError(f"loss={shown(loss)} must be a function of the end, such as lambda q: q[0] ** 2.")
    if not system.traced:
        raise InputError(f"gradients of {system.name} need a formula; its field is code.")
    found = places(problem)
    names = [wrt] if isinstance(wrt, str) else list(wrt)
    for name in names:
        if name not in (START, TIME, *found):
            raise unknown("variable of gradients", name, (START, TIME, *found))
    end = problem.t_end if t_end is None else t_end
    function = system.trace(loss, "loss")
    inner = any(name in found for name in names)
    program, _ = prepared(method, system)
    recorded = Recorded(program, problem, end, memory=memory)
    value = emit.numpy_of(function, "loss")(end, recorded.y, problem.par)[0]
    back, by_par = recorded.pulled_back(_slope(problem, function, "state", end, recorded.y), parameters=inner)
    if inner:
        by_par = by_par + _slope(problem, function, "parameters", end, recorded.y)
    grads: dict[str, Array] = {}
    for name in names:
        if name == START:
            grads[name] = back
        elif name == TIME:
            grads[name] = -back @ emit.numpy(system, "field")(problem.t0, problem.y0, problem.par)
        else:
            grads[name] = by_par[found[name]].reshape(np.shape(system.parameters[name]))
    return float(value), {name: np.asarray(each) for name, each in grads.items()}


def _slope(problem: Problem, function: Any, variables: Any, t: float, y: Array) -> Array:
    """Return the derivatives of a function of the end."""
    count = y.size if variables == "state" else problem.par.size
    slopes = reverse(function, variables=variables, count=count, name="loss_slope")
    return emit.numpy_of(slopes, "loss_slope")(t, np.concatenate([[1.0], y]), problem.par)
