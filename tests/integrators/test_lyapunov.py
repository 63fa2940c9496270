"""Exponents of systems where they are known, and what must hold of all."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss
from integrators.dynamics import lyapunov
from problems import InputError, Problem, VectorField


def lorenz(y, par):
    return [par.s * (y[1] - y[0]), y[0] * (par.r - y[2]) - y[1], y[0] * y[1] - par.b * y[2]]


def test_lorenz():
    system = VectorField(lorenz, dim=3, parameters={"s": 10.0, "r": 28.0, "b": 8.0 / 3.0})
    problem = Problem(system, y0=[1.0, 1.0, 20.0], t_end=1000.0)
    found = lyapunov(problem, Gauss(s=6, h=0.02), skip=20.0)
    # 0.90563: the known value for these parameters
    assert found.intervals[0, 0] < 0.90563 < found.intervals[0, 1]
    assert found.intervals[0, 1] - found.intervals[0, 0] < 0.05
    assert found.intervals[1, 0] < 0.0 < found.intervals[1, 1]
    assert abs(found.sum + 41.0 / 3.0) < 1e-10


def test_exponents_of_gauss_come_in_pairs_on_a_hamiltonian():
    found = lyapunov(problems.load("henon_heiles"), Gauss(s=8, h=0.5), t_end=1000.0)
    assert found.pairs is not None
    assert found.pairs < 1e-10
    assert abs(found.sum) < 1e-10


def test_a_linear_field_has_its_eigenvalues():
    system = VectorField(lambda y: [0.3 * y[0], -0.2 * y[1] + y[0]], dim=2)
    found = lyapunov(Problem(system, y0=[1e-3, 1.0], t_end=50.0), HBVM(k=6, s=6, h=0.1), count=1, skip=25.0)
    assert abs(found.exponents[0] - 0.3) < 1e-5  # the second has died out by exp(-0.5 * 25)


@pytest.mark.slow
def test_intervals_cover_the_known_exponent_of_lorenz_as_often_as_they_say():
    system = VectorField(lorenz, dim=3, parameters={"s": 10.0, "r": 28.0, "b": 8.0 / 3.0})
    starts = np.random.default_rng(1).uniform((-10.0, -10.0, 15.0), (10.0, 10.0, 35.0), (100, 3))
    found = [
        lyapunov(Problem(system, y0=y0, t_end=220.0), Gauss(s=5, h=0.025), count=1, skip=20.0).intervals[0]
        for y0 in starts
    ]
    covered = sum(low < 0.90563 < high for low, high in found)
    assert 88 <= covered <= 99  # 95 with a standard deviation of 2.2; measured: 98
    halves, scatter = np.diff(found, axis=1) / 2, np.std(np.mean(found, axis=1), ddof=1)
    # 2.31/1.96 = 1.18 is the price of 8 degrees of freedom; measured: 1.36
    assert np.median(halves) < 1.45 * 1.96 * scatter


@pytest.mark.slow
def test_intervals_of_another_mixing_system_cover_the_mean_of_all():
    """Lorenz's model of the atmosphere with eight sites, forced so that it is chaotic."""

    def ring(y, par):
        return [(y[(i + 1) % 8] - y[i - 2]) * y[i - 1] - y[i] + par.F for i in range(8)]

    system = VectorField(ring, dim=8, parameters={"F": 10.0})
    starts = 10.0 + np.random.default_rng(2).standard_normal((100, 8))
    found = [
        lyapunov(Problem(system, y0=y0, t_end=130.0), Gauss(s=5, h=0.04), count=1, skip=20.0) for y0 in starts
    ]
    mean = np.mean([each.exponents[0] for each in found])  # a tenth as uncertain as one of them
    covered = sum(each.intervals[0, 0] < mean < each.intervals[0, 1] for each in found)
    assert 2.0 < mean < 2.3  # measured: 2.148
    assert 88 <= covered <= 100  # 95 with a standard deviation of 2.2; measured: 98


def test_too_many_exponents_are_refused():
    with pytest.raises(InputError, match="count=5"):
        lyapunov(problems.load("pendulum"), Gauss(s=4, h=0.1), count=5)
