"""Condition numbers of references: what a rounded state on the way does to the positions at the end."""

import numpy as np
import pytest

import problems
from hbvm_bench.reference import solutions
from hbvm_bench.reference.condition import conditions
from integrators import HBVM, integrate

PART = 1e-9  # by which the state on the way is changed


@pytest.mark.parametrize(
    ("name", "more", "bodies"),
    [("kepler", {"e": 0.9, "t_end": 20.0}, 1), ("figure_eight", {"momentum": 0.8, "t_end": 8.0}, 3)],
)
def test_no_changed_state_moves_the_end_further_and_some_move_it_nearly_as_far(name, more, bodies):
    problem = problems.load(name, **more)
    method, n = HBVM(tol=1e-15), problem.system.dof
    way = integrate(problem, method, [problem.t_end], sample="steps")
    end = way.y[-1, :n].reshape(bodies, -1)
    (number,) = conditions(problem, way.t[-1:], way.y[-1:])
    program, moved = method.compile(problem.system), []
    draw = np.random.default_rng(5)
    for t, y in zip(way.t[:-1], way.y[:-1], strict=True):
        for signs in draw.choice([-1.0, 1.0], (4, y.size)):
            changed = y * (1.0 + PART * signs)
            other = program.start(changed, problem.par, t).advance(way.t[-1:]).y[0, :n].reshape(bodies, -1)
            moved.append(np.linalg.norm(other - end, axis=1).max())
    size = np.linalg.norm(end, axis=1).max()  # the condition is relative to the largest distance at its times
    largest = max(moved) / PART / size
    # measured: 0.95 (Kepler), 1.01 (figure eight, by the square of the change) of the condition number
    assert 0.5 * number < largest < 1.05 * number


def test_a_system_without_canonical_coordinates_has_none():
    problem = problems.load("rigid_body")
    assert conditions(problem, np.array([1.0]), problem.y0[None]) is None


def test_the_condition_of_an_ellipse_grows_as_it_becomes_narrow():
    found = [
        solutions.find(problems.load("kepler", e=e, t_end=65.0)).condition_at(65.0)
        for e in (0.99, 0.999, 0.9999)
    ]
    assert np.allclose(np.diff(np.log10(found)), 1.0, atol=0.1)  # measured 0.98, 1.00: as 1/(1 - e)


def test_a_reference_with_conditions_survives_its_file(tmp_path):
    stored = solutions.find_file(problems.load("scattering"))
    path = tmp_path / "x.json"
    path.write_text(solutions.encode(stored))
    assert solutions.read(path) == stored
    assert stored.reference.condition_at(60.0) > 1e6
    assert stored.reference.condition_at(1e9) is None
