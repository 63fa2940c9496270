"""Exact solutions, periods, equilibria and special starts."""

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest

import integrators
import problems
from problems import targets
from problems.catalogue import _starts as starts
from problems.catalogue import figure_eight, kepler, morse, pendulum, period_annulus, solar_system
from problems.catalogue.henon_heiles import SADDLES, beyond_triangle, inside_triangle
from problems.errors import InputError


def _satisfies(problem, exact, slope):
    with mpmath.workdps(40):
        start = exact(problem, 0)
        assert max(abs(a - mpmath.mpf(b)) for a, b in zip(start, problem.y0.tolist(), strict=True)) < 1e-35
        for t in (0.3, 7.0, 123.456):
            y = exact(problem, mpmath.mpf(t))
            for i, rate in enumerate(slope(y)):
                derivative = mpmath.diff(lambda s, i=i: exact(problem, s)[i], mpmath.mpf(t))
                # A numerical derivative of 40 digits keeps about 20; measured below 1e-18.
                assert abs(derivative - rate) < mpmath.mpf("1e-15") * (1 + abs(rate))


@pytest.mark.parametrize("e", [0.0, 0.6, 0.99])
def test_keplers_exact_solution_solves_the_equation(e):
    def slope(y):
        r3 = mpmath.sqrt(y[0] ** 2 + y[1] ** 2) ** 3
        return [y[2], y[3], -y[0] / r3, -y[1] / r3]

    _satisfies(problems.load("kepler", e=e), kepler.exact_state, slope)


@pytest.mark.parametrize("p", [1.9, -0.3])
def test_the_pendulums_exact_solution_solves_the_equation(p):
    _satisfies(problems.load("pendulum", p=p), pendulum.exact_state, lambda y: [y[1], -mpmath.sin(y[0])])


@pytest.mark.parametrize("arguments", [{}, {"q": 1.0, "p": -0.2, "D": 2.0, "a": 0.7, "m": 3.0}])
def test_the_morse_oscillators_exact_solution_solves_the_equation(arguments):
    problem = problems.load("morse", **arguments)
    depth, a, m = (mpmath.mpf(x) for x in problem.par.tolist())

    def slope(y):
        w = mpmath.exp(-a * y[0])
        return [y[1] / m, -2 * depth * a * (1 - w) * w]

    _satisfies(problem, morse.exact_state, slope)


def test_no_exact_solution_is_claimed_where_there_is_none():
    with pytest.raises(InputError, match="not bound"):
        morse.exact_state(problems.load("morse", p=2.0), 1.0)
    with pytest.raises(InputError, match="no simple exact solution"):
        pendulum.exact_state(problems.load("pendulum", p=2.5), 1.0)
    fast = problems.Problem(problems.load("kepler").system, q0=[1.0, 0.0], p0=[0.0, 2.0], t_end=1.0)
    with pytest.raises(InputError, match="not an ellipse"):
        kepler.solution(fast, [1.0])


def test_keplers_solution_returns_to_its_start_after_a_revolution():
    problem = problems.load("kepler", e=0.5)
    back = kepler.solution(problem, [0.0, 2 * math.pi])
    # The start's doubles are not exactly those of the period 2 pi; measured 1.2e-14.
    assert np.abs(back - problem.y0).max() <= 5e-14


def test_an_integration_of_keplers_problem_follows_the_exact_solution():
    problem = problems.load("kepler")
    times = np.linspace(0.0, 20.0, 21)
    found = integrators.integrate(problem, integrators.HBVM(k=16, s=8, h=0.1), times=times)
    # Measured 2e-14.
    assert np.abs(found.y - kepler.solution(problem, times)).max() <= 2e-13


def test_the_planets_have_their_periods():
    problem = problems.load("outer_solar_system", frame="heliocentric")
    expected = {"Jupiter": 11.86, "Saturn": 29.46, "Uranus": 84.6, "Neptune": 166.0, "Pluto": 251.5}
    # Osculating periods of 5 September 1994; those of Uranus to Pluto sway by a percent about 84, 165, 248.
    assert _periods(problem, 6) == pytest.approx(list(expected.values()), rel=1e-3)
    problem = problems.load("solar_system", frame="heliocentric")
    expected = [0.24085, 0.61520, 1.00002, 1.88088, 11.862, 29.447, 84.06, 164.89]
    assert _periods(problem, 9) == pytest.approx(expected, rel=1e-4)


def _periods(problem, n):
    q = problem.y0[: 3 * n].reshape(n, 3)
    v = problem.velocity(problem.y0)[0].reshape(n, 3)
    found = []
    for i in range(1, n):
        attraction = problem.par[n] * (problem.par[0] + problem.par[i])
        a = 1 / (2 / np.linalg.norm(q[i] - q[0]) - np.dot(v[i], v[i]) / attraction)
        found.append(2 * np.pi * np.sqrt(a**3 / attraction))
    return found


def test_both_units_of_time_are_the_same_solar_system():
    years, days = (problems.load("outer_solar_system", unit=unit) for unit in ("year", "day"))
    assert (years.y0[:18] == days.y0[:18]).all()
    # One rounding each: measured 1.2e-16.
    assert np.abs(years.y0[18:] / days.y0[18:] / 365.25 - 1).max() <= 3e-16
    assert years.t_end * 365.25 == days.t_end


def test_the_barycentric_frame_is_at_rest_and_the_heliocentric_one_is_the_table():
    problem = problems.load("outer_solar_system", frame="barycentric")
    masses = [Fraction(m) for m in problem.par[:6].tolist()]
    for values in (problem.y0[:18], problem.velocity(problem.y0)[0]):
        rows = [[Fraction(x) for x in row] for row in values.reshape(6, 3).tolist()]
        centre = [sum(m * row[c] for m, row in zip(masses, rows, strict=True)) for c in range(3)]
        # Rounding of the Sun's place (0.007 au) and of the others times their mass: measured 1.2e-18.
        assert max(abs(float(x)) for x in centre) <= 1e-17
    published = problems.load("outer_solar_system", frame="heliocentric", unit="day")
    assert published.y0[:6].tolist() == [0.0, 0.0, 0.0, -3.5023653, -3.8169847, -1.5507963]
    assert published.velocity(published.y0)[0][3:6] == pytest.approx([0.00565429, -0.00412490, -0.00190589])


def test_the_planets_start_on_their_ellipses():
    q, v = solar_system.heliocentric()
    for elements, ratio, x, u in zip(
        solar_system.ELEMENTS, solar_system.MASS_RATIOS, q[1:], v[1:], strict=True
    ):
        attraction = float(solar_system.GAUSSIAN_CONSTANT) ** 2 * (1 + 1 / float(ratio))
        x, u = np.array(x, dtype=float), np.array(u, dtype=float)
        r, h = np.linalg.norm(x), np.cross(x, u)
        lenz = np.cross(u, h) / attraction - x / r
        # Back to the elements in doubles; measured 1e-14 or better (angles of tiny e and i: 1e-12).
        assert 1 / (2 / r - u @ u / attraction) == pytest.approx(float(elements[0]), rel=1e-13)
        assert np.linalg.norm(lenz) == pytest.approx(float(elements[1]), rel=1e-11)
        tilt = math.degrees(math.acos(h[2] / np.linalg.norm(h)))
        assert tilt == pytest.approx(abs(float(elements[2])), abs=1e-5)
        node = math.radians(float(elements[5]))
        flat = float(elements[4]) - float(elements[5])  # argument of the perihelion
        towards = math.degrees(
            math.atan2(lenz @ np.cross(h / np.linalg.norm(h), _line(node)), lenz @ _line(node))
        )
        assert (towards - flat + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-6)


def _line(node):
    return np.array([math.cos(node), math.sin(node), 0.0])


def test_the_figure_eight_and_arenstorfs_orbits_close():
    cases = [
        (problems.load("figure_eight", t_end=figure_eight.PERIOD), 0.02, 1e-13),  # measured 3e-14
        (problems.load("cr3bp", loops=2), 0.002, 1e-12),  # measured 2e-13
        (problems.load("cr3bp", loops=3), 0.0002, 1e-6),  # unstable: measured 2e-8
        (problems.load("cr3bp", loops=4), 0.0002, 1e-6),  # unstable: measured 3e-8
    ]
    for problem, h, tolerance in cases:
        method = integrators.HBVM(k=16, s=8, h=h)
        found = integrators.integrate(problem, method, times=[0.0, problem.t_end])
        assert np.abs(found.y[-1] - problem.y0).max() <= tolerance, problem


def test_the_pericentre_of_a_geodesic_advances_as_elliptic_integrals_say():
    e, p = 0.6, 10.0
    problem = problems.load("schwarzschild", e=e, p=p)
    # Cutler, Kennefick and Poisson: the angle between two pericentres.
    angle = 4 / mpmath.sqrt(1 - (6 - 2 * e) / p) * mpmath.ellipk(4 * e / (p - 6 + 2 * e))
    times = 460.0 + np.arange(0.0, 8.5, 0.5)  # a revolution takes 464.4
    y = integrators.integrate(problem, integrators.HBVM(k=16, s=8, h=0.5), times=times).y
    outwards = y[:, 0] * y[:, 2] + y[:, 1] * y[:, 3]
    turned = np.unwrap(np.arctan2(y[:, 1], y[:, 0]))
    found = np.interp(0.0, outwards, turned - turned[0]) + math.atan2(y[0, 1], y[0, 0])
    assert abs(math.remainder(found - float(angle), 2 * math.pi)) < 1e-6  # measured 1.8e-7, by interpolation


def test_the_annulus_ends_at_a_loop_through_a_saddle():
    problem = problems.load("period_annulus")
    field = targets.numpy(problem.system, "field")
    for point in (period_annulus.P1, period_annulus.P2):
        # Measured 4e-15.
        assert np.abs(field(0.0, np.array(point), problem.par)).max() <= 1e-14
    energies = problem.invariants([period_annulus.P1, (0.0, period_annulus.C_STAR)])["energy"]
    assert energies == pytest.approx([period_annulus.H_STAR] * 2, rel=1e-15)
    with mpmath.workdps(40):  # H(P1) = H(0, c*), and P1 is an equilibrium, to 20 digits

        def H(q, p):
            return p**2 / 2 + p**4 + (p**2 + p**4) * q + (mpmath.mpf(1) / 2 + p + p**2) * q**2

        def slopes(q, p):
            return [
                p + 4 * p**3 + (2 * p + 4 * p**3) * q + (1 + 2 * p) * q**2,
                p**2 + p**4 + (1 + 2 * p + 2 * p**2) * q,
            ]

        saddle = mpmath.findroot(slopes, period_annulus.P1)
        c = mpmath.findroot(lambda c: c**2 / 2 + c**4 - H(*saddle), 0.3757)
        assert abs(c - mpmath.mpf("0.37570559292634522367")) < 1e-20


def test_the_triangle_is_that_of_the_saddles():
    problem = problems.load("henon_heiles")
    field = targets.numpy(problem.system, "field")
    for q in SADDLES:
        y = np.array([*q, 0.0, 0.0])
        assert np.abs(field(0.0, y, problem.par)).max() <= 2e-16
        assert problem.invariants(y)["energy"] == pytest.approx(1 / 6, rel=1e-15)
    middle, corner = np.array([0.0, 0.0]), np.array(SADDLES[2])
    inside = inside_triangle([middle, 0.99 * corner, 1.01 * corner, [0.0, -0.51]])
    assert inside.tolist() == [True, True, False, False]
    beyond = beyond_triangle([[*(1.01 * corner), 0, 0], [*(0.99 * corner), 0, 0], [0, -0.51, 0, 0]])
    assert beyond[1] == 0.0
    assert beyond[[0, 2]] == pytest.approx([0.015, 0.01], rel=1e-12)


@pytest.mark.parametrize("energy", [0.1, 0.2])
def test_no_symmetry_keeps_henon_heiles_in_its_triangle(energy):
    problem = problems.load("henon_heiles", energy=energy)
    assert not problem.system.guards
    # it speaks of a symmetry that rounding breaks
    assert integrators.Dopri8(rtol=1e-9, atol=1e-9).caveat(problem) is None


def test_todas_integrals_are_those_of_its_jacobi_matrix():
    problem = problems.load("toda", n=5)
    q, p = np.array([0.1, -0.3, 0.2, 0.5, -0.1]), problem.y0[5:]
    L = np.diag(p)
    for i in range(5):
        j = (i + 1) % 5
        L[i, j] += np.exp((q[i] - q[j]) / 2)
        L[j, i] += np.exp((q[i] - q[j]) / 2)
    coefficients = np.poly(L)[1:]
    coefficients[-1] += 2  # the corners' constant, which the integrals leave out
    found = problem.invariants(np.concatenate([q, p]))["integrals"][0]
    assert found == pytest.approx(coefficients, rel=1e-12)  # measured 1e-14
    assert found[1] == pytest.approx(p.sum() ** 2 / 2 - problem.invariants([*q, *p])["energy"][0])


def test_the_sine_gordon_start_is_a_breather():
    # u = 4 atan(gamma/sqrt(gamma^2 - 1) sin(sqrt(1 - 1/gamma^2) t) sech(x/gamma)).
    problem = problems.load("sine_gordon", n=400, gamma=1.5, t_end=3.0)
    found = integrators.integrate(problem, integrators.Gauss(s=3, h=0.05), times=[0.0, 3.0])
    x = np.linspace(-20.0, 20.0, 400, endpoint=False)
    w = math.sqrt(1 - 1 / 1.5**2)
    u = 4 * np.arctan(1 / (1.5 * w) * np.sin(3.0 * w) / np.cosh(x / 1.5))
    # The error of the differences in space, dx^2: measured 1.6e-3 at dx = 0.1.
    assert np.abs(found.y[-1][:400] - u).max() <= 5e-3


def test_random_starts_are_the_same_everywhere():
    # Python's own generator and sums only: these are the numbers on any machine.
    draws = starts.gaussians(1, 3)
    assert draws == starts.gaussians(1, 5)[:3]
    many = np.array(starts.gaussians(7, 20000))
    assert abs(many.mean()) < 0.03
    assert many.var() == pytest.approx(1.0, abs=0.03)
    assert draws == [-0.22337666337421247, -0.07542454607227089, -2.7232449236759697]
