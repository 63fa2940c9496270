"""Gravitational N-body problems, with additional forces."""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems import limits
from problems.bodies import gravity
from problems.bodies.forces import Force, Harmonics, Motion, PostNewtonian
from problems.bodies.orbits import BARYCENTRIC, JACOBI, Orbit, primary_index
from problems.bodies.states import masses_of, momenta_of, rows_of, weights_of
from problems.bodies.units import Units
from problems.checks import Positive, at_least, checked_arguments
from problems.errors import InputError, shown
from problems.problem import Problem
from problems.systems.base import System
from problems.systems.vector_field import VectorField

Array = NDArray[np.float64]
PER_PAIR = 32  # operations of Newton's attraction between two bodies, at most


@checked_arguments
def nbody(
    masses: ArrayLike,
    positions: ArrayLike | None = None,
    velocities: ArrayLike | None = None,
    *,
    orbits: Sequence[Any] | None = None,
    massless: Annotated[int, at_least(0)] = 0,
    forces: Sequence[Any] = (),
    G: float | None = None,
    unit: str | None = None,
    softening: Positive | None = None,
    names: Sequence[str] = (),
    t0: float = 0.0,
    t_end: float,
    name: str | None = None,
) -> Problem:
    """Return a gravitational N-body problem from masses, and positions and velocities or orbital elements.

    Parameters
    ----------
    masses : array_like, shape (n,)
        Positive, and none below 1e-10 of the largest (use ``massless`` for such bodies). They are the
        parameter ``m``; the gravitational constant is the parameter ``G``.
    positions, velocities : array_like, shape (n + massless, 3)
        Those of the bodies with mass, then those of the massless ones.
    orbits : sequence of Orbit, optional
        In place of positions and velocities: the orbits of all bodies but the first. The centre of mass then
        rests at the origin.
    massless : int
        Number of massless bodies (test particles), the last ones. The sums over pairs are then unrolled: 5
        bodies with mass and 23 without compile in 14 s. For many see `starts`.
    forces : sequence
        Additional forces: those of `problems.bodies`, such as `J2` and `PostNewtonian`, or a function that
        returns accelerations, three for each body; its arguments are among ``t, x, v, masses, m``, where x
        and v are lists of three numbers for each body. It is traced, as a Hamiltonian is.
    G : float, optional
        The gravitational constant, in the units of masses, lengths and times; by default 1.
    unit : str, optional
        Names of these units in place of G, such as ``"au, yr, Msun"``; see `problems.bodies.Units`. Forces
        then have the velocity of light.
    softening : float, optional
        Softening length eps: distances are sqrt(r^2 + eps^2).
    names : sequence of str, optional
        Names of the bodies, for `Orbit`, `starts` and ``solution.elements``.
    t0, t_end : float
        The integration interval.
    name : str, optional
        Name of the system.

    Returns
    -------
    Problem
        Where all bodies have masses and all forces an energy (`Zonal`, `J2`, and `PostNewtonian` of all
        bodies), a `Hamiltonian`, whose state is positions and momenta, body by body; then HBVM conserves the
        energy. Otherwise a `VectorField`, with velocities in place of momenta.

    Raises
    ------
    problems.errors.InputError
        For arrays of other shapes, masses that are not positive, two bodies at one place, forces on bodies
        that are not there, softening with `PostNewtonian` as a vector field, and more massless bodies than
        can be unrolled.

    Examples
    --------
    >>> from integrators import HBVM, integrate
    >>> from problems import nbody
    >>> from problems.bodies import J2, Orbit
    >>> x, v = [[0, 0, 0], [1.2, 0, 0]], [[0, 0, 0], [0, 0.8, 0.4]]
    >>> orbit = nbody([1.0, 1e-9], x, v, forces=[J2(J2=1.0826e-3, R=1.0)], t_end=20.0)
    >>> bool(integrate(orbit, HBVM()).errors()["energy"].max() < 1e-14)
    True
    >>> jupiter = Orbit(a=5.2044, e=0.0489, omega=4.78, M=0.35)
    >>> words = {"unit": "au, yr, Msun", "names": ["Sun", "Jupiter"]}
    >>> pair = nbody([1.0, 9.5e-4], orbits=[jupiter], **words, t_end=12.0)
    >>> round(float(integrate(pair, HBVM(), [12.0]).elements("Jupiter").e[0]), 4)
    0.0489
    """
    mass, n = masses_of(masses), np.size(masses)
    total = n + massless
    if names and (len(set(names)) != total or {JACOBI, BARYCENTRIC} & set(names)):
        raise InputError(
            f"names={shown(names)} must be {total} different names, none of them {JACOBI!r} or "
            f"{BARYCENTRIC!r}."
        )
    units = None if unit is None else Units(unit)
    if units is not None and G is not None:
        raise InputError(f"unit={unit!r} says what G is; leave out G={G!r}.")
    G = units.G if units is not None else 1.0 if G is None else G
    x, v = _placed(G * mass, massless, positions, velocities, orbits, tuple(names), t0)
    for a in range(total):
        same = np.flatnonzero((x[: min(a, n)] == x[a]).all(axis=1))
        if same.size and not softening:
            raise InputError(
                f"bodies {same[0]} and {a} are at one place; move one of them, or give softening=."
            )
    added = _checked(forces, n, total, units)
    called = name or f"bodies_{total}"
    if not massless and all(isinstance(force, Force) and force.has_energy for force in added):
        system: System = gravity.hamiltonian(
            mass.tolist(), name=called, G=G, softening=softening,
            angular_momentum=not any(isinstance(force, Harmonics) for force in added),
            more=[force.energy for force in added],
        )  # fmt: skip
        momenta = momenta_of(system, t0, x.reshape(-1), v, mass) if added else (mass[:, None] * v).reshape(-1)
        return Problem(system, q0=x.reshape(-1), p0=momenta, t0=t0, t_end=t_end, bodies=names)
    if softening is not None and any(isinstance(force, PostNewtonian) for force in added):
        raise InputError(
            f"softening={softening!r} has no relativistic form beside massless bodies or forces without an "
            "energy; leave out softening= or PostNewtonian."
        )
    written = PER_PAIR * n * ((n - 1) // 2 + massless)
    if massless and written > limits.limit("OPERATIONS"):
        raise InputError(
            f"{massless} massless bodies beside {n} with mass are about {written:,} operations written out. "
            "They do not act on each other: make the problem with massless=1, and integrate all of them with "
            "integrate_many(problem, starts=problems.bodies.starts(problem, -1, positions, velocities))."
        )
    system = VectorField(
        _accelerated(n, softening, added), dim=6 * total,
        parameters={"m": tuple(mass.tolist()), "G": G}, name=called,
    )  # fmt: skip
    y0 = np.concatenate([x.reshape(-1), v.reshape(-1)])
    return Problem(system, y0=y0, t0=t0, t_end=t_end, bodies=names)


def _checked(forces: Any, n: int, total: int, units: Units | None) -> list[Any]:
    """Return the forces, with the velocity of light of the units where they have none."""
    if not isinstance(forces, Sequence):
        raise InputError(f"forces={shown(forces)} must be a list of forces, such as [PostNewtonian(c=...)].")
    added = []
    for force in forces:
        if isinstance(force, Force):
            kind = type(force).__name__
            for body in force.sources():
                if body >= n:
                    raise InputError(f"body={body} of {kind} is none of the {n} bodies with masses.")
            for body in force.named():
                if body >= total:
                    raise InputError(f"body={body} of {kind} is none of the {total} bodies.")
            if units is not None and getattr(force, "c", units) is None:
                force = replace(force, c=units.c)  # type: ignore[call-arg]
        elif not callable(force):
            raise InputError(
                f"{shown(force)} is no force; give one of problems.bodies, such as J2, or a function."
            )
        added.append(force)
    return added


def _placed(
    mu: Array, massless: int, positions: Any, velocities: Any, orbits: Any, names: tuple[str, ...], t0: float
) -> tuple[Array, Array]:
    """Return positions and velocities of all bodies, as they are given or from their orbits."""
    total = mu.size + massless
    if orbits is None:
        if positions is None or velocities is None:
            raise InputError("nbody needs positions and velocities, or orbits=.")
        return rows_of("positions", positions, total), rows_of("velocities", velocities, total)
    if positions is not None or velocities is not None:
        raise InputError("orbits= say where the bodies are; leave out positions and velocities.")
    if not all(isinstance(orbit, Orbit) for orbit in orbits):
        raise InputError("orbits= must be a list of problems.bodies.Orbit, such as [Orbit(a=1.0, e=0.1)].")
    if len(orbits) != total - 1:
        raise InputError(f"orbits= are {len(orbits)}, and there are {total - 1} bodies besides the first.")
    mu = np.concatenate([mu, np.zeros(massless)])
    # each state is a share of that of the first body, which is known when all are, and a known rest
    shares, known = np.zeros((total, 1)), np.zeros((total, 6))
    shares[0] = 1.0
    for i, orbit in enumerate(orbits, start=1):
        about = primary_index(orbit.primary, names, total)
        if isinstance(about, int) and about >= i:
            raise InputError(f"the orbit of body {i} is about body {about}; give that one before it.")
        weights, size = weights_of(about, mu, i)
        state = orbit.state(size, t0)
        if state[0].shape != (3,):
            raise InputError(
                f"the orbit of body {i} has arrays; give numbers here, and many orbits to starts."
            )
        if about != BARYCENTRIC:  # the barycentre is at the origin
            shares[i], known[i] = weights @ shares, weights @ known
        known[i] += np.concatenate(state)
    states = known + shares * (-(mu @ known) / (mu @ shares))
    return states[:, :3].copy(), states[:, 3:].copy()


def _accelerated(n: int, softening: float | None, forces: list[Any]) -> Callable[..., list[Any]]:
    """Return the derivative of positions and velocities."""

    def field(t, y, par, m):
        total = len(y) // 6
        x = [[y[3 * i + c] for c in range(3)] for i in range(total)]
        v = [[y[3 * (total + i) + c] for c in range(3)] for i in range(total)]
        masses = [par.m[i] for i in range(n)]
        on = Motion(x, v, masses, par.G, m)
        on.attract(softening)
        given = {"t": t, "x": x, "v": v, "masses": masses + [0.0] * (total - n), "m": m}
        for force in forces:
            if isinstance(force, Force):
                force.act(on)
                continue
            for j, more in enumerate(_called(force, given, total)):
                on.push(j, list(more))
        return [component for rows in (v, on.a) for row in rows for component in row]

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
