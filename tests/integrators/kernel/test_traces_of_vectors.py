"""What followed trajectories of a program before leaves no trace in the tangent vectors of the next."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, integrate

KEPLER = problems.load("kepler")
SPRING = problems.Hamiltonian(
    lambda q, p, par: p[0] ** 2 / (2 * par.mass) + p[1] ** 2 / 2 + par.k * (q[0] - q[1]) ** 4,
    dof=2,
    parameters={"k": 1.0, "mass": 1.0},
)
DRIVEN = problems.VectorField(
    lambda t, y, par, m: [par.fast * (m.cos(par.w * t) - y[0]), y[0] * y[1] - y[1] ** 3],
    dim=2,
    parameters={"fast": 1.0, "w": 1.3},
)
METHODS = [HBVM(), Gauss(s=8, tol=1e-9), Gauss(s=4, h=0.05), HBVM(k=8, s=4, h=0.05), HBVM(k=20, s=3, h=0.1)]


def alone(problem, method, **asked):
    """Return the solution by a program whose memory is fresh."""
    kept = vars(problem.system).pop("_programs", {})
    solution = integrate(problem, method, **asked)
    vars(problem.system)["_programs"] = kept
    return solution


def vectors(dim, count, seed):
    return np.random.default_rng(seed).standard_normal((dim, count))


def spring(start, end, **parameters):
    return problems.Problem(SPRING, q0=[start, -0.3], p0=[0.3, 0.1], parameters=parameters, t_end=end)


def driven(start, end, **parameters):
    return problems.Problem(DRIVEN, y0=[start, 0.7], parameters=parameters, t_end=end)


CASES = {
    "spring": [
        (spring(1.0, 2.0, k=0.5, mass=3.0), vectors(4, 1, 0)),
        (spring(0.6, 3.1, k=2.0, mass=0.7), vectors(4, 1, 1)),
        (spring(0.6, -1.3, k=2.0, mass=0.7), vectors(4, 3, 2)),
        (spring(0.8, 2.2, k=2.0, mass=0.9), ["y0", "k", "mass"]),
        (spring(0.7, 2.1, k=2.0, mass=0.9), ["k", "t0", "mass"]),
        (spring(0.8, 2.0, k=2.0, mass=3.0), vectors(4, 10, 3)),  # two groups
        (spring(1.1, 2.0, k=2.0, mass=3.0), ["mass", "y0", "k"]),
        (spring(0.8, 2.2, k=2.0, mass=0.9), ["y0", "k", "mass"]),
    ],
    "driven": [
        (driven(0.3, 2.0, fast=1.0, w=1.0), "y0"),
        (driven(0.5, 1.0, fast=1e5, w=1.0), "y0"),  # by an implicit solver
        (driven(0.4, -0.5, fast=1.0, w=2.0), "y0"),
        (driven(0.4, 1.0, fast=2.0, w=2.0), ["w", "t0"]),
        (driven(0.5, 1.5, fast=2.0, w=1.5), ["t0", "fast"]),
    ],
}


@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("sample", ["steps", "stop", "partial"])
def test_what_followed_before_leaves_no_trace(method, name, sample):
    cases = CASES[name]
    expected = [
        alone(
            problem, method, times=[0.0, 0.6 * problem.t_end, problem.t_end], sample=sample, variations=wanted
        )
        for problem, wanted in cases
    ]
    rng = np.random.default_rng(7)
    for i in (*range(len(cases)), *rng.integers(len(cases), size=10).tolist()):
        problem, wanted = cases[i]
        times = [0.0, 0.6 * problem.t_end, problem.t_end]
        found = integrate(problem, method, times, sample=sample, variations=wanted)
        assert found.status == expected[i].status, i
        assert np.array_equal(found.y, expected[i].y), i
        assert np.array_equal(found.variations, expected[i].variations), i
        assert found.stats.extra["variations"] == expected[i].stats.extra["variations"], i


def test_vectors_do_not_follow_the_next_trajectory():
    made = HBVM().compile(KEPLER.system)
    first = made.start(KEPLER.y0, KEPLER.par)
    first.follow(np.eye(4)[:, :2], np.zeros((0, 2)))
    first.advance([1.0])
    del first
    second = made.start(KEPLER.y0, KEPLER.par)
    second.advance([1.0])
    assert second.variations is None
    assert "variations" not in second.stats.extra


@pytest.mark.parametrize("method", [HBVM(), Gauss(s=4, h=0.05)], ids=repr)
def test_other_vectors_of_the_same_trajectory(method):
    made = method.compile(KEPLER.system)
    ends = []
    for before in ([], [1], [3, 1]):
        stepper = made.start(KEPLER.y0, KEPLER.par)
        for count in before:
            stepper.follow(np.eye(4)[:, :count], np.zeros((0, count)))
            stepper.take(5)
        stepper.take(12 - 5 * len(before))
        stepper.follow(np.eye(4)[:, :1], np.zeros((0, 1)))
        stepper.take(7)
        ends.append(stepper.variations)
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[0], ends[2])
