"""Line integrals take what every method on the kernel does: batches, breakpoints, bounds on the steps."""

import numpy as np
import pytest

import problems
from integrators import HBVM, LineIntegral
from integrators.protocol import Status
from problems import Hamiltonian, Problem

METHODS = [
    ("kepler", LineIntegral(k=7, s=3, h=0.1, invariants=["energy", "angular_momentum"])),
    ("kepler", LineIntegral(k=12, s=4, tol=1e-9, invariants=["energy", "angular_momentum", "lenz"])),
    ("lotka_volterra", HBVM(k=6, s=2, h=0.1)),
    ("lotka_volterra", HBVM(tol=1e-9)),
]


@pytest.mark.parametrize("sample", ["partial", "stop", "dense"])
@pytest.mark.parametrize(("name", "method"), METHODS, ids=repr)
def test_a_batch_is_its_trajectories_bit_for_bit(name, method, sample):
    problem = problems.load(name)
    program = method.compile(problem.system)
    starts = problem.y0 * np.array([[1.0], [1.02], [0.95], [1.0], [0.97]])
    times = np.array([0.5, 1.33, 2.0, 7.77])
    batch = program.batch(starts, times=times, sample=sample)
    assert batch.status == [Status.FINISHED] * 5
    for start, y in zip(starts, batch.y, strict=True):
        alone = program.start(start)
        alone.destination = times[-1]  # a batch has one: its last step ends there
        assert np.array_equal(y, alone.advance(times, sample=sample).y)


def test_in_a_batch_too_a_quantity_that_is_no_invariant_is_named_and_the_others_go_on():
    def H(q, p, par):
        return (p[0] ** 2 + p[1] ** 2) / 2 + (q[0] ** 2 + par.b * q[1] ** 2) / 2

    def angular_momentum(q, p):
        return q[0] * p[1] - q[1] * p[0]

    system = Hamiltonian(
        H, dof=2, parameters={"b": 1.0}, invariants={"angular_momentum": angular_momentum}, name="oscillator"
    )
    problem = Problem(system, q0=[1.0, 0.2], p0=[0.1, 1.0], t_end=10.0)
    program = LineIntegral(k=8, s=4, h=0.05, invariants=["angular_momentum"]).compile(system)
    batch = program.batch(np.tile(problem.y0, (3, 1)), [[1.0], [1.001], [1.0]], times=[1.0, 2.03])
    assert batch.status == [Status.FINISHED, Status.NOT_INVARIANT, Status.FINISHED]
    assert batch.reason[1].startswith("angular_momentum is not an invariant: in the step from t = 0.0 ")


def test_poisson_systems_take_breakpoints_and_bounds_on_the_steps():
    problem = problems.load("lotka_volterra")
    steps = HBVM(tol=1e-8, breakpoints=[1.0, 2.5], max_step=0.3).compile(problem.system).start(problem.y0)
    taken = steps.advance([3.0], sample="steps")
    assert {1.0, 2.5} <= set(taken.t.tolist())
    assert np.diff(taken.t).max() <= 0.3 * (1 + 1e-15)
    assert problem.errors(taken.y)["energy"].max() <= 1e-14  # measured 3.6e-16
    stepper = HBVM(tol=1e-8, max_steps=3).compile(problem.system).start(problem.y0)
    assert stepper.advance([50.0]).status is Status.MAX_STEPS
