"""The Morse oscillator, with its exact solution.

    H(q, p) = p^2/(2 m) + D (1 - exp(-a q))^2

Here q is the distance of the atoms less its value at rest, and m their reduced mass.
"""

from typing import Any

from problems.checks import Positive
from problems.entry import Expected, entry
from problems.errors import InputError
from problems.picture import Phase
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian


def _energy(q, p, par, m):
    w = 1 - m.exp(-par.a * q[0])
    return p[0] * p[0] / (2 * par.m) + par.D * (w * w)


@entry(
    title="the Morse oscillator",
    references=(
        "P. M. Morse, Diatomic molecules according to the wave mechanics. II. Vibrational levels, "
        "Physical Review 34 (1929) 57-64",
    ),
    notes="Separable, not polynomial; an exact solution for bound motion.",
    shows=("q", "p"),
    picture=Phase(span=8.0, points=600),
    expected=Expected(h=0.2, energy=1e-15, default=2e-15),
)
def morse(
    *,
    q: float = 0.0,
    p: float = 1.0,
    D: Positive = 1.0,
    a: Positive = 1.0,
    m: Positive = 1.0,
    t_end: float = 100.0,
) -> Problem:
    """Return the Morse oscillator.

    Tests an anharmonic well with a steep wall and a long flat side, against an
    exact solution (`exact_state`).

    Parameters
    ----------
    q, p : float
        Displacement and momentum at the start; bound while H < D.
    D, a, m : float
        Depth and inverse width of the well, mass.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[q, p]``; parameters ``D``, ``a``, ``m``; invariant: energy.
    """
    system = Hamiltonian(_energy, dof=1, parameters={"D": D, "a": a, "m": m}, name="morse")
    return Problem(system, q0=[q], p0=[p], t_end=t_end)


def exact_state(problem: Problem, t: Any) -> list[Any]:
    """Return the exact state of a bound Morse oscillator, as mpmath numbers at their present precision.

    With u = exp(a q) the motion is harmonic: u = A - B cos(w t + f), where
    A = D/(D - E), B = sqrt(E D)/(D - E), w = a sqrt(2 (D - E)/m); and p = m u'/(a u).

    Raises
    ------
    problems.errors.InputError
        If the motion is not bound.
    """
    import mpmath

    q, p = (mpmath.mpf(x) for x in problem.y0.tolist())
    depth, a, mass = (mpmath.mpf(x) for x in problem.par.tolist())
    u, w = mpmath.exp(a * q), 1 - mpmath.exp(-a * q)
    energy = p * p / (2 * mass) + depth * w * w
    if energy >= depth:
        raise InputError(f"{problem!r} is not bound; there is no exact solution here.")
    below = depth - energy
    frequency = a * mpmath.sqrt(2 * below / mass)
    middle = depth / below
    # u - A and u'/w at the start are two components of one rotating vector.
    x, y = u - middle, a * p * u / mass / frequency
    angle = frequency * (mpmath.mpf(t) - mpmath.mpf(problem.t0))
    c, s = mpmath.cos(angle), mpmath.sin(angle)
    now = middle + x * c + y * s
    return [mpmath.log(now) / a, mass * frequency * (y * c - x * s) / (a * now)]
