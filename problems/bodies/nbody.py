"""Gravitational N-body problems, with additional forces."""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems import emit
from problems.bodies import gravity
from problems.checks import CheckedOptions, Positive, at_least, checked_arguments
from problems.errors import InputError, shown
from problems.problem import Problem, check_is_problem
from problems.systems.base import System
from problems.systems.vector_field import VectorField

__all__ = ["J2", "PostNewtonian", "bodies_of", "nbody"]

Array = NDArray[np.float64]
SWEEPS = 100  # of the iteration for momenta from velocities


@dataclass(frozen=True)
class J2(CheckedOptions):
    """Oblateness of a body: the P2 term of its gravitational potential.

    The potential energy with a body of mass m at the distance r and the height z above the equator is ``-(G M
    m/r) (1 - J2 (R/r)^2 (3 (z/r)^2 - 1)/2)``; the forces on both bodies follow from it.

    Parameters
    ----------
    J2, R : float
        The coefficient, and the radius of the body that it belongs to.
    body : int
        Index of the oblate body.
    pole : sequence of float
        Direction of its axis: three numbers, not all 0.

    Examples
    --------
    >>> from problems.bodies import J2
    >>> J2(J2=1.0826e-3, R=6378.137)
    J2(J2=0.0010826, R=6378.137, body=0, pole=(0.0, 0.0, 1.0))
    """

    _owner: ClassVar[str | None] = "J2"

    J2: float
    R: Positive
    body: Annotated[int, at_least(0)] = 0
    pole: Sequence[float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        pole = np.array(self.pole, dtype=np.float64)
        if pole.shape != (3,) or not np.isfinite(pole).all() or not pole.any():
            raise InputError(f"pole={shown(self.pole)} of J2 must be three numbers, not all 0.")
        object.__setattr__(self, "pole", tuple(pole.tolist()))

    def _axis(self) -> list[float]:
        return (np.array(self.pole) / np.linalg.norm(self.pole)).tolist()

    def energy(self, q: Any, p: Any, masses: Any, G: Any, m: Any) -> Any:
        """Return the energy that it adds."""
        axis, total, i = self._axis(), 0.0, self.body
        for j in range(len(masses)):
            if j != i:
                d = [q[3 * j + c] - q[3 * i + c] for c in range(3)]
                square = _dot(d, d)
                height = _dot(axis, d)
                cubed = square * m.sqrt(square)
                total = total + masses[j] * (3 * height * height / square - 1) / cubed
        return G * masses[i] * self.J2 * self.R**2 / 2 * total

    def pull(self, d: list[Any], m: Any) -> list[Any]:
        """Return the acceleration at d from the body, for G M = 1."""
        axis, square = self._axis(), _dot(d, d)
        height, fifth = _dot(self._axis(), d), square * square * m.sqrt(square)
        factor = 1.5 * self.J2 * self.R**2 / fifth
        along = 5 * height * height / square - 1
        return [factor * (along * d[c] - 2 * height * axis[c]) for c in range(3)]


@dataclass(frozen=True)
class PostNewtonian(CheckedOptions):
    """First post-Newtonian corrections, of order 1/c^2, between all bodies (Einstein, Infeld and Hoffmann).

    The Hamiltonian, in ADM coordinates, has the additional terms the sum over a of
    ``-p_a^4/(8 m_a^3) + G^2 m_a (sum_b m_b/r_ab)^2/2`` and over pairs a, b, both ways, of
    ``-(G m_a m_b/(4 r_ab)) (6 p_a^2/m_a^2 - (7 p_a.p_b + (n_ab.p_a)(n_ab.p_b))/(m_a m_b))``, all over c^2.

    Beside massless bodies or functions among the forces it is the acceleration of Einstein, Infeld and
    Hoffmann in positions and velocities, in harmonic coordinates, which are those of ADM to this order. The
    two forms differ by terms of the order 1/c^4, and the energy is conserved to that order only. With other
    forces there are no terms of both.

    Parameters
    ----------
    c : float
        The velocity of light, in the units of the bodies.

    References
    ----------
    A. Einstein, L. Infeld, B. Hoffmann, The gravitational equations and the problem of motion, Annals of
    Mathematics 39 (1938), 65-100.

    Examples
    --------
    >>> from problems.bodies import PostNewtonian
    >>> PostNewtonian(c=63241.077)  # au in a year
    PostNewtonian(c=63241.077)
    """

    _owner: ClassVar[str | None] = "PostNewtonian"

    c: Positive

    def energy(self, q: Any, p: Any, masses: Any, G: Any, m: Any) -> Any:
        """Return the energy that it adds."""
        n = len(masses)
        momenta = [[p[3 * i + c] for c in range(3)] for i in range(n)]
        squares = [_dot(momentum, momentum) for momentum in momenta]
        depth: list[Any] = [0.0] * n
        total = 0.0
        for a in range(n):
            total = total - squares[a] * squares[a] / (8 * masses[a] * masses[a] * masses[a])
            for b in range(a):
                d = [q[3 * a + c] - q[3 * b + c] for c in range(3)]
                r = m.sqrt(_dot(d, d))
                along = _dot(d, momenta[a]) * _dot(d, momenta[b]) / (r * r)
                own = 3 * (squares[a] * masses[b] / masses[a] + squares[b] * masses[a] / masses[b])
                total = total - G / r * (own - (7 * _dot(momenta[a], momenta[b]) + along)) / 2
                depth[a], depth[b] = depth[a] + masses[b] / r, depth[b] + masses[a] / r
        for a in range(n):
            total = total + G * G * masses[a] * depth[a] * depth[a] / 2
        return total / self.c**2

    def pull(
        self, x: list[list[Any]], v: list[list[Any]], mu: list[Any], newton: list[list[Any]], m: Any
    ) -> list[list[Any]]:
        """Return the accelerations that it adds, of all bodies, of which the first ones have the masses.

        ``mu`` is G times them, and ``newton`` the accelerations of these by Newton's attraction.
        """
        n, total = len(mu), len(x)
        depth: list[Any] = [0.0] * total
        r: dict[tuple[int, int], Any] = {}
        for a in range(total):
            for b in range(min(a, n)):
                d = [x[a][i] - x[b][i] for i in range(3)]
                r[a, b] = r[b, a] = m.sqrt(_dot(d, d))
                depth[a] = depth[a] + mu[b] / r[a, b]
                if a < n:
                    depth[b] = depth[b] + mu[a] / r[a, b]
        added = []
        for a in range(total):
            sums: list[Any] = [0.0] * 3
            for b in (b for b in range(n) if b != a):
                d = [x[b][i] - x[a][i] for i in range(3)]
                square = r[a, b] * r[a, b]
                along, inverse = _dot(d, v[b]), mu[b] / (square * r[a, b])
                factor = (
                    _dot(v[a], v[a]) + 2 * _dot(v[b], v[b]) - 4 * _dot(v[a], v[b])
                    - 1.5 * along * along / square - 4 * depth[a] - depth[b] + _dot(d, newton[b]) / 2
                )  # fmt: skip
                drag = 3 * along - 4 * _dot(d, v[a])
                for i in range(3):
                    sums[i] = sums[i] + (
                        inverse * (factor * d[i] + drag * (v[a][i] - v[b][i]))
                        + 3.5 * mu[b] / r[a, b] * newton[b][i]
                    )  # fmt: skip
            added.append([component / self.c**2 for component in sums])
        return added


Force = J2 | PostNewtonian | Callable[..., Any]


@checked_arguments
def nbody(
    masses: ArrayLike,
    positions: ArrayLike,
    velocities: ArrayLike,
    *,
    massless: Annotated[int, at_least(0)] = 0,
    forces: Sequence[Any] = (),
    G: float = 1.0,
    softening: Positive | None = None,
    t0: float = 0.0,
    t_end: float,
    name: str | None = None,
) -> Problem:
    """Return a gravitational N-body problem from masses, positions and velocities.

    Parameters
    ----------
    masses : array_like, shape (n,)
        Positive, and none below 1e-10 of the largest (use ``massless`` for such bodies). They are the
        parameter ``m``; the gravitational constant is the parameter ``G``.
    positions, velocities : array_like, shape (n + massless, 3)
        Those of the bodies with mass, then those of the massless ones.
    massless : int
        Number of massless bodies (test particles), the last ones. The sums over pairs are then unrolled: 5
        bodies with mass and 23 without compile in 14 s.
    forces : sequence
        Additional forces: `J2`, `PostNewtonian`, or a function that returns accelerations, three for each
        body; its arguments are among ``t, x, v, masses, m``, where x and v are lists of three numbers for
        each body. It is traced, as a Hamiltonian is.
    G : float
        The gravitational constant, in the units of masses, lengths and times.
    softening : float, optional
        Softening length eps: distances are sqrt(r^2 + eps^2).
    t0, t_end : float
        The integration interval.
    name : str, optional
        Name of the system.

    Returns
    -------
    Problem
        Without massless bodies and functions a `Hamiltonian`, whose state is positions and momenta, body by
        body; then HBVM conserves the energy. Otherwise a `VectorField`, with velocities in place of momenta.

    Raises
    ------
    problems.errors.InputError
        For arrays of other shapes, masses that are not positive, two bodies at one place, and softening with
        `PostNewtonian` beside massless bodies or a function.

    Examples
    --------
    >>> from integrators import HBVM, integrate
    >>> from problems import nbody
    >>> from problems.bodies import J2
    >>> x, v = [[0, 0, 0], [1.2, 0, 0]], [[0, 0, 0], [0, 0.8, 0.4]]
    >>> orbit = nbody([1.0, 1e-9], x, v, forces=[J2(J2=1.0826e-3, R=1.0)], t_end=20.0)
    >>> bool(integrate(orbit, HBVM()).errors()["energy"].max() < 1e-14)
    True
    """
    mass, n = masses_of(masses), np.size(masses)
    x, v = (
        rows_of(label, given, n + massless)
        for label, given in (("positions", positions), ("velocities", velocities))
    )
    for a in range(n + massless):
        same = np.flatnonzero((x[: min(a, n)] == x[a]).all(axis=1))
        if same.size and not softening:
            raise InputError(
                f"bodies {same[0]} and {a} are at one place; move one of them, or give softening=."
            )
    if not isinstance(forces, Sequence):
        raise InputError(f"forces={shown(forces)} must be a list of forces, such as [PostNewtonian(c=...)].")
    fields = [force for force in forces if not isinstance(force, J2 | PostNewtonian)]
    for force in forces:
        if not callable(force) and force in fields:
            raise InputError(f"{shown(force)} is no force; give a J2, a PostNewtonian or a function.")
        if isinstance(force, J2) and force.body >= n:
            raise InputError(f"body={force.body} of J2 is none of the {n} bodies with masses.")
    called = name or f"bodies_{n + massless}"
    if not fields and not massless:
        system: System = gravity.hamiltonian(
            mass.tolist(), name=called, G=G, softening=softening,
            angular_momentum=not any(isinstance(force, J2) for force in forces),
            more=[force.energy for force in forces],
        )  # fmt: skip
        momenta = _momenta(system, t0, x.reshape(-1), v, mass) if forces else (mass[:, None] * v).reshape(-1)
        return Problem(system, q0=x.reshape(-1), p0=momenta, t0=t0, t_end=t_end)
    relativity = [force for force in forces if isinstance(force, PostNewtonian)]
    if relativity and softening is not None:
        raise InputError(
            f"softening={softening!r} has no relativistic form beside massless bodies or functions among the "
            "forces; leave out softening= or PostNewtonian."
        )
    field = _accelerated(n, massless, softening, [f for f in forces if isinstance(f, J2)], fields, relativity)
    system = VectorField(
        field, dim=6 * (n + massless), parameters={"m": tuple(mass.tolist()), "G": G}, name=called
    )
    return Problem(system, y0=np.concatenate([x.reshape(-1), v.reshape(-1)]), t0=t0, t_end=t_end)


def _accelerated(
    n: int,
    massless: int,
    softening: float | None,
    flattened: list[J2],
    fields: list[Callable[..., Any]],
    relativity: list[PostNewtonian],
) -> Callable[..., list[Any]]:
    """Return the derivative of positions and velocities."""
    total = n + massless

    def field(t, y, par, m):
        x = [[y[3 * i + c] for c in range(3)] for i in range(total)]
        v = [[y[3 * (total + i) + c] for c in range(3)] for i in range(total)]
        pulled: list[list[Any]] = [[0.0] * 3 for _ in range(total)]

        def pull(i: int, j: int, toward: list[Any]) -> None:
            """Add a pull of body i on body j, for a mass of 1, and what pulls back."""
            for c in range(3):
                pulled[j][c] = pulled[j][c] + par.G * par.m[i] * toward[c]
                if j < n:
                    pulled[i][c] = pulled[i][c] - par.G * par.m[j] * toward[c]

        for j in range(total):
            for i in range(min(j, n)):
                d = [x[j][c] - x[i][c] for c in range(3)]
                square = _dot(d, d) if softening is None else _dot(d, d) + softening**2
                cubed = square * m.sqrt(square)
                pull(i, j, [-d[c] / cubed for c in range(3)])
        newton = [list(row) for row in pulled[:n]]
        for force in flattened:
            for j in range(total):
                if j != force.body:
                    pull(force.body, j, force.pull([x[j][c] - x[force.body][c] for c in range(3)], m))
        for force in relativity:
            added = force.pull(x, v, [par.G * par.m[i] for i in range(n)], newton, m)
            pulled = [[a + b for a, b in zip(*rows, strict=True)] for rows in zip(pulled, added, strict=True)]
        given = {"t": t, "x": x, "v": v, "masses": [par.m[i] for i in range(n)] + [0.0] * massless, "m": m}
        for force in fields:
            for j, more in enumerate(_called(force, given, total)):
                pulled[j] = [pulled[j][c] + more[c] for c in range(3)]
        return [component for rows in (v, pulled) for row in rows for component in row]

    return field


def _called(force: Callable[..., Any], given: dict[str, Any], total: int) -> list[Any]:
    names = list(inspect.signature(force).parameters)
    if unknown := [name for name in names if name not in given]:
        raise InputError(f"a force has no argument {unknown[0]!r}; it may name t, x, v, masses and m.")
    components = force(*[given[name] for name in names])
    try:
        right = len(components) == total and all(len(row) == 3 for row in components)
    except TypeError:
        right = False
    if not right:
        raise InputError(f"a force must return three accelerations for each of the {total} bodies.")
    return list(components)


def _momenta(system: System, t: float, q: Array, v: Array, masses: Array) -> Array:
    """Return the momenta with which bodies have these velocities: p + m (v - dH/dp) until it stays."""
    field, weights = emit.numpy(system, "field"), np.repeat(masses, 3)
    wanted, par = v.reshape(-1), system.pack()
    p = weights * wanted
    for _ in range(SWEEPS):
        following = p + weights * (wanted - field(t, np.concatenate([q, p]), par)[: q.size])
        if np.array_equal(following, p):
            break
        p = following
    return p


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
        v = emit.numpy(system, "field")(problem.t0 if t is None else t, state, problem.par)[:half]
    return masses, state[:half].reshape(n, 3).copy(), v.reshape(n, 3).copy()


def masses_of(masses: ArrayLike) -> Array:
    """Return a copy of masses that are checked."""
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
    try:
        values = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.shape != (n, 3) or not np.isfinite(values).all():
        raise InputError(f"{label} must be finite numbers of shape ({n}, 3), not {shown(rows)}.")
    return values


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
