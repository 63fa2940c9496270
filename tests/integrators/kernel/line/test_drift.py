"""Energy, length and velocity of a pendulum in Cartesian coordinates do not drift where the terms vanish.

At its turning points the pendulum is at rest and, from the horizontal, all terms of the energy are 0.
"""

import numpy as np
import pytest

import integrators
import problems
from integrators import LineIntegral

SYSTEM = problems.VectorField(
    lambda y: [
        y[2],
        y[3],
        -y[0] * (y[2] ** 2 + y[3] ** 2 - y[1]) / (y[0] ** 2 + y[1] ** 2),
        -1.0 - y[1] * (y[2] ** 2 + y[3] ** 2 - y[1]) / (y[0] ** 2 + y[1] ** 2),
    ],
    dim=4,
    invariants={
        "energy": lambda y: (y[2] ** 2 + y[3] ** 2) / 2 + y[1],
        "length": lambda y: (y[0] ** 2 + y[1] ** 2) / 2,
        "speed": lambda y: y[0] * y[2] + y[1] * y[3],
    },
)
ANGLES = (0.0, -1.5, 1.2, 2.0)  # from the horizontal


def largest_changes(h, steps, angle, k=24, s=8):
    start = [np.cos(angle), np.sin(angle), 0.0, 0.0]
    problem = problems.Problem(SYSTEM, y0=start, t_end=h * steps)
    times = h * np.unique(np.round(np.geomspace(10, steps, 30)))
    method = LineIntegral(k=k, s=s, h=h, invariants=list(SYSTEM.invariants))
    solution = integrators.integrate(problem, method, times)
    now, first = (problem.invariants(y) for y in (solution.y, problem.y0))
    return solution, {name: float(np.abs(now[name] - first[name]).max()) for name in now}


@pytest.mark.parametrize("h", [0.09, 0.1, 0.11])
@pytest.mark.parametrize("steps", [pytest.param(30_000), pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_nothing_drifts_from_rest(h, steps):
    for angle in ANGLES if steps > 1e5 else ANGLES[:2]:
        solution, changes = largest_changes(h, steps, angle)
        assert solution.stats.extra["lost"] == {}
        assert solution.warnings == ()
        assert max(changes.values()) <= 1e-15  # measured 3.3e-16, and at 1e6 steps 4.4e-16


def test_what_is_lost_is_told_with_its_size():
    solution, changes = largest_changes(0.2, 1000, 0.0, k=6, s=4)
    assert changes["energy"] > 1e-12  # measured 2.4e-10, as the energy is none off the manifold
    first, change, size = solution.stats.extra["lost"]["energy"]
    assert first >= 0.0
    assert change >= 0.9 * changes["energy"]  # losses of both signs are added up
    assert any(
        text.startswith(f"energy has lost {change / size:.1e} of") and "raise k" in text
        for text in solution.warnings
    )


def test_losses_are_kept_by_a_file_and_a_checkpoint(tmp_path):
    solution, _ = largest_changes(0.2, 100, 0.0, k=6, s=4)
    solution.save(tmp_path / "run.npz")
    again = integrators.load(tmp_path / "run.npz")
    assert again.stats.extra["lost"] == solution.stats.extra["lost"] != {}
    assert again.warnings == solution.warnings
