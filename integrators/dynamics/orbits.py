"""Periodic orbits by shooting, their stability, and families of them.

An orbit of period T starts at a zero of y(T; y0) - y0. Newton's method takes the derivatives of the steps, so
it finds a periodic orbit of the numerical map (E. J. Doedel and others, Int. J. Bifurcation and Chaos 13
(2003), 1353-1381, on families in conservative systems). There and in autonomous systems solutions are not
isolated: of all corrections that solve the linear equations the shortest is taken.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from integrators import registry
from integrators.dynamics.vectors import with_variations
from integrators.protocol import Array, MethodBase, Status
from integrators.running.variations import places
from problems import targets
from problems.analysis.structure import depends_on_time
from problems.checks import Must, at_least, checked_arguments
from problems.errors import InputError, shown, unknown
from problems.problem import Problem, check_is_problem
from problems.quantities import plain_numbers

PERIOD = "period"
CUT = 1e-10  # singular values below this part of the largest are those of directions along a family
HALVINGS = 10  # of a correction that makes the orbit worse
ROUNDING = 100.0  # a residual of so many units in the last place, times the norm of the map, is rounding
SHORTEST = 0.1  # part of the guessed period below which none is looked for: in no time every state is back
AT_REST = 1e-8  # a state that would move by this part of its size in a period is an equilibrium
MIRRORED = 1e-9  # error of a field's symmetry that is rounding, relative to the field

Positive = Annotated[float, Must("a number above 0", lambda x: x > 0)]


@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A periodic orbit, or the closest approximation that was found.

    Attributes
    ----------
    problem : Problem
        The orbit: its start, its parameters, and the end of one period.
    method : MethodBase
        What it was integrated with.
    period : float
        The time T after which it is back.
    monodromy : ndarray, shape (dim, dim)
        The derivative of the state after a period with respect to the start.
    multipliers : ndarray of complex, shape (dim,)
        Floquet multipliers: the eigenvalues of the monodromy matrix, the largest in modulus first. Those that
        are 1 for every orbit of the system, two of an autonomous canonical one, have the square root of
        the rounding errors of the others.
    residual : float
        Largest component of y(T) - y0.
    converged : bool
        Whether that is within the tolerance, or rounding.
    iterations : int
        Corrections by Newton's method.
    reason : str
        Why the search ended, where it did not converge; else empty.
    free : tuple of int or str
        What the search could change.
    mirror : ndarray of float, shape (dim,), or None
        Signs of the reflection that the search used.
    """

    problem: Problem
    method: MethodBase
    period: float
    monodromy: Array
    multipliers: Any
    residual: float
    converged: bool
    iterations: int
    reason: str
    free: tuple[int | str, ...]
    mirror: Array | None

    @property
    def y0(self) -> Array:
        """The start; shape (dim,)."""
        return self.problem.y0


@checked_arguments
def periodic(
    problem: Problem,
    guess: ArrayLike | None = None,
    *,
    period: Positive | None = None,
    method: MethodBase | None = None,
    free: Any = None,
    mirror: ArrayLike | None = None,
    tol: Positive = 1e-12,
    most: Annotated[int, at_least(1)] = 30,
) -> PeriodicOrbit:
    r"""Return a periodic orbit near a guess.

    Parameters
    ----------
    problem : Problem
        The system and its parameters; traced.
    guess : array_like, shape (dim,), optional
        A start near the orbit; by default the problem's.
    period : float, optional
        A guess of the period; by default the time from the problem's ``t0`` to its ``t_end``.
    method : MethodBase, optional
        `Gauss` or `HBVM`; by default ``HBVM()``.
    free : sequence of int or str, optional
        What may change: components of the start by number, ``"period"``, and parameters by name. By
        default the whole start and, unless the time is in the formula, the period.
    mirror : array_like, shape (dim,), optional
        Signs +1 and -1 of a reflection R that reverses the flow, f(R y) = -R f(y). Then an orbit that starts
        at R y = y and is there again after half a period is sought, which takes half the integration and
        fewer unknowns. For (q, p) with a kinetic energy that is even in p, the signs are +1 for q and -1 for
        p.
    tol : float
        Largest component of the residual, relative to the largest of the start. A residual that rounding
        accounts for, as of very unstable orbits, is accepted too.
    most : int
        Corrections, at most.

    Returns
    -------
    PeriodicOrbit
        Where ``converged`` is False, with the nearest that was found, and the reason.

    Raises
    ------
    problems.errors.InputError
        For a method or a system without variations, and arguments that do not fit the problem.

    Examples
    --------
    >>> import problems
    >>> from integrators import periodic
    >>> orbit = periodic(problems.load("cr3bp", loops=2), mirror=[1, -1, -1, 1], free=[3, "period"])
    >>> orbit.converged, round(orbit.period, 8)
    (True, 6.19216933)
    """
    check_is_problem(problem)
    method = registry.create("HBVM") if method is None else method
    start = problem.y0 if guess is None else plain_numbers("guess", guess)
    if start.shape != problem.y0.shape or not np.isfinite(start).all():
        raise InputError(f"guess={shown(guess)} must be {problem.system.dim} finite numbers.")
    span = abs(problem.t_end - problem.t0) if period is None else period
    if span == 0.0:
        raise InputError(f"the problem ends at its start, t0={problem.t0!r}; give a guess of the period.")
    search = _Search(problem, method, _free(problem, free, mirror), _signs(problem, start, mirror), span)
    point = _Point(start.copy(), span, problem.par.copy())
    reason, iterations, residual, matrix, norm = "", 0, *search.at(point)
    if residual is None:
        raise InputError(f"{method!r} does not arrive at the end of the period {span!r}; give another guess.")
    scale = max(float(np.abs(start).max()), np.finfo(float).tiny)
    while True:
        size = float(np.abs(residual).max())
        enough = max(tol * scale, ROUNDING * np.finfo(float).eps * norm * scale)
        if size == 0.0 or iterations >= most:
            break
        correction: Array = np.linalg.lstsq(matrix, -residual, rcond=CUT)[0].astype(np.float64)
        better = search.better(point, correction, size, 1 if size <= enough else HALVINGS)
        if better is None:
            break
        point, residual, matrix, norm = better
        iterations += 1
    speed = float(np.abs(search.field(problem.t0, point.y0, point.par)).max())
    if size <= enough and speed * point.period <= AT_REST * scale:
        reason = "an equilibrium was found; give a guess that is further from it."
    if size > enough:
        reason = (
            f"a residual of {size:.1e} is left after {iterations} corrections; "
            "give a better guess, or let more be free."
        )
    return search.orbit(point, tol * scale, ROUNDING * scale, iterations, reason)


@checked_arguments
def continued(
    orbit: PeriodicOrbit,
    along: Any,
    values: ArrayLike,
    *,
    tol: Positive = 1e-12,
    most: Annotated[int, at_least(1)] = 30,
) -> list[PeriodicOrbit]:
    """Return the family of a periodic orbit: one orbit for each value of a parameter or component.

    The guess for each is on the line through the two before. The family ends with the first value for which
    there is none, such as beyond a fold; that one is the last of the list, and has not converged.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Where to begin.
    along : str or int
        What is given: a parameter by name, a component of the start by number, or ``"period"``.
    values : array_like, shape (n,)
        Its values, in order.
    tol, most
        As for `periodic`.

    Returns
    -------
    list of PeriodicOrbit

    Raises
    ------
    problems.errors.InputError
        As `periodic`.

    Examples
    --------
    >>> import problems
    >>> from integrators import periodic
    >>> from integrators.dynamics import continued
    >>> orbit = periodic(problems.load("cr3bp", loops=2), mirror=[1, -1, -1, 1], free=[3, "period"])
    >>> family = continued(orbit, "mu", [0.0122, 0.0123])
    >>> [round(each.period, 4) for each in family]
    [6.1918, 6.1914]
    """
    problem, orbits = orbit.problem, [orbit]
    index = _index(problem, along)
    free = tuple(name for name in orbit.free if name != along)
    for value in np.atleast_1d(plain_numbers("values", values)).tolist():
        points = [np.concatenate([each.y0, each.problem.par, [each.period]]) for each in orbits[-2:]]
        before, last = points[0], points[-1]
        step = last[index] - before[index]
        guess = last + (last - before) * ((value - last[index]) / step if step else 0.0)
        guess[index] = value
        y0, par = guess[: problem.system.dim], guess[problem.system.dim : -1]
        parameters: Any = problem.system.unpack(par)
        end = problem.t0 + float(guess[-1])
        base = problem.replace(y0=y0, parameters=parameters, t_end=end)
        next_orbit = periodic(base, method=orbit.method, free=free, mirror=orbit.mirror, tol=tol, most=most)
        orbits.append(next_orbit)
        if not next_orbit.converged:
            break
    return orbits[1:]


@dataclass(frozen=True)
class _Point:
    """What a search changes."""

    y0: Array
    period: float
    par: Array


class _Search:
    """The equations of a periodic orbit, and their derivatives."""

    def __init__(
        self,
        problem: Problem,
        method: MethodBase,
        free: tuple[int | str, ...],
        mirror: Array | None,
        period: float,
    ):
        self._shortest = SHORTEST * period
        self.problem, self.method, self.free, self.mirror = problem, method, free, mirror
        system = problem.system
        at = places(problem)
        self.components = [name for name in free if isinstance(name, int)]
        numbers = np.arange(system.n_par)
        self.parameters = [int(i) for name in free if name in at for i in numbers[at[str(name)]]]
        if not (self.components or self.parameters or PERIOD in free):
            raise InputError("free=() leaves nothing to change; give components, 'period' or parameters.")
        self.field = targets.numpy(system, "field")

    def at(self, point: _Point) -> tuple[Array | None, Array, float]:
        """Return the residual, its derivatives by what is free, and the norm of the map.

        There is no residual where the end is not reached.
        """
        dim, more = point.y0.size, len(self.parameters)
        states = np.eye(dim, dim + more)
        parameters = np.zeros((point.par.size, dim + more))
        parameters[self.parameters, dim + np.arange(more)] = 1.0
        half = 1.0 if self.mirror is None else 0.5
        end, maps = self.flow(point, half * point.period, states, parameters)
        if end is None:
            return None, maps, np.inf
        slope = self.field(self.problem.t0 + half * point.period, end, point.par) * half
        norm = float(np.linalg.norm(maps[:, :dim], 2))
        if self.mirror is None:
            residual, maps = end - point.y0, maps - np.eye(*maps.shape)
        else:
            back = self.mirror < 0
            residual, maps, slope = end[back], maps[back], slope[back]
        columns = [maps[:, self.components]]
        columns += [slope[:, np.newaxis]] if PERIOD in self.free else []
        columns += [maps[:, dim:]]
        return residual, np.concatenate(columns, axis=1), norm

    def flow(
        self, point: _Point, span: float, states: Array, parameters: Array
    ) -> tuple[Array | None, Array]:
        """Return the state after a time, and tangent vectors there; no state where that is not reached."""
        stepper = with_variations(self._problem(point), self.method)
        stepper.follow(states, parameters)
        samples = stepper.advance([self.problem.t0 + span])
        if samples.status is not Status.FINISHED or not np.isfinite(stepper.variations).all():
            return None, states
        return samples.y[-1], stepper.variations[-1]

    def better(
        self, point: _Point, correction: Array, size: float, tries: int
    ) -> tuple[_Point, Array, Array, float] | None:
        """Return the first point on the way of a correction that is better, with what `at` returns there."""
        for halving in range(tries):
            new = self._moved(point, correction * 0.5**halving)
            if new.period > self._shortest:
                residual, matrix, norm = self.at(new)
                if residual is not None and float(np.abs(residual).max()) < size:
                    return new, residual, matrix, norm
        return None

    def orbit(
        self, point: _Point, wanted: float, scale: float, iterations: int, reason: str
    ) -> PeriodicOrbit:
        """Return what is known of the orbit at a point."""
        dim = point.y0.size
        end, monodromy = self.flow(point, point.period, np.eye(dim), np.zeros((point.par.size, dim)))
        residual = np.inf if end is None else float(np.abs(end - point.y0).max())
        rounding = np.finfo(float).eps * scale * float(np.linalg.norm(monodromy, 2))
        if not reason and not residual <= max(wanted, rounding):
            reason = f"a residual of {residual:.1e} is left after a whole period; give a better guess."
        values = np.linalg.eigvals(monodromy)
        return PeriodicOrbit(
            self._problem(point), self.method, point.period, monodromy, values[np.argsort(-np.abs(values))],
            residual, not reason, iterations, reason, self.free, self.mirror,
        )  # fmt: skip

    def _problem(self, point: _Point) -> Problem:
        base = self.problem
        parameters: Any = base.system.unpack(point.par)
        return Problem(
            base.system, y0=point.y0, parameters=parameters, t0=base.t0, t_end=base.t0 + point.period
        )

    def _moved(self, point: _Point, correction: Array) -> _Point:
        y0, par, period, n = point.y0.copy(), point.par.copy(), point.period, len(self.components)
        y0[self.components] += correction[:n]
        if PERIOD in self.free:
            period += float(correction[n])
            n += 1
        par[self.parameters] += correction[n:]
        return _Point(y0, period, par)


def _free(problem: Problem, free: Any, mirror: ArrayLike | None) -> tuple[int | str, ...]:
    """Return what may change, checked."""
    system = problem.system
    timed = system.traced and depends_on_time(system)
    if free is None:
        kept = range(system.dim) if mirror is None else np.flatnonzero(np.asarray(mirror) > 0).tolist()
        return (*kept, *(() if timed else (PERIOD,)))
    names = (free,) if isinstance(free, str | int) else tuple(free) if isinstance(free, Sequence) else (free,)
    for name in names:
        _index(problem, name)
    if timed and PERIOD in names:
        raise InputError("the time is in the formula, whose period is given; leave 'period' out of free.")
    return names


def _index(problem: Problem, name: Any) -> int:
    """Return where a component, a parameter or the period is in start, parameters, period."""
    system = problem.system
    at = places(problem)
    if isinstance(name, int) and not isinstance(name, bool):
        if not 0 <= name < system.dim:
            raise InputError(f"component {name} of {system.name} must be one of 0 to {system.dim - 1}.")
        return name
    if name == PERIOD:
        return system.dim + system.n_par
    if not isinstance(name, str) or name not in at:
        raise unknown("component or parameter", name, (PERIOD, *at))
    return system.dim + at[name].start


def _signs(problem: Problem, start: Array, mirror: ArrayLike | None) -> Array | None:
    """Return the signs of a reflection; states near the guess tell whether it is a symmetry."""
    if mirror is None:
        return None
    system, signs = problem.system, plain_numbers("mirror", mirror)
    if signs.shape != start.shape or not (np.abs(signs) == 1.0).all():
        raise InputError(f"mirror={shown(mirror)} must be {system.dim} signs, 1 or -1.")
    if start[signs < 0].any():
        raise InputError(
            f"the guess {shown(start.tolist())} is not its own image; components with -1 must be 0."
        )
    if system.traced and depends_on_time(system):
        raise InputError("the time is in the formula, so that no mirror reverses the flow; leave mirror out.")
    field, rng = targets.numpy(system, "field"), np.random.default_rng(0)
    for _ in range(3):
        y = start + 1e-3 * max(float(np.abs(start).max()), 1.0) * rng.standard_normal(start.size)
        there, here = field(problem.t0, signs * y, problem.par), field(problem.t0, y, problem.par)
        if not np.abs(there + signs * here).max() <= MIRRORED * np.abs(here).max():
            raise InputError(f"mirror={shown(mirror)} does not reverse the flow: f(R y) is not -R f(y).")
    return signs
