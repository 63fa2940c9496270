"""``HBVM(tol=..., projection="energy")``: equations solved to the tolerance, steps moved to the energy."""

from itertools import pairwise

import numpy as np
import pytest

import problems
from integrators import HBVM, Event, Status, integrate, integrate_many, start
from integrators.kernel.stepper import HBVMStepper
from problems import Hamiltonian, Poisson, Problem, VectorField
from problems.errors import InputError


def projected(tol, **options):
    return HBVM(tol=tol, projection="energy", **options)


def moved(problem, method, times):
    """Return a solution, which must be finished without a warning."""
    solution = integrate(problem, method, times)
    assert solution.status is Status.FINISHED
    assert solution.warnings == ()
    return solution


HENON_HEILES = problems.load("henon_heiles", energy=0.125, q2=0.1)
KEPLER = problems.load("kepler", e=0.6)


@pytest.mark.parametrize(
    "problem",
    [
        KEPLER,
        HENON_HEILES,
        problems.load("pendulum"),
        problems.load("double_pendulum", q1=0.5, q2=0.7),  # not separable
        problems.load("outer_solar_system"),  # bodies
    ],
    ids=lambda problem: problem.system.name,
)
@pytest.mark.parametrize("tol", [1e-3, 1e-6])
def test_the_energy_is_at_rounding_whatever_the_tolerance(problem, tol):
    solution = integrate(problem, projected(tol), np.linspace(0.0, 200.0, 41)[1:])
    assert solution.status is Status.FINISHED
    assert solution.errors()["energy"].max() < 3e-15  # 1.0e-15 at most; HBVM(8, 7) without: 7e-13 to 5e-4


def test_it_stays_there_over_a_long_run():
    times = np.linspace(0.0, 20_000.0, 401)[1:]
    errors = moved(HENON_HEILES, projected(1e-4), times).errors()["energy"]
    assert errors.max() < 3e-15  # 4e-16, in 9,400 steps
    assert errors[200:].mean() < 2.0 * errors[:200].mean()  # no drift: 1.1 times
    without = integrate(HENON_HEILES, HBVM(k=8, s=7, tol=1e-4), times).errors()["energy"]
    assert without.max() > 1e-7  # 2.2e-6


def test_the_error_of_the_trajectory_follows_the_tolerance():
    exact = moved(KEPLER, HBVM(), [50.0]).y[-1]
    errors = [
        np.abs(moved(KEPLER, projected(tol), [50.0]).y[-1] - exact).max()
        for tol in (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
    ]
    assert errors[0] < 0.01  # 1.8e-3
    for looser, tighter in pairwise(errors):
        assert tighter < looser / 5.0  # 1/19 at most


@pytest.mark.parametrize("problem", [KEPLER, HENON_HEILES], ids=lambda problem: problem.system.name)
def test_a_step_takes_half_of_the_iterations(problem):
    def iterations(projection):
        stats = integrate(problem, HBVM(k=8, s=7, tol=1e-3, projection=projection), [300.0]).stats
        assert stats.iterations is not None
        return stats.iterations / stats.steps

    assert iterations("energy") < 0.5 * iterations(None)  # .42 and .39


def test_the_change_is_the_same_in_other_units():
    def scaled(length, mass):
        def energy(q, p, m):
            return (p[0] ** 2 + p[1] ** 2) / (2 * mass) - mass * length**3 / m.sqrt(q[0] ** 2 + q[1] ** 2)

        y0 = np.array([0.4 * length, 0.0, 0.0, 2.0 * mass * length])
        return Problem(Hamiltonian(energy, dof=2, name="kepler"), y0=y0, t_end=20.0)

    size = np.array([2.0**8, 2.0**8, 2.0**-12, 2.0**-12])
    plain = moved(scaled(1.0, 1.0), projected(1e-4), [20.0])
    other = moved(scaled(2.0**8, 2.0**-20), projected(1e-4), [20.0])
    assert other.stats.steps == plain.stats.steps
    assert np.allclose(other.y, plain.y * size, rtol=1e-12, atol=0.0)  # 6e-16 of the largest


def test_exact_mirror_symmetry_is_kept():
    solution = moved(problems.load("sitnikov", e=0.75), projected(1e-6), np.linspace(0.0, 100.0, 21)[1:])
    assert solution.q is not None
    assert np.all(solution.q[:, 6:8] == 0.0)  # the planetoid is on the axis


def test_a_field_with_a_declared_energy_is_projected_too():
    field = VectorField(
        lambda y: [y[1], -y[0] - y[0] ** 3],
        dim=2,
        invariants={"energy": lambda y: (y[0] ** 2 + y[1] ** 2) / 2 + y[0] ** 4 / 4},
        name="duffing",
    )
    problem = Problem(field, y0=np.array([1.0, 0.5]), t_end=100.0)
    errors = moved(problem, projected(1e-4), np.linspace(0.0, 100.0, 21)[1:]).errors()["energy"]
    assert errors.max() < 3e-15  # 2.1e-16


def test_a_checkpoint_goes_on_with_the_same_bits():
    method = projected(1e-4)
    stepper, other = (method.compile(KEPLER.system).start(KEPLER.y0) for _ in range(2))
    assert isinstance(stepper, HBVMStepper)
    assert isinstance(other, HBVMStepper)
    stepper.advance([30.0])
    kept = stepper.checkpoint()
    after = stepper.advance([60.0]).y
    other.restore(kept)
    assert np.array_equal(other.advance([60.0]).y, after)


def test_another_state_in_between_has_its_own_energy():
    run = start(KEPLER, projected(1e-4))
    run.until(10.0)
    run.y = 1.01 * KEPLER.y0
    energy = run.energy()
    run.until(40.0)
    run.step()
    assert abs(run.energy() - energy) < 3e-15  # 6e-17


def test_many_are_what_each_is_alone():
    starts = KEPLER.y0 * np.array([[1.0], [1.01], [1.02]])
    many = integrate_many(KEPLER, projected(1e-4), times=[20.0], starts=starts)
    for y0, y in zip(starts, many.y, strict=True):
        alone = integrate(Problem(KEPLER.system, y0=y0, t_end=20.0), projected(1e-4), [20.0])
        assert np.array_equal(alone.y, y)


def test_events_have_the_energy_of_the_start():
    solution = integrate(KEPLER, projected(1e-4), [200.0], events=[Event(lambda q: q[1], name="crossing")])
    found = solution.events["crossing"]
    assert len(found.t) == 63  # twice a period of 2 pi
    x, y, u, v = found.y.T
    assert np.abs(y).max() < 1e-12  # 2.9e-14
    assert np.ptp(0.5 * (u**2 + v**2) - 1.0 / np.hypot(x, y)) < 5e-15  # 1.8e-15


def test_a_state_that_an_event_makes_has_its_own_energy():
    ball = Hamiltonian(lambda q, p: p[0] ** 2 / 2 + q[0] + q[0] ** 4, dof=1, name="ball")
    bounce = Event(lambda q: q[0], direction=-1, then=lambda y: [y[0], -0.9 * y[1]], name="bounce")
    solution = integrate(Problem(ball, y0=[1.0, 0.0], t_end=3.0), projected(1e-4), events=[bounce])
    assert len(solution.events["bounce"].t) >= 2
    left = 2.0 * 0.81 ** len(solution.events["bounce"].t)
    q, p = solution.y[-1]
    assert abs(p**2 / 2 + q + q**4 - left) < 1e-14  # 1.1e-16


@pytest.mark.parametrize("sample", ["partial", "stop", "steps"])
def test_every_sample_is_projected(sample):
    times = np.linspace(0.0, 50.0, 101)[1:]
    solution = integrate(KEPLER, projected(1e-4), times, sample=sample)
    assert solution.errors()["energy"].max() < 3e-15  # 1.04e-15


def test_where_it_cannot_be_is_said():
    forced = Hamiltonian(lambda t, q, p, m: p[0] ** 2 / 2 + q[0] ** 2 * m.cos(t), dof=1, name="forced")
    poisson = Poisson(
        lambda y: y[0] + y[1], lambda y: [[0, y[0] * y[1]], [-y[0] * y[1], 0]], dim=2, name="prey"
    )
    plain = VectorField(lambda y: [-y[0]], dim=1, name="decay")
    for system, why in (
        (forced, "the energy without time; not forced"),
        (plain, "needs a field and an energy that are formulas"),
        (poisson, "is not for Poisson systems"),
    ):
        with pytest.raises(InputError, match=why):
            integrate(Problem(system, y0=np.ones(system.dim), t_end=1.0), projected(1e-4), [1.0])
    with pytest.raises(InputError, match="k = s = 4 is the Gauss method"):
        HBVM(k=4, s=4, tol=1e-4, projection="energy")
    with pytest.raises(InputError, match="projection with a tolerance only"):
        HBVM(k=8, s=4, h=0.1, projection="energy")
    with pytest.raises(InputError, match="steps without a projection"):
        integrate(KEPLER, projected(1e-4), [1.0], variations="y0")
