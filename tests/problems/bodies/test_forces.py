"""Forces between bodies: each against an analytic rate, or its formula with 40 digits."""

import math

import mpmath
import numpy as np
import pytest

from integrators import HBVM, integrate, integrate_many
from problems import InputError, nbody, targets
from problems.bodies import (
    J2,
    Migration,
    Orbit,
    PostNewtonian,
    RadiationPressure,
    Tides,
    Units,
    Zonal,
    elements,
    starts,
)

MERCURY = Orbit(a=0.38709893, e=0.20563069, inc=0.1223, Omega=0.8435, omega=0.5083)
ARCSECONDS = 180.0 * 3600.0 / np.pi


@pytest.mark.parametrize("body", [None, 0], ids=["of all bodies", "of the Sun"])
@pytest.mark.parametrize("massless", [0, 1])
def test_mercury_advances_by_43_arcseconds_a_century(body, massless):
    problem = nbody(
        [1.0] if massless else [1.0, 1.66e-7], orbits=[MERCURY], massless=massless,
        forces=[PostNewtonian(body=body)], unit="au, yr, Msun", t_end=100.0,
    )  # fmt: skip
    assert (problem.system.dof is None) == (massless == 1 or body == 0)
    # the osculating pericentre has a periodic part; the mean over whole orbits does not
    period = float(MERCURY.a) ** 1.5 * 2.0 * np.pi / np.sqrt(Units("au, yr, Msun").G)
    times = np.arange(1, 8 * 400) * period / 8.0
    omega = np.unwrap(integrate(problem, HBVM(), times).elements(1).omega)
    rate = np.polyfit(times, omega, 1)[0] * 100.0 * ARCSECONDS
    assert rate == pytest.approx(42.98, abs=0.01)  # measured 42.981


@pytest.mark.parametrize("degree", [2, 4, 6])
def test_the_node_of_a_circular_orbit_moves_as_legendre_says(degree):
    # the mean of P_n(sin i sin u) over the orbit is P_n(0) P_n(cos i)
    J, R, inc = 1e-5, 0.5, 0.7
    polynomial = np.polynomial.Legendre.basis(degree)
    wanted = J * R**degree * polynomial(0.0) * polynomial.deriv()(math.cos(inc))
    problem = nbody(
        [1.0],
        orbits=[Orbit(a=1.0, inc=inc)],
        massless=1,
        forces=[Zonal(R=R, **{f"J{degree}": J})],
        t_end=630.0,
    )
    times = 2.0 * np.pi / 16.0 * np.arange(1, 16 * 100)
    node = np.unwrap(integrate(problem, HBVM(), times).elements(1).Omega)
    assert np.polyfit(times, node, 1)[0] == pytest.approx(wanted, rel=1e-4)  # measured 2e-5, 3e-6, 2e-5


def test_zonal_harmonics_are_the_gradient_of_their_potential_about_any_pole():
    J = {"J2": 0.02, "J3": -0.03, "J4": 0.01, "J5": 0.04, "J6": -0.02}
    pole, R, x = np.array([1.0, 2.0, -0.5]), 0.6, np.array([0.7, -0.2, 0.9])
    problem = nbody(
        [1.0],
        [[0.0] * 3, x],
        [[0.0] * 3, [0.0] * 3],
        massless=1,
        forces=[Zonal(R=R, **J, pole=pole)],
        t_end=1.0,
    )
    found = targets.numpy(problem.system, "field")(0.0, problem.y0, problem.par)[9:12]
    with mpmath.workdps(40):
        axis = [
            mpmath.mpf(float(c)) / mpmath.sqrt(sum(mpmath.mpf(float(c)) ** 2 for c in pole)) for c in pole
        ]

        def potential(*place):
            r = mpmath.sqrt(sum(c * c for c in place))
            u = sum(a * c for a, c in zip(axis, place, strict=True)) / r
            shape = sum(
                mpmath.mpf(value) * (mpmath.mpf(R) / r) ** n * mpmath.legendre(n, u)
                for n, value in enumerate(J.values(), start=2)
            )
            return (1 - shape) / r

        point = tuple(mpmath.mpf(float(c)) for c in x)
        wanted = [
            float(mpmath.diff(potential, point, tuple(int(axis_ == c) for axis_ in range(3))))
            for c in range(3)
        ]
    assert found == pytest.approx(wanted, rel=1e-14)  # measured 2e-16


def test_zonal_harmonics_of_two_masses_conserve_energy_in_both_forms():
    forces = [Zonal(R=0.3, J3=0.05, J5=0.02, pole=(1.0, 1.0, 1.0)), J2(J2=0.01, R=0.2, body=1)]
    pair = nbody([1.0, 0.4], orbits=[Orbit(a=1.0, e=0.2, inc=0.4)], forces=forces, t_end=30.0)
    assert integrate(pair, HBVM()).errors()["energy"].max() < 1e-14  # measured 4e-16
    with_particle = nbody(
        [1.0, 0.4],
        orbits=[Orbit(a=1.0, e=0.2, inc=0.4), Orbit(a=50.0)],
        massless=1,
        forces=forces,
        t_end=30.0,
    )
    ends = [integrate(one, HBVM(), [30.0]) for one in (pair, with_particle)]
    assert ends[1].y[0, :6] == pytest.approx(ends[0].q[0], abs=1e-12)  # measured 2e-15


def test_poynting_robertson_drag_takes_a_dust_grain_to_the_sun_in_its_time():
    # a circular orbit: a^2 = a_0^2 - 4 beta G M t/c (Burns, Lamy, Soter 1979)
    units, beta = Units("au, yr, Msun"), 0.2
    end = 0.5 / (4.0 * beta * units.G / units.c)
    mu = units.G * (1.0 - beta)
    problem = nbody(
        [1.0], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, np.sqrt(mu), 0]], massless=1,
        forces=[RadiationPressure(beta=beta)], unit="au, yr, Msun", t_end=end,
    )  # fmt: skip
    y = integrate(problem, HBVM(tol=1e-10), [end / 2.0, end]).y
    r = np.linalg.norm(y[:, 3:6], axis=1)
    assert r**2 == pytest.approx([0.75, 0.5], rel=2e-4)  # measured 6e-5: v/c is not 0
    without = nbody(
        [1.0], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, np.sqrt(mu), 0]], massless=1,
        forces=[RadiationPressure(beta=beta, drag=False)], unit="au, yr, Msun", t_end=end,
    )  # fmt: skip
    r = np.linalg.norm(integrate(without, HBVM(tol=1e-10), [50.0]).y[0, 3:6])
    assert r == pytest.approx(1.0, abs=1e-10)  # measured 9e-13: gravity, but less of it


def test_tides_shrink_a_circular_orbit_as_mignard_and_hut_say():
    # without spin: d(a^8)/dt = -48 k2 tau G m (m + M)/M R^5
    k2, R, tau, m, end = 0.3, 0.1, 0.05, 0.2, 3e4
    problem = nbody([1.0, m], orbits=[Orbit(a=1.0)], forces=[Tides(k2=k2, R=R, tau=tau)], t_end=end)
    found = integrate(problem, HBVM(tol=1e-10), [end / 2.0, end])
    wanted = 1.0 - 48.0 * k2 * tau * m * (1.0 + m) * R**5 * found.t
    distance = np.linalg.norm(found.y[:, 3:6] - found.y[:, :3], axis=1)
    assert distance**8 == pytest.approx(wanted, rel=2e-4)  # measured 3e-5
    total = (np.array([1.0, m])[:, np.newaxis] * found.y[-1, 6:].reshape(2, 3)).sum(axis=0)
    assert np.abs(total).max() < 1e-12  # the momentum, measured 1e-15


def test_tides_vanish_where_the_spin_is_that_of_a_circular_orbit():
    spin = np.sqrt(1.2)
    forces = [[Tides(k2=0.3, R=0.1, tau=tau, Omega=(0.0, 0.0, spin))] for tau in (0.0, 0.05)]
    # the bulge adds to the attraction: at this distance the orbit is circular with that spin
    ends = [
        integrate(nbody([1.0, 0.2], orbits=[Orbit(a=1.0)], forces=force, t_end=2e3), HBVM(), [2e3]).elements(
            1
        )
        for force in forces
    ]
    assert abs(ends[1].a[0] - ends[0].a[0]) < 1e-7  # measured 2e-9; without spin 4e-4


def test_migration_has_the_decay_times_that_it_is_given():
    def ends(a=1.0, e=0.0, inc=0.0, **times):
        problem = nbody(
            [1.0], orbits=[Orbit(a=a, e=e, inc=inc)], massless=1, forces=[Migration(**times)], t_end=1000.0
        )
        return integrate(problem, HBVM(tol=1e-10), [1000.0]).elements(1)

    assert ends(tau_a=2000.0).a[0] == pytest.approx(math.exp(-0.5), rel=1e-6)  # measured 8e-8
    assert ends(e=0.01, tau_e=1000.0).e[0] == pytest.approx(0.01 * math.exp(-1.0), rel=1e-3)  # 5e-4
    assert ends(inc=0.01, tau_inc=1000.0).inc[0] == pytest.approx(0.01 * math.exp(-1.0), rel=1e-3)  # 4e-4
    assert ends(tau_a=-2000.0).a[0] == pytest.approx(math.exp(0.5), rel=1e-5)


def test_forces_go_through_lanes_with_many_particles():
    forces = [
        J2(J2=1e-3, R=0.1),
        PostNewtonian(c=1e3, body=0),
        RadiationPressure(beta=0.01, bodies=[2], c=1e3),
    ]
    problem = nbody([1.0, 1e-3], orbits=[Orbit(a=1.0), Orbit(a=0.5)], massless=1, forces=forces, t_end=20.0)
    rows = starts(problem, -1, Orbit(a=np.linspace(0.3, 0.7, 20), e=0.05))
    made = integrate_many(problem, HBVM(tol=1e-10), starts=rows)
    assert made.arrived.all()
    alone = integrate(problem.replace(y0=rows[7]), HBVM(tol=1e-10), [20.0])
    assert made.y[7, 0] == pytest.approx(alone.y[0], abs=1e-8)  # measured 5e-11
    assert elements(problem, made.y[:, 0], body=2).a.shape == (20,)


@pytest.mark.parametrize(
    ("force", "words"),
    [
        (lambda: PostNewtonian(), r"needs c=, or unit="),
        (lambda: RadiationPressure(beta=0.1), r"needs c=, or unit="),
        (lambda: RadiationPressure(beta=[0.1, 0.2, 0.3], c=1.0), "3 values of beta for 2 bodies"),
        (lambda: Tides(k2=0.1, R=0.1, body=2), "none of the 2 bodies with masses"),
        (lambda: Migration(tau_a=1.0, body=7), "none of the 3 bodies"),
        (lambda: Migration(tau_a=0.0), "must be another time"),
        (lambda: Migration(body=0), "another one than primary"),
        (lambda: Zonal(R=0.1, J3=0.1, pole=(0, 0, 0)), "not all 0"),
        (lambda: Tides(k2=0.1, R=0.1, Omega=(1.0,)), "three numbers"),
        (lambda: "drag", "is no force"),
    ],
)
def test_what_is_no_force_is_told_in_a_sentence(force, words):
    with pytest.raises(InputError, match=words):
        nbody([1.0, 0.1], orbits=[Orbit(a=1.0), Orbit(a=2.0)], massless=1, forces=[force()], t_end=1.0)
