"""States of problems of bodies: what they say of the bodies, and states of bodies on many orbits."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems import targets
from problems.bodies.orbits import (
    BARYCENTRIC,
    JACOBI,
    Elements,
    Orbit,
    body_index,
    elements_of,
    primary_index,
)
from problems.checks import checked_arguments
from problems.errors import InputError, shown
from problems.problem import Problem, check_is_problem
from problems.quantities import refuse_more_than_numbers
from problems.systems.base import System

Array = NDArray[np.float64]
SWEEPS = 100  # of the iteration for momenta from velocities


@checked_arguments
def bodies_of(
    problem: Problem, y: ArrayLike | None = None, t: float | None = None
) -> tuple[Array, Array, Array]:
    """Return masses, positions and velocities of the bodies of a problem, such as `nbody` returns.

    Parameters
    ----------
    problem : Problem
        A problem of bodies in space.
    y : array_like, shape (dim,), optional
        A state, such as ``solution.y[-1]``; by default the start.
    t : float, optional
        Its time; by default ``problem.t0``.

    Returns
    -------
    masses : ndarray, shape (m,)
        The parameter ``m``; other bodies are massless.
    positions, velocities : ndarray, shape (n, 3)

    Raises
    ------
    problems.errors.InputError
        For a problem without bodies in space, and for what is no state of it.

    Examples
    --------
    >>> from problems import nbody
    >>> from problems.bodies import bodies_of
    >>> pair = nbody([4.0, 2.0], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 0.5, 0]], t_end=1.0)
    >>> masses, x, v = bodies_of(pair)
    >>> masses.tolist(), v[1].tolist()
    ([4.0, 2.0], [0.0, 0.5, 0.0])
    """
    check_is_problem(problem)
    system, values = problem.system, problem.system.unpack(problem.par)
    n, masses = system.dim // 6, np.atleast_1d(np.array(values.get("m", []), dtype=np.float64))
    if system.dim % 6 or not 0 < masses.size <= n or (system.dof is not None and masses.size != n):
        raise InputError(f"{problem!s} has no bodies in space; make it with problems.nbody.")
    try:
        state = problem.y0 if y is None else np.array(y, dtype=np.float64)
    except (TypeError, ValueError):
        state = np.empty(0)
    if state.shape != (system.dim,) or not np.isfinite(state).all():
        raise InputError(f"y={shown(y)} must be a state of {system.name}, {system.dim} numbers, all finite.")
    half, v = 3 * n, state[3 * n :]
    if system.dof is not None:
        v = targets.numpy(system, "field")(problem.t0 if t is None else t, state, problem.par)[:half]
    return masses, state[:half].reshape(n, 3).copy(), v.reshape(n, 3).copy()


@checked_arguments
def starts(
    problem: Problem,
    body: int | str,
    positions: Any,
    velocities: ArrayLike | None = None,
) -> Array:
    """Return initial states of a problem with one body on many orbits, for ensembles and maps.

    Parameters
    ----------
    problem : Problem
        A problem of bodies in space, such as `nbody` returns. The other bodies stay where they are.
    body : int or str
        Which body, by its index (-1 is the last one) or name.
    positions : Orbit or array_like, shape (N, 3)
        An `Orbit` whose elements are arrays, or positions.
    velocities : array_like, shape (N, 3), optional
        With positions.

    Returns
    -------
    ndarray, shape (N, dim)
        As ``starts=`` of `integrators.integrate_many` and of maps takes them; of arrays with several
        dimensions the last one varies fastest.

    Raises
    ------
    problems.errors.InputError
        For a problem without bodies in space, a body that is not there, and arrays of other shapes.

    Examples
    --------
    >>> import numpy as np
    >>> from integrators import HBVM, integrate_many
    >>> from problems import nbody
    >>> from problems.bodies import Orbit, starts
    >>> belt = nbody([1.0, 1e-3], orbits=[Orbit(a=1.0), Orbit(a=0.5)], massless=1, t_end=20.0)
    >>> rows = starts(belt, -1, Orbit(a=np.linspace(0.4, 0.6, 500), e=0.1))
    >>> made = integrate_many(belt, HBVM(), starts=rows)
    >>> made.y.shape, bool(made.arrived.all())
    ((500, 1, 18), True)
    """
    masses, x, v = bodies_of(problem)
    n = len(x)
    i = body_index(body, problem.bodies, n)
    mu = np.concatenate([masses, np.zeros(n - masses.size)]) * _constant(problem)
    if isinstance(positions, Orbit):
        if velocities is not None:
            raise InputError("an Orbit says what the velocities are; leave out velocities.")
        about = primary_index(positions.primary, problem.bodies, n)
        check_about(about, i)
        weights, size = weights_of(about, mu, i)
        new_x, new_v = (
            # the barycentre moves with the body, by its share
            (weights @ rows - weights[i] * rows[i] + relative.reshape(-1, 3)) / (1.0 - weights[i])
            for rows, relative in zip((x, v), positions.state(size, problem.t0), strict=True)
        )
    else:
        count = len(np.atleast_1d(positions))
        if velocities is None:
            raise InputError("starts needs velocities with positions, or an Orbit.")
        new_x, new_v = rows_of("positions", positions, count), rows_of("velocities", velocities, count)
    rows = np.tile(problem.y0, (len(new_x), 1))
    place, speed = slice(3 * i, 3 * i + 3), slice(3 * (n + i), 3 * (n + i) + 3)
    rows[:, place] = new_x
    if problem.system.dof is None:
        rows[:, speed] = new_v
    elif problem.system.velocity_scale is not None:
        rows[:, speed] = masses[i] * new_v
    else:
        for row, one in zip(rows, new_v, strict=True):
            everyone = v.copy()
            everyone[i] = one
            row[3 * n :] = momenta_of(problem.system, problem.t0, row[: 3 * n].copy(), everyone, masses)
    return rows


@checked_arguments
def elements(
    problem: Problem,
    y: ArrayLike | None = None,
    t: ArrayLike | None = None,
    *,
    body: int | str,
    primary: int | str = 0,
) -> Elements:
    """Return the orbital elements of a body in states of a problem; see also ``solution.elements``.

    Parameters
    ----------
    problem : Problem
        A problem of bodies in space, such as `nbody` returns.
    y : array_like, shape (..., dim), optional
        States; by default the start.
    t : array_like, shape (...), optional
        Their times, for the times of pericentres; by default ``problem.t0``.
    body : int or str
        Which body, by its index or name.
    primary : int or str
        What the orbit is about, as in `Orbit`.

    Returns
    -------
    Elements
        Arrays of shape (...).

    Raises
    ------
    problems.errors.InputError
        For a problem without bodies in space, a body that is not there, and states of another length.

    Examples
    --------
    >>> from problems import nbody
    >>> from problems.bodies import Orbit, elements
    >>> pair = nbody([1.0, 1e-3], orbits=[Orbit(a=2.0, e=0.3)], t_end=1.0)
    >>> round(float(elements(pair, body=1).e), 12)
    0.3
    """
    masses, x, _ = bodies_of(problem)
    n, system = len(x), problem.system
    states = np.asarray(problem.y0 if y is None else y, dtype=np.float64)
    if states.shape[-1:] != (system.dim,):
        raise InputError(f"y must be states of {system.name} of length {system.dim}, not {shown(y)}.")
    times = np.broadcast_to(np.asarray(problem.t0 if t is None else t, dtype=np.float64), states.shape[:-1])
    i, about = body_index(body, problem.bodies, n), primary_index(primary, problem.bodies, n)
    check_about(about, i)
    mu = np.concatenate([masses, np.zeros(n - masses.size)]) * _constant(problem)
    weights, size = weights_of(about, mu, i)
    weights[i] -= 1.0
    q, v = states[..., : 3 * n], states[..., 3 * n :]
    if system.velocity_scale is not None:
        v = v / np.repeat(masses, 3)
    elif system.dof is not None:
        field = targets.numpy(system, "field")
        rows = zip(times.ravel(), states.reshape(-1, system.dim), strict=True)
        v = np.array([field(at, row, problem.par)[: 3 * n] for at, row in rows]).reshape(q.shape)
    apart, speed = (-(weights @ part.reshape(*part.shape[:-1], n, 3)) for part in (q, v))
    return elements_of(apart, speed, size, times)


def _constant(problem: Problem) -> float:
    """Return the constant of gravitation."""
    return float(np.asarray(problem.system.unpack(problem.par).get("G", 1.0)))


def masses_of(masses: ArrayLike) -> Array:
    """Return a copy of masses that are checked."""
    refuse_more_than_numbers("masses", masses)
    try:
        values = np.array(masses, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty((0, 0))
    if values.ndim != 1 or not values.size or not (np.isfinite(values) & (values > 0.0)).all():
        raise InputError(
            f"masses={shown(masses)} must be a list of positive numbers; bodies without mass come last, "
            "and massless= says how many they are."
        )
    return values


def rows_of(label: str, rows: ArrayLike, n: int) -> Array:
    """Return a copy of three numbers for each of n bodies, which are checked."""
    refuse_more_than_numbers(label, rows)
    try:
        values = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.shape != (n, 3) or not np.isfinite(values).all():
        raise InputError(f"{label} must be finite numbers of shape ({n}, 3), not {shown(rows)}.")
    return values


def check_about(about: int | str, body: int) -> None:
    """Raise `problems.errors.InputError` for an orbit of a body about itself."""
    if about == body or (about == JACOBI and body == 0):
        raise InputError(f"the orbit of body {body} has primary={about!r}; give another one.")


def weights_of(about: int | str, mu: Array, body: int) -> tuple[Array, float]:
    """Return of which bodies the centre of mass is what an orbit is about, and mu of the orbit."""
    weights = np.zeros(mu.size)
    if about == BARYCENTRIC:
        return mu / mu.sum(), float(mu.sum())
    if about == JACOBI:
        weights[:body] = mu[:body] / mu[:body].sum()
        return weights, float(mu[: body + 1].sum())
    weights[int(about)] = 1.0
    return weights, float(mu[int(about)] + mu[body])


def momenta_of(system: System, t: float, q: Array, v: Array, masses: Array) -> Array:
    """Return the momenta with which bodies have these velocities: p + m (v - dH/dp) until it stays."""
    field, weights = targets.numpy(system, "field"), np.repeat(masses, 3)
    wanted, par = v.reshape(-1), system.pack()
    p = weights * wanted
    for _ in range(SWEEPS):
        following = p + weights * (wanted - field(t, np.concatenate([q, p]), par)[: q.size])
        if np.array_equal(following, p):
            break
        p = following
    return p
