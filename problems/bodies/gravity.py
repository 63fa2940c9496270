"""N bodies that attract each other by Newton's law, in the plane or in space.

    H(q, p) = sum_i |p_i|^2/(2 m_i) - G sum_{i<j} m_i m_j / sqrt(|q_i - q_j|^2 + eps^2)

The sums are declared (`m.sum`), so that few bodies are written out pair by pair
and many are a loop. The squares of a distance are added in the same order for
every pair: symmetric configurations stay symmetric bit for bit.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import Any

from problems.systems.hamiltonian import Bodies, Hamiltonian


def hamiltonian(
    masses: Sequence[float],
    *,
    name: str,
    G: float | None = None,
    dimension: int = 3,
    softening: float | None = None,
    linear_momentum: bool = True,
    angular_momentum: bool = True,
    guards: Mapping[str, Callable[..., Any]] | None = None,
    more: Sequence[Callable[..., Any]] = (),
) -> Hamiltonian:
    """Return the system of N gravitating bodies.

    Parameters
    ----------
    masses : sequence of float
        Default values of the parameter ``m``.
    name : str
        The system's name.
    G : float, optional
        Default value of the parameter ``G``; without it the constant is 1 and
        there is no such parameter.
    dimension : {2, 3}
        Coordinates per body.
    softening : float, optional
        Default value of the parameter ``eps``; without it the force is Newton's own.
    linear_momentum : bool
        Whether to list the linear momentum among the invariants. Leave it out
        where it starts from the rounding errors of a zero: a relative error
        would mean nothing.
    angular_momentum : bool
        The same for the angular momentum.
    guards : mapping of str to callable, optional
        As for `Hamiltonian`.
    more : sequence of callable
        Further terms of the energy, each a function of q, p, the masses, the constant of gravitation and m.

    Returns
    -------
    Hamiltonian
        State: all positions body by body, then all momenta. Invariants: energy,
        linear momentum, angular momentum (one number in the plane).
    """
    n = len(masses)
    pairs = list(combinations(range(n), 2))
    axes = range(dimension)

    def energy(q, p, par, m):
        def kinetic(i):
            return _squares([p[dimension * i + c] for c in axes]) / (2 * par.m[i])

        def attraction(i, j):
            squared = _squares([q[dimension * i + c] - q[dimension * j + c] for c in axes])
            if softening is not None:
                squared = squared + par.eps * par.eps
            return par.m[i] * par.m[j] / m.sqrt(squared)

        potential = m.sum(attraction, pairs)
        total = m.sum(kinetic, range(n)) - (potential if G is None else par.G * potential)
        for term in more:
            total = total + term(q, p, par.m, 1.0 if G is None else par.G, m)
        return total

    def momentum(p, m):
        return [m.sum(lambda i, c=c: p[dimension * i + c], range(n)) for c in axes]

    def rotation(q, p, m):
        def total(a: int, b: int) -> Any:
            return m.sum(
                lambda i: (
                    q[dimension * i + a] * p[dimension * i + b] - q[dimension * i + b] * p[dimension * i + a]
                ),
                range(n),
            )

        return total(0, 1) if dimension == 2 else [total(1, 2), total(2, 0), total(0, 1)]

    parameters: dict[str, float | Sequence[float]] = {"m": tuple(masses)}
    if G is not None:
        parameters["G"] = G
    if softening is not None:
        parameters["eps"] = softening
    return Hamiltonian(
        energy,
        dof=dimension * n,
        parameters=parameters,
        invariants={
            **({"linear_momentum": momentum} if linear_momentum else {}),
            **({"angular_momentum": rotation} if angular_momentum else {}),
        },
        guards=guards or {},
        # REBOUND's softening is the same formula, but only bodies without it are handed over.
        bodies=None
        if softening or more
        else Bodies(masses="m", G=1.0 if G is None else "G", dimension=dimension),
        name=name,
    )


def _squares(values: Sequence[Any]) -> Any:
    total = values[0] * values[0]
    for value in values[1:]:
        total = total + value * value
    return total
