"""What trajectories do where they meet a switching surface: cross, slide, stop, or begin to move."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from integrators import HBVM, Gauss, Status, integrate
from problems import Problem, VectorField

from .search.surfaces import END, KINDS, draw

METHODS = [HBVM(), Gauss(s=6, tol=1e-11)]


def check_fields(seed, kind, count):
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    for i in range(count):
        drawn = draw(rng, kind)
        expected = drawn.solve()
        if expected is None:
            continue
        t, y, slides = expected
        for method in METHODS:
            found = integrate(drawn.problem, method, [END])
            assert found.status is (Status.SLIDING if slides else Status.FINISHED), (i, method, found.reason)
            if slides:
                assert abs(found.t_stop - t) < 1e-9, (i, method)  # measured 3e-15
            else:
                error = np.abs(found.y[-1] - y).max() / max(1.0, np.abs(y).max())
                assert error < 1e-7, (i, method)  # measured 1.4e-12


@pytest.mark.parametrize("kind", KINDS)
def test_affine_fields_slide_where_both_point_to_the_surface_and_nowhere_else(kind):
    check_fields(2, kind, 10)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_so_do_hundreds_of_fields(kind):
    check_fields(3, kind, 200)


@pytest.mark.parametrize("method", [HBVM(), Gauss(s=4, tol=1e-8)], ids=repr)
@pytest.mark.parametrize("drag", [0.0, 0.006])
def test_a_rocket_lifts_off_from_two_surfaces_at_once(method, drag):
    # Before: sliding at lift-off, with drag: the height, the velocity and the thrust's surplus are 0 there.
    def f(t, y, m):
        h, v, mass = y
        a = (20 * t - drag * v * m.abs(v)) / mass - 9.81
        return [v, m.where((h <= 0) & (a < 0), 0.0, a), -20 * t / 800]

    found = integrate(Problem(VectorField(f, dim=3), y0=[0.0, 0.0, 1.0], t_end=2.0), method, [2.0])
    assert found.status is Status.FINISHED
    expected = [11.86912303, 23.81693471, 0.95] if drag == 0.0 else [11.61731074, 22.81758885, 0.95]
    assert np.abs(found.y[-1] - expected).max() < 1e-6  # measured 5e-9, the digits given


def rocket(t, y, par, m):
    """Height, velocity and mass; it stands until the thrust exceeds the weight."""
    h, v, mass = y
    a = (par.thrust * t - par.drag * v * m.abs(v)) / mass - par.g
    return [v, m.where((h <= 0) & (a < 0), 0.0, a), -par.burnt * t]


def motor(t, y, par, m):
    """Angle and speed; it rests until the torque exceeds the friction."""
    rests = (y[1] <= 0) & (par.torque * t < par.friction)
    return [y[1], m.where(rests, 0.0, par.torque * t - par.friction - par.viscous * y[1])]


ROCKET = VectorField(rocket, dim=3, parameters={"thrust": 20.0, "drag": 0.0, "g": 9.81, "burnt": 0.025})
MOTOR = VectorField(motor, dim=2, parameters={"torque": 1.0, "friction": 1.0, "viscous": 0.0})


def drawn_start(seed):
    """Return the problem of a rocket or motor, and its last state, by the field after the start alone."""
    rng = np.random.default_rng(seed)
    par = SimpleNamespace(
        thrust=rng.uniform(8.0, 40.0), drag=rng.choice([0.0, 10.0 ** rng.uniform(-3.0, 0.0)]),
        g=rng.uniform(2.0, 10.0), burnt=rng.uniform(0.0, 0.05), torque=rng.uniform(0.5, 4.0),
        friction=rng.uniform(0.3, 3.0), viscous=rng.choice([0.0, rng.uniform(0.1, 2.0)]),
    )  # fmt: skip
    if rng.uniform() < 0.5:  # thrust t = g (1 - burnt t^2/2)
        root = np.sqrt(par.thrust**2 + 2.0 * par.burnt * par.g**2)
        system, y0, begins = ROCKET, [0.0, 0.0, 1.0], 2.0 * par.g / (par.thrust + root)
        y = [0.0, 0.0, 1.0 - par.burnt * begins**2 / 2]

        def ahead(t, y):
            a = (par.thrust * t - par.drag * y[1] * abs(y[1])) / y[2] - par.g
            return [y[1], a, -par.burnt * t]
    else:
        system, y0, begins, y = MOTOR, [0.0, 0.0], par.friction / par.torque, [0.0, 0.0]

        def ahead(t, y):
            return [y[1], par.torque * t - par.friction - par.viscous * y[1]]

    end = begins + rng.uniform(0.3, 2.0)
    last = solve_ivp(ahead, (begins, end), y, method="DOP853", rtol=2.3e-14, atol=1e-15).y[:, -1]
    values = {name: getattr(par, name) for name in system.parameters}
    return Problem(system, y0=y0, t_end=end, parameters=values), last


def check_starts(seeds):
    for seed in seeds:
        problem, expected = drawn_start(seed)
        for method in METHODS:
            found = integrate(problem, method, [problem.t_end])
            assert found.status is Status.FINISHED, (seed, method, found.reason)
            assert np.abs(found.y[-1] - expected).max() < 1e-11, (seed, method)  # measured 2.7e-13


def test_rockets_and_motors_start():
    check_starts(range(15))


@pytest.mark.slow
def test_so_do_hundreds_of_rockets_and_motors():
    check_starts(range(100, 400))


@pytest.mark.parametrize(
    "method", [HBVM(), HBVM(tol=1e-6), Gauss(s=4, tol=1e-8), HBVM(k=8, s=4, h=0.01)], ids=repr
)
def test_a_tank_runs_empty_and_stays_so(method):
    # Before: sliding, or no convergence: the field vanishes at the surface.
    tank = VectorField(lambda y, m: [-m.sqrt(m.where(y[0] > 0, y[0], 0.0))], dim=1)
    found = integrate(Problem(tank, y0=[1.0], t_end=5.0), method, [1.0, 5.0])
    assert found.status is Status.FINISHED
    assert abs(found.y[0, 0] - 0.25) < 1e-6  # measured 0, also at tol=1e-6
    assert abs(found.y[1, 0]) < 1e-15


@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("viscous", [0.0, 0.5])
def test_a_motor_starts_when_its_torque_exceeds_the_friction(method, viscous):
    # v' = t - 1 from t = 1 on, less the viscous friction.
    def f(t, y, m):
        rests = (y[1] <= 0) & (t < 1.0)
        return [y[1], m.where(rests, 0.0, t - 1.0 - viscous * y[1])]

    found = integrate(Problem(VectorField(f, dim=2), y0=[0.0, 0.0], t_end=3.0), method, [3.0])
    assert found.status is Status.FINISHED
    tau, c = 2.0, viscous
    v = tau**2 / 2 if c == 0.0 else tau / c - (1.0 - np.exp(-c * tau)) / c**2
    assert abs(found.y[-1, 1] - v) < 1e-8  # measured 0


def two_tanks(y, par, m):
    """The first runs into the second, which leaks."""
    flow = par.k * m.sqrt(m.where(y[0] > 0, y[0], 0.0))
    return [-flow, flow - par.l * m.sqrt(m.where(y[1] > 0, y[1], 0.0))]


TANKS = VectorField(two_tanks, dim=2, parameters={"k": 1.0, "l": 0.5})
REFILLED = [  # before, to 4.8e-3 and less, by stages that an infinite Jacobian let pass for solved
    (1.2360895878601705, 0.4513749606335533, [0.7515364204572901, 2.184473353072339], 0.1964),
    (0.8963875849667817, 0.580811707490474, [0.408047542783183, 2.265454874608028], 0.1575),
]


def left_in_the_empty_tank(k, leak, start, beyond):
    """Return the most that the first tank has after it has run empty."""
    empty = 2.0 * np.sqrt(start[0]) / k
    problem = Problem(TANKS, y0=start, t_end=empty + beyond, parameters={"k": k, "l": leak})
    found = integrate(problem, HBVM(), np.linspace(empty, empty + beyond, 40))
    assert found.status is Status.FINISHED, (k, leak, start, found.reason)
    return float(np.abs(found.y[1:, 0]).max())


def drawn_tanks(seed):
    rng = np.random.default_rng(seed)
    return (
        rng.uniform(0.5, 3.0),
        rng.uniform(0.2, 0.6),
        rng.uniform([0.3, 1.5], [1.0, 3.0]),
        rng.uniform(0.1, 0.5),
    )


@pytest.mark.parametrize("tanks", REFILLED)
def test_a_tank_that_is_empty_stays_so(tanks):
    assert left_in_the_empty_tank(*tanks) < 1e-12  # measured 1e-16


def test_so_do_a_hundred_tanks():
    assert max(left_in_the_empty_tank(*drawn_tanks(seed)) for seed in range(100)) < 1e-12
