"""Periodic orbits whose periods and multipliers are known, or found by another library."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import ellipk

import problems
from integrators import Gauss, integrate, periodic
from integrators.dynamics import continued
from problems import Hamiltonian, InputError, Problem, VectorField
from problems.double_double import two_sum

MIRROR = [1, -1, -1, 1]


@pytest.mark.parametrize("loops", [2, 3, 4])
def test_arenstorf_s_orbits(loops):
    problem = problems.load("cr3bp", loops=loops)
    guess = problem.y0 * (1.0 + 1e-6)
    guess[0] = problem.y0[0]
    found = periodic(problem, guess, period=problem.t_end * (1.0 - 1e-6), mirror=MIRROR, free=[3, "period"])
    assert found.converged, found.reason
    # measured: 5e-15 and 2e-15; the published starts and periods have 19 digits or more
    assert abs(found.y0[3] - problem.y0[3]) < 1e-13
    assert abs(found.period - problem.t_end) < 1e-13
    size = abs(found.multipliers).max()
    assert abs(np.prod(found.multipliers) - 1.0) < 1e-8 * size  # measured: 1e-11 * size
    whole = periodic(problem, found.y0, period=found.period, free=[3, "period"])
    assert whole.converged
    assert abs(whole.period - found.period) < 1e-12


# Angles of the figure eight's multipliers over 2 pi, from the differences of the second test; they do not
# depend on scale. Its linear stability: C. Simo, Contemporary Mathematics 292 (2002), 209-228.
ANGLES = 0.008422724708, 0.298092529005


def angles_of(monodromy):
    return np.angle(np.linalg.eigvals(monodromy)) / (2 * np.pi)


def test_the_figure_eight_is_linearly_stable():
    found = periodic(problems.load("figure_eight"), period=6.32)
    assert found.converged, found.reason
    assert abs(np.abs(found.multipliers) - 1.0).max() < 1e-5  # eight of them are 1, in blocks
    for angle in (*ANGLES, *(-angle for angle in ANGLES)):
        assert np.abs(angles_of(found.monodromy) - angle).min() < 1e-11  # measured: 4e-13


@pytest.mark.slow
def test_the_figure_eights_monodromy_matrix_is_that_of_differences_in_double_double():
    found = periodic(problems.load("figure_eight"), period=6.32)
    program = Gauss(s=16, h=1 / 32, precision="double-double").compile(found.problem.system)

    def end(change):
        pairs = np.stack(two_sum(found.y0, change), axis=1)
        stepper = program.start_pairs(pairs, found.problem.par)
        return stepper.advance([found.period]).y[0], stepper.low[0]

    columns = []
    for change in 1e-10 * np.eye(12):
        (high, low), (other_high, other_low) = end(change), end(-change)
        columns.append(((high - other_high) + (low - other_low)) / 2e-10)
    matrix = np.stack(columns, axis=1)
    # measured: 2.6e-15 of the largest
    assert np.abs(matrix - found.monodromy).max() < 1e-13 * np.abs(matrix).max()
    for angle in ANGLES:
        assert np.abs(angles_of(matrix) - angle).min() < 1e-11


def spatial(q, p, par, m):
    """The restricted three-body problem in space."""
    x, y, z = q
    r1 = m.sqrt((x + par.mu) ** 2 + y**2 + z**2)
    r2 = m.sqrt((x - (1 - par.mu)) ** 2 + y**2 + z**2)
    kinetic = (p[0] ** 2 + p[1] ** 2 + p[2] ** 2) / 2
    return kinetic + (y * p[0] - x * p[1]) - ((1 - par.mu) / r1 + par.mu / r2)


HALO = Problem(
    Hamiltonian(spatial, dof=3, parameters={"mu": 0.01215}),
    q0=[1.17, 0.0, 0.088],
    p0=[0.0, -0.19 + 1.17, 0.0],
    t_end=3.35,
)


def multipliers_by_heyoka(orbit):
    """Return the multipliers of an orbit of `HALO`'s system, from variational equations of its own."""
    heyoka = pytest.importorskip("heyoka")
    q, p = heyoka.make_vars("x", "y", "z"), heyoka.make_vars("px", "py", "pz")
    mu = float(orbit.problem.par[0])
    r1 = ((q[0] + mu) ** 2 + q[1] ** 2 + q[2] ** 2) ** -1.5 * (1 - mu)
    r2 = ((q[0] - (1 - mu)) ** 2 + q[1] ** 2 + q[2] ** 2) ** -1.5 * mu
    field = [p[0] + q[1], p[1] - q[0], p[2]]
    field += [p[1] - r1 * (q[0] + mu) - r2 * (q[0] - (1 - mu)), -p[0] - (r1 + r2) * q[1], -(r1 + r2) * q[2]]
    equations = heyoka.var_ode_sys(list(zip(q + p, field, strict=True)), heyoka.var_args.vars, order=1)
    run = heyoka.taylor_adaptive(equations, orbit.y0.tolist(), tol=1e-16, compact_mode=True)
    run.propagate_until(orbit.period)
    values = np.linalg.eigvals(np.array(run.state[6:]).reshape(6, 6))
    return values[np.argsort(-np.abs(values))]


def test_a_family_of_halo_orbits():
    first = periodic(HALO, mirror=[1, -1, 1, -1, 1, -1], free=[0, 4, "period"])
    assert first.converged, first.reason
    heights = [0.1, 0.12, 0.14, 0.16]
    family = continued(first, 2, heights)
    assert [orbit.converged for orbit in family] == [True] * 4
    for orbit, height in zip([first, *family], [0.088, *heights], strict=True):
        assert orbit.y0[2] == height
        assert orbit.residual < 1e-11  # measured: at most 2e-12
        found, other = orbit.multipliers, multipliers_by_heyoka(orbit)
        assert abs(found[0] - other[0]) < 1e-8 * abs(other[0])  # measured: at most 1e-12
        # of the others not those that are 1
        apart = np.abs(other - 1.0) > 1e-3
        for value in other[apart]:
            assert np.abs(found - value).min() < 1e-8 * max(1.0, abs(value))
    periods = np.array([orbit.period for orbit in [first, *family]])
    assert (np.diff(periods) < 0.0).all()


def test_a_halo_orbit_of_the_jpl_catalogue_has_its_stability_index():
    """An orbit around L1 of Earth and Moon, which the catalogue tells by its Jacobi constant.

    The values of JPL's catalogue of three-body periodic orbits are printed in the documentation of the Julia
    package CRTBPNaturalMotion.jl (page "JPL API example").
    """
    system = Hamiltonian(spatial, dof=3, parameters={"mu": 1.215058560962404e-2})
    problem = Problem(system, q0=[0.9173237, 0.0, 0.33820103], p0=[0.0, 1.00485366, 0.0], t_end=2.35396002)
    first = periodic(problem, mirror=[1, -1, 1, -1, 1, -1], free=[0, 4, "period"])
    assert first.converged, first.reason

    def difference(z):
        (orbit,) = continued(first, 2, [z])
        return -2.0 * problem.invariants(orbit.y0[np.newaxis])["energy"][0] - 2.90165039860189

    z = first.y0[2]
    z = brentq(difference, z - 1e-6, z + 1e-6, xtol=1e-16)
    assert abs(difference(z)) < 1e-14  # measured: 0
    (orbit,) = continued(first, 2, [z])
    size = abs(orbit.multipliers[0])
    assert abs((size + 1.0 / size) / 2.0 / 4.96768347393297 - 1.0) < 1e-8  # measured: 1.7e-12
    assert orbit.period == pytest.approx(2.35396002, abs=1e-8)


def test_the_period_of_a_pendulum_is_an_elliptic_integral():
    problem = problems.load("pendulum", q=1.0, p=0.0)
    found = periodic(problem, period=6.5, mirror=[1, -1], free="period")
    assert found.converged
    assert abs(found.period - 4 * ellipk(np.sin(0.5) ** 2)) < 1e-13
    family = continued(found, 0, [1.5, 2.0, 2.5, 3.0])
    for orbit in family:
        assert abs(orbit.period - 4 * ellipk(np.sin(orbit.y0[0] / 2) ** 2)) < 1e-11  # measured: 2e-13


def test_a_driven_damped_oscillator():
    system = VectorField(
        lambda t, y, par, m: [y[1], -2.0 * y[0] - 0.3 * y[1] + par.a * m.cos(t)], dim=2, parameters={"a": 0.7}
    )
    problem = Problem(system, y0=[0.0, 0.0], t_end=2 * np.pi)
    found = periodic(problem)
    assert found.free == (0, 1)
    assert found.converged
    response = 0.7 / (1.0 + 0.3j)
    assert np.abs(found.y0 - [response.real, -response.imag]).max() < 1e-13
    exact = np.linalg.eigvals(expm(2 * np.pi * np.array([[0.0, 1.0], [-2.0, -0.3]])))
    assert np.abs(np.sort_complex(found.multipliers) - np.sort_complex(exact)).max() < 1e-13


def test_a_parameter_can_be_free():
    """The strength of a force for which the period is given."""
    system = Hamiltonian(
        lambda q, p, par: p[0] ** 2 / 2 + par.k * q[0] ** 4 / 4, dof=1, parameters={"k": 1.0}
    )
    problem = Problem(system, q0=[1.0], p0=[0.0], t_end=7.0)
    found = periodic(problem, mirror=[1, -1], free="k", method=Gauss(s=8, h=0.1))
    assert found.converged
    # periods are like 1/sqrt(k); that for k = 1 is 4 K(1/2)
    assert abs(found.problem.par[0] - (4 * ellipk(0.5) / 7.0) ** 2) < 1e-12
    back = integrate(found.problem, Gauss(s=8, h=0.1), [7.0])
    assert np.abs(back.y[0] - found.y0).max() < 1e-12


def test_what_is_not_there_is_not_found():
    problem = Problem(VectorField(lambda y: [1.0 + y[0] ** 2 * 0.1, -y[1]], dim=2), y0=[0.0, 1.0], t_end=1.0)
    found = periodic(problem)
    assert not found.converged
    assert "residual" in found.reason


def test_an_equilibrium_is_no_orbit():
    found = periodic(problems.load("pendulum", q=1e-3, p=0.0), period=5.0, free=[0, 1])
    assert not found.converged
    assert "equilibrium" in found.reason


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"guess": [1.0]}, "finite numbers"),
        ({"mirror": [1, 1, -1, 1]}, "does not reverse"),
        ({"mirror": [1, -1]}, "4 signs"),
        ({"mirror": [-1, 1, 1, -1]}, "its own image"),
        ({"free": [4]}, "component 4"),
        ({"free": ["nu"]}, "nu"),
        ({"free": []}, "nothing to change"),
        ({"period": -1.0}, "period"),
    ],
)
def test_what_cannot_be_is_said(asked, words):
    with pytest.raises(InputError, match=words):
        periodic(problems.load("cr3bp"), **asked)
