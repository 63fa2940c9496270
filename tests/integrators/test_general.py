"""General systems against their published end values, beside SciPy's methods; and stiff oscillations.

The end value of van der Pol's equation is that of F. Mazzia, C. Magherini, *Test Set for Initial
Value Problem Solvers*, release 2.4. Of Robertson's at t = 40, the example of LSODE (A. C. Hindmarsh,
ODEPACK, 1983) prints 7.158e-01 9.185e-06 2.842e-01; Radau and HBVM agree on the further digits.
"""

import math

import numba
import numpy as np
import pytest

import integrators
import problems
from integrators import HBVM, Gauss, integrate
from integrators.protocol import Status
from problems import Foreign, Hamiltonian, Problem, VectorField

VAN_DER_POL = Problem(
    VectorField(
        lambda y, par: [y[1], par.stiffness * ((1 - y[0] ** 2) * y[1] - y[0])],
        dim=2,
        parameters={"stiffness": 1e6},  # mu = 1000, time in units of mu
        name="van_der_pol",
    ),
    y0=[2.0, 0.0],
    t_end=2.0,
)
ROBERTSON = Problem(
    VectorField(
        lambda y: [
            -0.04 * y[0] + 1e4 * y[1] * y[2],
            0.04 * y[0] - 1e4 * y[1] * y[2] - 3e7 * y[1] ** 2,
            3e7 * y[1] ** 2,
        ],
        dim=3,
        invariants={"mass": lambda y: y[0] + y[1] + y[2]},
        name="robertson",
    ),
    y0=[1.0, 0.0, 0.0],
    t_end=40.0,
)
PUBLISHED = {
    "van_der_pol": (VAN_DER_POL, [1.706167732170483, -0.8928097010247975]),
    "robertson": (ROBERTSON, [0.7158270687193941, 0.9185534764557763e-5, 0.2841637457458413]),
}


def radau(tol):
    return integrators.registry.create("Radau", rtol=tol, atol=tol * 1e-4)


def dop853(tol):
    return integrators.registry.create("DOP853", rtol=tol, atol=tol)


@pytest.mark.parametrize(
    ("name", "method", "error"),
    [
        ("van_der_pol", HBVM(k=6, s=4, tol=1e-8), 5e-9),  # measured 5.2e-10
        ("van_der_pol", radau(1e-8), 1e-9),  # measured 2.2e-11
        ("robertson", HBVM(tol=1e-8), 1e-12),  # measured 3.9e-14
        ("robertson", Gauss(s=3, h=0.01, solver="newton"), 2e-8),  # measured 1.5e-9
        ("robertson", radau(1e-8), 1e-9),  # measured 8.8e-12
    ],
    ids=repr,
)
def test_stiff_systems_end_at_their_published_values(name, method, error):
    problem, published = PUBLISHED[name]
    made = integrate(problem, method, [problem.t_end])
    assert made.status is Status.FINISHED
    assert np.abs(made.y[0] / published - 1).max() < error


@pytest.mark.parametrize(
    ("method", "error"),
    [
        (HBVM(), 1e-9),  # measured 6.8e-11
        (HBVM(k=12, s=8, tol=1e-13), 1e-9),  # measured 3.2e-11
        (dop853(1e-12), 1e-6),  # measured 7.3e-9
    ],
    ids=repr,
)
@pytest.mark.parametrize("loops", [4, 3])
def test_arenstorfs_orbits_close_after_their_published_periods(method, error, loops):
    problem = problems.load("cr3bp", loops=loops)
    made = integrate(problem, method, [problem.t_end])
    assert np.abs(made.y[0] - problem.y0).max() < error


def test_hbvm_keeps_the_jacobi_integral_of_arenstorfs_orbit_and_dop853_does_not():
    problem = problems.load("cr3bp")
    kept = {method: integrate(problem, method).errors()["jacobi"].max() for method in (HBVM(), dop853(1e-10))}
    assert kept[HBVM()] < 1e-13  # measured 8.4e-15
    assert kept[dop853(1e-10)] > 1e-11  # measured 2.9e-10


def test_a_driven_pendulum_is_one_whatever_way_it_is_written():
    def force(t, y):
        return [y[1], -math.sin(y[0]) + 0.9 * math.cos(2 * t / 3)]

    @numba.njit
    def compiled(t, y, dy):
        dy[0] = y[1]
        dy[1] = -np.sin(y[0]) + 0.9 * np.cos(2 * t / 3)

    driven = Hamiltonian(
        lambda q, p, t, m: p[0] ** 2 / 2 - m.cos(q[0]) - 0.9 * q[0] * m.cos(2 * t / 3), dof=1, name="driven"
    )
    field = VectorField(lambda t, y, m: [y[1], -m.sin(y[0]) + 0.9 * m.cos(2 * t / 3)], dim=2, name="field")
    systems = [driven, field, Foreign(compiled, dim=2), Foreign(force, dim=2)]
    ends = {}
    for system in systems:
        problem = Problem(system, y0=[0.2, 0.0], t_end=20.0)
        for method in (HBVM(k=10, s=6, h=0.25), HBVM(tol=1e-13), dop853(1e-12)):
            ends[system, method] = integrate(problem, method, [20.0]).y[0]
    assert np.ptp(list(ends.values()), axis=0).max() < 1e-9  # measured 1.6e-10
    assert "energy" not in driven.invariant_names


def test_a_stiff_chain_runs_at_a_hundred_times_the_step_at_which_the_fixed_point_fails():
    problem = problems.load("stiff_chain", omega=1e4, t_end=10.0)
    failed = integrate(problem, HBVM(k=8, s=4, h=8e-4, solver="fixed_point"))
    assert failed.status is Status.NONLINEAR_DIVERGENCE
    made = integrate(problem, HBVM(k=8, s=4, h=8e-2), sample="steps")
    assert made.status is Status.FINISHED
    assert made.stats.solver == "Newton"
    assert made.stats.steps == 125
    assert made.errors()["energy"].max() < 1e-14  # measured 1.2e-15
