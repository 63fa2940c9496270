"""heyoka's batch integrator behind the same seam as the kernel's batch."""

import numpy as np
import pytest

import problems
from integrators import Taylor
from integrators.protocol import Status
from problems import Hamiltonian, Problem, VectorField
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


def poles() -> Problem:
    """y' = r y^2 beside a slow oscillator: a pole at 1/(r y0), which costs the oscillator nothing."""
    system = VectorField(
        lambda y, par: [par.rate * y[0] * y[0], y[2], -y[1]], dim=3, parameters={"rate": 1.0}, name="poles"
    )
    return Problem(system, y0=[1.0, 1.0, 0.0], t_end=50.0, name="poles")


@pytest.mark.parametrize("dead", [[0], [3, 9], [0, 1, 2, 3, 4, 5, 6]])
def test_the_others_reach_every_time_after_one_met_a_pole(dead):
    problem = poles()
    program = Taylor(tol=1e-15).compile(problem.system)
    starts, n = np.tile(problem.y0, (11, 1)), 11  # 11: the lanes of the second group are not all used
    starts[:, 0] = -1.0 - np.arange(n)
    starts[dead, 0] = 1.0 / (0.3 + np.arange(len(dead)))  # a pole at 0.3, 1.3, ...
    times = np.linspace(0.0, 50.0, 26)
    batch = program.batch(starts, times=times)
    for i in range(n):
        single = program.start(starts[i], problem.par).advance(times, sample="stop")
        assert batch.status[i] is (Status.NOT_FINITE if i in dead else Status.FINISHED)
        reached = single.t.size
        assert reached < times.size if i in dead else reached == times.size
        # 0 measured: the same steps in the same arithmetic
        assert np.abs(batch.y[i, :reached] - single.y).max() < 1e-13
        assert np.isnan(batch.y[i, reached:]).all()
    assert batch.t_stop[dead] == pytest.approx(0.3 + np.arange(len(dead)), abs=1e-9)
    assert all(f"t = {batch.t_stop[i]:.6g}" in batch.reason[i] for i in dead)


def test_a_trajectory_that_crawls_is_stalled_and_the_others_finish(monkeypatch):
    for module in ("integrators.running.watchdog", "integrators.peers.heyoka.batch"):
        monkeypatch.setattr(f"{module}.STALL_STEPS", 500)  # 200,000 take seconds
    system = VectorField(
        lambda y, par, m: [m.cos(par.rate * y[1]) * par.rate, 1.0], dim=2, parameters={"rate": 1.0}
    )
    problem = Problem(system, y0=[0.0, 0.0], t_end=1.0)
    program = Taylor().compile(system)
    rates = [[1.0], [1e13], [2.0]]  # the second turns round 10^13 times in a unit of time
    batch = program.batch(np.tile(problem.y0, (3, 1)), rates, times=[0.5, 1.0])
    assert batch.status == [Status.FINISHED, Status.STALLED, Status.FINISHED]
    assert "the steps have collapsed" in batch.reason[1]
    assert 0.0 < batch.t_stop[1] < 1e-7
    assert np.abs(batch.y[[0, 2], 1, 0] - np.sin([1.0, 2.0])).max() < 1e-14  # 1.1e-16
    assert np.isnan(batch.y[1]).all()
