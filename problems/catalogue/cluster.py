"""A cluster of N equal bodies with softened gravity, for any N."""

import math
from random import Random
from typing import Annotated

from problems import limits
from problems.bodies import gravity
from problems.checks import Positive, at_least
from problems.entry import Expected, entry
from problems.picture import Orbits
from problems.problem import Problem


@entry(
    title="a softened cluster",
    references=("H. C. Plummer, Monthly Notices of the Royal Astronomical Society 71 (1911) 460-470",),
    notes="All pairs interact: the cost grows with the square of n. Chaotic.",
    shows=("n",),
    picture=Orbits(dimension=3, span=5.0),
    expected=Expected(h=0.05, energy=1e-15, default=3e-16, small={"n": 5}),
)
def cluster(
    *,
    n: Annotated[int, at_least(2)] = 10,
    softening: Positive = 0.1,
    seed: Annotated[int, at_least(0)] = 1,
    t_end: float = 10.0,
) -> Problem:
    """Return a cluster of bodies of mass 1/n that starts in the unit ball; G = 1.

    Tests the cost per pair of bodies. The potential of a pair is
    -m^2/sqrt(r^2 + softening^2), as in H. C. Plummer, Monthly Notices of the Royal
    Astronomical Society 71 (1911) 460-470. From some ten bodies on the compiled
    force is a loop over pairs.

    Parameters
    ----------
    n : int
        Number of bodies, at least 2.
    softening : float
        Length below which the force stops growing, positive.
    seed : int
        Of Python's Mersenne twister, which places the bodies evenly in the ball
        (points of the cube are drawn until they lie in it), with velocities drawn
        likewise and multiplied by 1/2; then the centre of mass is moved to rest at the origin.
    t_end : float
        End of the integration; crossing the ball takes about 2.

    Returns
    -------
    Problem
        State: positions body by body, then momenta. Parameters ``m``, ``eps``;
        invariants: energy, angular momentum (the linear momentum is 0 but for rounding).
    """
    limits.check_problem("cluster", 6 * n, n * (n - 1) // 2, n=n)
    random = Random(seed)
    return Problem(
        gravity.hamiltonian([1.0 / n] * n, name=f"cluster_{n}", softening=softening, linear_momentum=False),
        q0=_centred([_in_ball(random) for _ in range(n)]),
        p0=[x * (0.5 / n) for x in _centred([_in_ball(random) for _ in range(n)])],
        t_end=t_end,
    )


def _in_ball(random: Random) -> list[float]:
    while True:
        point = [2.0 * random.random() - 1.0 for _ in range(3)]
        if point[0] * point[0] + point[1] * point[1] + point[2] * point[2] <= 1.0:
            return point


def _centred(rows: list[list[float]]) -> list[float]:
    centre = [math.fsum(row[c] for row in rows) / len(rows) for c in range(3)]
    return [x - c for row in rows for x, c in zip(row, centre, strict=True)]
