"""heyoka's batch integrator behind the same seam as the kernel's batch."""

import numpy as np
import pytest

import problems
from integrators import Taylor
from integrators.protocol import Status
from problems import Hamiltonian, Problem
from problems.errors import InputError

pytest.importorskip("heyoka")
rng = np.random.default_rng(11)


def test_a_batch_is_its_trajectories_one_by_one():
    problem = problems.load("henon_heiles", energy=0.1)
    program = Taylor(tol=1e-15).compile(problem.system)
    starts = problem.y0 * (1 + 0.05 * rng.normal(size=(11, 4)))  # more than one group, and a part of one
    times = np.array([0.0, 3.0, 20.0])
    batch = program.batch(starts, times=times)
    singles = np.array([program.start(y).advance(times).y for y in starts])
    assert batch.status == [Status.FINISHED] * 11
    assert np.array_equal(batch.y[:, 0], starts)
    # 6.6e-16 measured: the steps differ by the landing on t = 3
    assert np.abs(batch.y - singles).max() < 1e-13
    assert (batch.steps > 20).all()


def test_each_trajectory_has_its_own_parameters():
    problem = problems.load("outer_solar_system")
    program = Taylor(tol=1e-15, compact_mode=True).compile(problem.system)
    parameters = np.tile(problem.par, (3, 1))
    parameters[:, 1] *= [1.0, 1.5, 0.5]  # Jupiter's mass
    starts = np.tile(problem.y0, (3, 1))
    ends = program.batch(starts, parameters, times=[10.0]).y[:, 0]
    for end, par in zip(ends, parameters, strict=True):
        single = program.start(problem.y0, par).advance(np.array([10.0])).y[0]
        assert np.abs(end - single).max() < 1e-11  # 4.5e-14 measured
    assert np.abs(ends[1] - ends[0]).max() > 1e-3


def test_one_failure_leaves_the_others_alone():
    def H(q, p, m):
        return p[0] * p[0] / 2 - q[0] * m.sqrt(q[0])

    problem = Problem(Hamiltonian(H, dof=1, name="root"), q0=[1.0], p0=[0.0], t_end=4.0)
    program = Taylor(tol=1e-12).compile(problem.system)
    starts = [[1.0, 0.0], [1.0, -2.0], [2.0, 0.5]]  # the second crosses q = 0
    batch = program.batch(starts, times=[0.25, 4.0])
    assert batch.status[0] is batch.status[2] is Status.FINISHED
    assert batch.status[1] is Status.NOT_FINITE
    assert "not finite" in batch.reason[1]
    assert np.isfinite(batch.y[[0, 2]]).all()
    assert np.isnan(batch.y[1, 1]).all()
    expected = program.start(starts[2]).advance(np.array([4.0])).y[0]
    assert np.abs(batch.y[2, 1] - expected).max() < 1e-10


def test_starts_of_the_wrong_shape_are_refused():
    problem = problems.load("henon_heiles")
    program = Taylor().compile(problem.system)
    for starts in ([[1.0, 2.0]], [], [[1.0, 0.0, np.nan, 0.0]]):
        with pytest.raises(InputError):
            program.batch(starts, times=[1.0])
    with pytest.raises(InputError, match="par must have shape"):
        program.batch([problem.y0] * 2, np.ones((3, 1)), times=[1.0])
