"""Kepler's problem: one body around a fixed centre, with its exact solution.

    H(q, p) = |p|^2/2 - 1/|q|

Superintegrable: energy, angular momentum and the Laplace-Runge-Lenz vector are all
kept, so every orbit closes.
"""

from decimal import Decimal, localcontext
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems.checks import Must
from problems.entry import Expected, entry
from problems.errors import InputError
from problems.picture import Plane
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian

HUNDRED_REVOLUTIONS = 628.3185307179587  # 200 pi


def _energy(q, p, m):
    return (p[0] ** 2 + p[1] ** 2) / 2 - 1 / m.sqrt(q[0] ** 2 + q[1] ** 2)


def _lenz(q, p, m):
    turn = q[0] * p[1] - q[1] * p[0]
    r = m.sqrt(q[0] ** 2 + q[1] ** 2)
    return [p[1] * turn - q[0] / r, -p[0] * turn - q[1] / r]


@entry(
    title="Kepler's problem",
    references=(
        "E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd edition, "
        "Springer 2006, section I.2",
    ),
    notes="Exact solution known; with all five invariants kept only the phase can be wrong.",
    shows=("e",),
    picture=Plane(span=6.5, points=600),
    expected=Expected(h=0.1, energy=2e-15, default=7e-15),
)
def kepler(
    *,
    e: Annotated[float, Must("an eccentricity, 0 <= e < 1", lambda e: 0 <= e < 1)] = 0.6,
    t_end: float = HUNDRED_REVOLUTIONS,
) -> Problem:
    """Return Kepler's problem from the pericentre of an ellipse with semi-major axis 1 and period 2 pi.

    Tests the passage through pericentres, and phase error against an exact
    solution (`solution`).

    Parameters
    ----------
    e : float
        Eccentricity, 0 <= e < 1.
    t_end : float
        End of the integration; 100 revolutions by default.

    Returns
    -------
    Problem
        State ``[q1, q2, p1, p2]``, from ``(1 - e, 0, 0, sqrt((1 + e)/(1 - e)))``;
        invariants: energy, angular momentum, the Laplace-Runge-Lenz vector.
    """
    with localcontext(prec=60):
        fast = float(((1 + Decimal(e)) / (1 - Decimal(e))).sqrt())
        near = float(1 - Decimal(e))
    system = Hamiltonian(
        _energy,
        dof=2,
        invariants={"angular_momentum": lambda q, p: q[0] * p[1] - q[1] * p[0], "lenz": _lenz},
        name="kepler",
    )
    return Problem(system, q0=[near, 0.0], p0=[0.0, fast], t_end=t_end)


def solution(problem: Problem, t: ArrayLike, *, digits: int = 40) -> NDArray[np.float64]:
    """Return the exact solution of a Kepler problem at given times, as the nearest doubles.

    The orbit through the problem's own initial doubles, whatever ellipse that
    is, by Kepler's equation solved in mpmath.

    Parameters
    ----------
    problem : Problem
        From `kepler`, or any start of that system with negative energy.
    t : array_like, shape (n,)
        Times.
    digits : int
        Decimal digits of the computation.

    Returns
    -------
    ndarray, shape (n, 4)

    Raises
    ------
    problems.errors.InputError
        If the orbit is not an ellipse.
    """
    import mpmath

    with mpmath.workdps(digits):
        rows = [[float(x) for x in exact_state(problem, mpmath.mpf(time))] for time in np.ravel(t).tolist()]
    return np.array(rows)


def exact_state(problem: Problem, t: Any) -> list[Any]:
    """Return the exact state at one time as mpmath numbers, at mpmath's present precision.

    With the eccentric anomaly's increment D since the start, Kepler's equation
    reads ``n t = D + (sigma/sqrt a)(1 - cos D) - (1 - r0/a) sin D``, sigma = q0.p0;
    Lagrange's f and g then give the state. Nothing is singular for circles.
    """
    import mpmath

    x, y, u, v = (mpmath.mpf(value) for value in problem.y0.tolist())
    r0, sigma = mpmath.sqrt(x * x + y * y), x * u + y * v
    a = 1 / (2 / r0 - (u * u + v * v))
    if a <= 0:
        raise InputError(f"the orbit of {problem!r} is not an ellipse; there is no exact solution here.")
    root = mpmath.sqrt(a)
    phase = (t - mpmath.mpf(problem.t0)) / (a * root)
    turns = mpmath.nint(phase / (2 * mpmath.pi))
    phase = phase - 2 * mpmath.pi * turns

    def kepler_equation(d: Any) -> Any:
        return d + sigma / root * (1 - mpmath.cos(d)) - (1 - r0 / a) * mpmath.sin(d) - phase

    low, high = phase - 2, phase + 2  # the equation is monotonic, and |D - n t| <= 2
    d = mpmath.findroot(kepler_equation, (low, high), solver="anderson")
    c, s = mpmath.cos(d), mpmath.sin(d)
    r = a + (r0 - a) * c + sigma * root * s
    f = 1 - a / r0 * (1 - c)
    g = a * sigma * (1 - c) + r0 * root * s
    df = -root / (r * r0) * s
    dg = 1 - a / r * (1 - c)
    return [f * x + g * u, f * y + g * v, df * x + dg * u, df * y + dg * v]
