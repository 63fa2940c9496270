"""Random linkages: point masses joined by rods, in the plane and in space, open and closed."""

from typing import Any

import numpy as np

from problems import Constrained, Problem


def linkage(number: int, t_end: float = 5.0) -> Problem:
    """Return linkage ``number``: 1 to 4 masses over six decades, each hung on a pivot or on a mass before it.

    Where rods are left over without losing all freedom, some loops are closed. It starts at rest or from
    velocities that the rods allow, with gravity and a weak spring.
    """
    random = np.random.default_rng(number)
    space, n = int(random.integers(2, 4)), int(random.integers(1, 5))
    masses = 10.0 ** random.uniform(-3.0, 3.0, n)
    places = [random.uniform(-1.0, 1.0, space)]
    rods: list[tuple[int, Any]] = [(0, random.uniform(-1.0, 1.0, space))]
    for i in range(1, n):
        places.append(places[-1] + random.uniform(0.3, 1.0) * _unit(random, space))
        rods.append((i, int(random.integers(0, i))))
    spare = space * n - len(rods) - 1
    for _ in range(int(random.integers(0, 3))):
        i = int(random.integers(0, n))
        if spare > 0:  # a further rod closes a loop over a pivot
            rods.append((i, places[i] + random.uniform(0.4, 1.2) * _unit(random, space)))
            spare -= 1
    stiffness = float(random.uniform(0.0, 2.0))

    def H(q, p):
        kinetic = sum(p[i] ** 2 / (2.0 * masses[i // space]) for i in range(space * n))
        height = sum(masses[i] * q[space * i + space - 1] for i in range(n))
        return kinetic + height + stiffness * masses[0] * q[0] ** 2 / 2.0

    def rod(i, other):
        def length(q):
            ends = [q[space * other + c] if isinstance(other, int) else float(other[c]) for c in range(space)]
            there = places[other] if isinstance(other, int) else other
            squared = float(np.sum((places[i] - there) ** 2))
            return sum((q[space * i + c] - ends[c]) ** 2 for c in range(space)) - squared

        return length

    system = Constrained(H, constraints=[rod(*ends) for ends in rods], dof=space * n)
    momenta = np.repeat(masses, space) * random.uniform(-0.5, 0.5, space * n) * random.integers(0, 2)
    return Problem(system, q0=np.concatenate(places), p0=momenta, t_end=t_end, project=True)


def _unit(random: np.random.Generator, space: int) -> np.ndarray:
    direction = random.standard_normal(space)
    return direction / np.linalg.norm(direction)
