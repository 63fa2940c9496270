"""Fields whose derivatives jump somewhere in the state: overlaps squared, cubed, tables of the position."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from integrators import HBVM, Gauss, integrate, integrate_many
from problems import Problem, VectorField

METHODS = [HBVM(), HBVM(tol=1e-12), HBVM(k=8, s=7, tol=1e-12), Gauss(s=6, tol=1e-12)]
END, STIFFNESS = 10.0, 3.0
PLACES = np.array([-4.0, -2.2, -1.5, -0.8, 0.1, 0.6, 1.7, 2.5, 4.0])
FORCES = PLACES + 0.2 * np.sin(7.0 * PLACES)
SPLINE = CubicSpline(PLACES, FORCES)


def overlap(power):
    """Return a field, where its derivative jumps, and the force on q in the i-th interval of those."""

    def field(y, par, m):
        return [y[1], -y[0] - STIFFNESS * m.where(y[0] > par.gap, (y[0] - par.gap) ** power, 0)]

    return (
        VectorField(field, dim=2, parameters={"gap": 0.3}, name=f"overlap {power}"),
        [0.3],
        lambda i, q: -q - STIFFNESS * i * (q - 0.3) ** power,
    )


def spline(i, q):
    """Return the force of the spline's pieces; beyond the knots next to the ends it has no discontinuity."""
    j = min(i + 1, PLACES.size - 3)
    return -np.polyval(SPLINE.c[:, j], q - PLACES[j])


SYSTEMS = {
    "squared": overlap(2),
    "cubed": overlap(3),
    "table": (
        VectorField(lambda y, m: [y[1], -m.table(y[0], PLACES, FORCES)], dim=2, name="table"),
        PLACES[2:-2],
        spline,
    ),
}
STARTS = np.column_stack([np.linspace(0.5, 1.4, 10), np.linspace(-0.5, 0.5, 10)])


class Place:
    """Where a piece of the trajectory ends, for SciPy."""

    terminal = True

    def __init__(self, place, direction):
        self.place, self.direction = place, direction

    def __call__(self, t, y):
        return y[0] - self.place


def expected(name, start):
    """Return the state at the end, by a smooth field from one discontinuity to the next."""
    _, discontinuities, force = SYSTEMS[name]
    t, y, i = 0.0, start, int(np.searchsorted(discontinuities, start[0]))
    while True:
        ends = [
            Place(discontinuities[place], direction)
            for place, direction in ((i - 1, -1.0), (i, 1.0))
            if 0 <= place < len(discontinuities)
        ]
        piece = solve_ivp(
            lambda t, y, i=i: [y[1], force(i, y[0])], (t, END), y,
            method="DOP853", rtol=3e-14, atol=1e-16, max_step=0.05, events=ends,
        )  # fmt: skip
        t, y = piece.t[-1], piece.y[:, -1]
        if piece.status == 0:
            return y
        i += 1 if y[1] > 0.0 else -1


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_weak_kink_costs_no_accuracy(method, name):
    # Before: 7e-10 to 1.0e-6, half of them without a warning; now 3e-12 at most.
    ends = np.array([expected(name, start) for start in STARTS])
    problem = Problem(SYSTEMS[name][0], y0=STARTS[0], t_end=END)
    alone = [integrate(Problem(problem.system, y0=start, t_end=END), method, [END]) for start in STARTS]
    assert np.abs([made.y[-1] for made in alone] - ends).max() < 1e-10
    assert all("discontinuous" in made.warnings[0] for made in alone)
    many = integrate_many(problem, method, starts=STARTS, times=[END])
    assert np.abs(many.y[:, 0] - ends).max() < 1e-10
    assert all("discontinuous" in said[0] for said in many.warnings)


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_kink_that_is_not_reached_is_not_said(name):
    system, places, _ = SYSTEMS[name]
    low, high = (-1.0, 0.3) if name != "table" else (0.1, 0.6)
    start = (low + high) / 2.0
    assert all(not low < place < high for place in places)
    made = integrate(Problem(system, y0=[start, 0.0], t_end=0.3), HBVM(k=8, s=7, tol=1e-12), [0.3])
    assert made.warnings == ()
    assert "kinks" not in made.stats.extra
