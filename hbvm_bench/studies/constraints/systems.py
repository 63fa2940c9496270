"""The systems of the study of constraints: point masses on rods, in Cartesian coordinates."""

import numpy as np

from problems import Constrained, Problem


def hanging(n: int, angle: float) -> Problem:
    """Return n unit masses on a straight chain of rods of length 1, at rest at an angle from the vertical."""

    def H(q, p, m):
        kinetic = m.sum(lambda i: p[i] ** 2 / 2, range(2 * n))
        return kinetic + m.sum(lambda i: q[2 * i + 1], range(n))

    def first(q):
        return (q[0] ** 2 + q[1] ** 2 - 1) / 2

    def links(q, m):
        def link(i):
            return ((q[2 * i] - q[2 * i - 2]) ** 2 + (q[2 * i + 1] - q[2 * i - 1]) ** 2 - 1) / 2

        return m.each(link, range(1, n))

    system = Constrained(H, constraints=[first, links], dof=2 * n, name=f"chain_{n}")
    place = np.arange(1, n + 1)[:, np.newaxis] * [np.sin(angle), -np.cos(angle)]
    return Problem(system, q0=place.ravel(), p0=np.zeros(2 * n), t_end=20.0, project=True)
