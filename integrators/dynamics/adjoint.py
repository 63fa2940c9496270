"""Gradients of a function of a trajectory's end or samples, by the adjoint of the steps."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from integrators import registry
from integrators.dynamics.recorded import MEMORY, Recorded
from integrators.protocol import Array, MethodBase, check_problem
from integrators.refusals import check_times
from integrators.running.integrate import prepared
from integrators.running.variations import START, TIME, places
from problems import targets
from problems.checks import Must, checked_arguments
from problems.derive.reverse import reverse
from problems.errors import InputError, shown, unknown
from problems.problem import Problem
from problems.quantities import plain_numbers

Bytes = Annotated[float, Must("a number of bytes above 0", lambda n: n > 0)]


@checked_arguments
def gradient(
    problem: Problem,
    method: MethodBase | None = None,
    loss: Callable[..., Any] | None = None,
    wrt: str | Sequence[str] = START,
    *,
    t_end: float | None = None,
    times: ArrayLike | None = None,
    data: ArrayLike | None = None,
    memory: Bytes = MEMORY,
) -> tuple[float, dict[str, Array]]:
    r"""Return a function of a trajectory's end, or a sum over samples, and its derivatives by the adjoint.

    With the steps :math:`y_{n+1} = y_n + h \sum_j b_j f(Y_j)` that were taken, from the last one back,

    .. math::

        V_i &= f_y(Y_i)^T L_i, \qquad L_i = l_{n+1} + h \sum_j \frac{b_j a_{ji}}{b_i} V_j, \\
        l_n &= l_{n+1} + h \sum_j b_j V_j, \qquad g_n = g_{n+1} + h \sum_i b_i f_{par}(Y_i)^T L_i,

    where l begins as the gradient of the function at the end, and grows by that of each sample; l_0 and g_0
    are the derivatives with respect to the start and to the parameters. This is the chain rule: they are the
    derivatives of the numerical map, with the lengths of its steps held fixed, to rounding. One pass gives
    all of them, whatever their number. For Gauss the equations of l are the method itself, backwards; for
    k > s those of another Runge-Kutta method.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced.
    method : MethodBase, optional
        `Gauss` or `HBVM`; by default ``HBVM()``.
    loss : callable
        A number, from the arguments that it names among ``t, q, p, y, par, m``: the end, written as a
        Hamiltonian is. With ``times`` it is added up over these samples, and with ``data`` it may name
        ``data`` too. By default there is none, which is an error.
    wrt : str or sequence of str
        What to differentiate with respect to: ``"y0"``, ``"t0"``, names of parameters. The start stays where
        it is as parameters and ``t0`` vary.
    t_end : float, optional
        Time of the end; by default the problem's.
    times : array_like, shape (m,), optional
        Times of samples instead, strictly monotone from the problem's ``t0`` on. They change no steps.
    data : array_like, shape (m,) or (m, n), optional
        What belongs to each sample, such as measurements: the function's ``data`` is a number, or ``data[0]``
        to ``data[n - 1]`` are.
    memory : float
        Bytes for the stages of the steps, about. Where there are more, those between two checkpoints are
        made again: each step is taken at most twice.

    Returns
    -------
    value : float
        The function at the end, or the sum.
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
    >>> measured = {"times": [1.0, 2.0], "data": [1.0, -0.5]}
    >>> value, grads = gradient(pendulum, Gauss(s=4, h=0.1), lambda q, data: (q[0] - data) ** 2, **measured)
    """
    method = registry.create("HBVM") if method is None else method
    check_problem(problem, method)
    system = problem.system
    if not callable(loss):
        raise InputError(f"loss={shown(loss)} must be a function of the end, such as lambda q: q[0] ** 2.")
    if not system.traced:
        raise InputError(f"gradients of {system.name} need a formula; its field is code.")
    slices = places(problem)
    names = [wrt] if isinstance(wrt, str) else list(wrt)
    for name in names:
        if name not in (START, TIME, *slices):
            raise unknown("variable of gradients", name, (START, TIME, *slices))
    grid, rows = _samples(problem, t_end, times, data)
    function = system.trace(loss, "loss", data=None if data is None else rows.shape[1:])
    inner = any(name in slices for name in names)
    program, _ = prepared(method, system)
    recorded = Recorded(program, problem, grid, memory=memory)
    par = [np.concatenate([problem.par, row.reshape(-1)]) for row in rows]
    samples = list(zip(grid.tolist(), recorded.y, par, strict=True))
    values = targets.numpy_of(function, "loss")
    value = sum(float(values(t, y, numbers)[0]) for t, y, numbers in samples)
    back, by_par = recorded.pulled_back(_slopes(function, "state", samples), parameters=inner)
    if inner:
        by_par = by_par + _slopes(function, "parameters", samples)[:, : problem.par.size].sum(axis=0)
    grads: dict[str, Array] = {}
    for name in names:
        if name == START:
            grads[name] = back
        elif name == TIME:
            grads[name] = -back @ targets.numpy(system, "field")(problem.t0, problem.y0, problem.par)
        else:
            grads[name] = by_par[slices[name]].reshape(np.shape(system.parameters[name]))
    return value, {name: np.asarray(each) for name, each in grads.items()}


def _samples(
    problem: Problem, t_end: float | None, times: ArrayLike | None, data: ArrayLike | None
) -> tuple[Array, Array]:
    """Return the times of samples, (m,), and what belongs to them, (m,) or (m, n), with n = 0 for nothing."""
    if times is None:
        if data is not None:
            raise InputError("data belong to samples: give their times=.")
        return np.array([problem.t_end if t_end is None else t_end]), np.empty((1, 0))
    if t_end is not None:
        raise InputError(f"times= end at the last of them; leave out t_end={t_end!r}.")
    grid = check_times(times, problem.t0)
    if data is None:
        return grid, np.empty((grid.size, 0))
    rows = plain_numbers("data", data)
    if rows.ndim not in (1, 2) or len(rows) != grid.size or not np.isfinite(rows).all():
        raise InputError(
            f"data must be finite numbers of shape ({grid.size},) or ({grid.size}, n), one row for each of "
            f"the times, not of shape {rows.shape}."
        )
    return grid, rows


def _slopes(function: Any, variables: Any, samples: list[tuple[float, Array, Array]]) -> Array:
    """Return the derivatives of a function at samples, one row for each."""
    _, y, par = samples[0]
    count = y.size if variables == "state" else par.size
    slopes = targets.numpy_of(
        reverse(function, variables=variables, count=count, name="loss_slope"), "loss_slope"
    )
    return np.array([slopes(t, np.concatenate([[1.0], y]), numbers) for t, y, numbers in samples])
