"""Orbital elements, against REBOUND's and against the states that they were made from."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest

from integrators import HBVM, integrate, integrate_many, load
from problems import InputError, nbody
from problems.bodies import Elements, Orbit, PostNewtonian, Units, bodies_of, elements, starts
from problems.bodies.orbits import elements_of

rebound = pytest.importorskip("rebound")
N = 10_000
GIANTS = [Orbit(a=5.2, e=0.05, inc=0.02, Omega=1.7, omega=4.8, M=0.3), Orbit(a=9.5, e=0.06, f=1.0)]
MASSES, NAMES = [1.0, 9.5e-4, 2.9e-4], ["Sun", "Jupiter", "Saturn"]


def _random() -> tuple[Orbit, np.ndarray]:
    """Return orbits, 30 % of them hyperbolic, 500 circular and 1,000 planar, half of these retrograde."""
    rng = np.random.default_rng(1)
    e = np.where(rng.random(N) < 0.3, 1.0 + rng.exponential(1.0, N), rng.random(N))
    e[:500] = 0.0
    a = np.where(e < 1.0, 1.0, -1.0) * 10.0 ** rng.uniform(-2.0, 2.0, N)
    inc = np.arccos(rng.uniform(-1.0, 1.0, N))
    inc[250:750], inc[750:1250] = 0.0, np.pi
    Omega, omega = rng.uniform(0.0, 2.0 * np.pi, (2, N))
    M = np.where(e < 1.0, rng.uniform(-np.pi, np.pi, N), rng.normal(0.0, 5.0, N))
    return Orbit(a=a, e=e, inc=inc, Omega=Omega, omega=omega, M=M), 10.0 ** rng.uniform(-6.0, 0.0, N)


def _relative(a: np.ndarray, b: np.ndarray) -> float:
    return float((np.linalg.norm(a - b, axis=1) / np.linalg.norm(b, axis=1)).max())


def _apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(np.angle(np.exp(1j * (a - b))))


def test_ten_thousand_random_orbits_are_those_of_rebound():
    orbit, m = _random()
    x, v = orbit.state(1.0 + m)
    words = ("a", "e", "inc", "Omega", "omega", "M")
    columns = np.stack([np.asarray(getattr(orbit, word)) for word in words], axis=1)
    theirs, states = np.empty((N, 8)), np.empty((N, 6))
    for i, (mass, row) in enumerate(zip(m, columns.tolist(), strict=True)):
        simulation = rebound.Simulation()
        simulation.add(m=1.0)
        simulation.add(m=mass, **dict(zip(words, row, strict=True)))
        planet = simulation.particles[1]
        states[i] = [*planet.xyz, *planet.vxyz]
        planet.xyz, planet.vxyz = x[i].tolist(), v[i].tolist()
        o = planet.orbit(primary=simulation.particles[0])
        theirs[i] = o.a, o.e, o.inc, o.Omega, o.omega, o.f, o.M, o.theta
    # REBOUND goes through the true anomaly and loses digits near e = 1; for ours see the next test
    far = np.abs(np.asarray(orbit.e) - 1.0) > 1e-5  # all but one
    assert far.sum() > N - 3
    assert _relative(x[far], states[far, :3]) < 1e-12  # measured 4e-13
    assert _relative(v[far], states[far, 3:]) < 1e-12  # measured 3e-13
    ours = elements_of(x, v, 1.0 + m)
    assert np.abs(ours.a / theirs[:, 0] - 1.0).max() < 1e-12  # measured 2e-15
    assert np.abs(ours.e - theirs[:, 1]).max() < 1e-12  # measured 9e-15
    assert np.abs(ours.inc - theirs[:, 2]).max() < 1e-12  # measured 2e-14
    # REBOUND has angles from their cosines, which lose digits near 0 and pi, and angles of rounding errors
    # where the plane is that of the axes or the orbit a circle: only their sum is compared there
    generic = slice(1250, None)
    for angle, column in ((ours.Omega, 3), (ours.omega, 4)):
        loss = np.abs(np.sin(theirs[:, column])) * np.minimum(
            ours.e, 1.0
        )  # of a circle there is no pericentre
        assert (_apart(angle, theirs[:, column]) * loss)[generic].max() < 1e-12  # measured 3e-15
    # one of REBOUND's f is wrong by 2e-12, by 40 digits, and this one of ours by 2e-16
    away = _apart(ours.f, theirs[:, 5]) * np.abs(np.sin(theirs[:, 5])) * np.minimum(ours.e, 1.0)
    assert np.sort(away[generic])[-2] < 1e-12  # measured 3e-13
    bound = (ours.e < 1.0) & (ours.e > 0.01)
    bound[:1250] = False
    loss = np.abs(np.sin(theirs[:, 5]))  # REBOUND's M turns 2 pi for hyperbolas too
    assert (_apart(ours.M, theirs[:, 6])[bound] * loss[bound]).max() < 1e-12
    prograde = slice(0, 750)
    pomega = ours.Omega + ours.omega + ours.f
    theirs_pomega = theirs[:, 3] + theirs[:, 4] + theirs[:, 5]
    assert _apart(pomega, theirs_pomega)[prograde].max() < 1e-7  # by its cosines


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_nearly_parabolic_orbits_are_right_to_rounding(side):
    rng = np.random.default_rng(2)
    for near in np.geomspace(1e-9, 1e-2, 40):
        e, a, M = 1.0 + side * near, -side, float(rng.normal(0.0, 1.0 if side < 0.0 else 5.0))
        x, _ = Orbit(a=a, e=e, M=M).state(1.0)
        with mpmath.workdps(40):
            if side > 0.0:
                H = mpmath.findroot(lambda H, e=e, M=M: e * mpmath.sinh(H) - H - M, mpmath.asinh(6.0 * M))
                r = e * mpmath.cosh(H) - 1.0
            else:
                E = mpmath.findroot(lambda E, e=e, M=M: E - e * mpmath.sin(E) - M, M + np.sign(M))
                r = 1.0 - e * mpmath.cos(E)
            assert abs(np.linalg.norm(x) / r - 1.0) < 1e-14  # measured 2e-15


def test_elements_are_those_that_the_states_were_made_of():
    orbit, m = _random()
    x, v = orbit.state(1.0 + m)
    ours = elements_of(x, v, 1.0 + m)
    again = Orbit(**{word: getattr(ours, word) for word in ("a", "e", "inc", "Omega", "omega", "M")})
    back, speed = again.state(1.0 + m)
    assert _relative(back, x) < 1e-12  # measured 3e-13
    assert _relative(speed, v) < 1e-12
    assert np.abs(ours.e[:500]).max() < 2e-15
    assert (ours.omega[:500] == 0.0).all()
    assert (ours.Omega[250:1250] == 0.0).all()
    generic = np.asarray(orbit.e) > 0.01
    generic[:1250] = False
    given = np.asarray(orbit.M)
    away = np.abs(ours.M - given) / np.maximum(np.abs(given), 1.0)
    near = np.abs(np.asarray(orbit.e) - 1.0)  # parabolas have no M
    assert (away * near)[generic].max() < 1e-12


def test_anomalies_are_three_names_for_one_place():
    mu, t = 1.7, 3.0
    for a, e, M in ((2.0, 0.3, 0.8), (-1.5, 2.2, -3.0)):
        x, v = Orbit(a=a, e=e, inc=0.4, M=M).state(mu, t)
        found = elements_of(x, v, mu, t)
        for name in ("f", "T"):
            other = Orbit(a=a, e=e, inc=0.4, **{name: getattr(found, name)}).state(mu, t)
            assert np.allclose(other, (x, v), rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("primary", [0, "jacobi", "barycentric"])
def test_bodies_from_elements_have_them_and_rest_as_a_whole(primary):
    given = [replace(orbit, f=None, M=0.7, primary=primary) for orbit in GIANTS]
    problem = nbody(MASSES, orbits=given, unit="au, yr, Msun", names=NAMES, t_end=100.0)
    masses, x, v = bodies_of(problem)
    assert np.abs(masses @ x).max() < 1e-17
    assert np.abs(masses @ v).max() < 1e-17
    for name, orbit in zip(NAMES[1:], given, strict=True):
        found = elements(problem, body=name, primary=primary)
        for word in ("a", "e", "inc", "M"):
            assert float(getattr(found, word)) == pytest.approx(getattr(orbit, word), rel=1e-13, abs=1e-14)


def test_primaries_may_be_mixed():
    moon = Orbit(a=0.01, e=0.1, inc=0.3, primary="Jupiter")
    jupiter = Orbit(a=5.2, e=0.05, primary="barycentric")
    problem = nbody([1.0, 1e-3, 1e-8], orbits=[jupiter, moon], names=["Sun", "Jupiter", "moon"], t_end=1.0)
    masses, x, _ = bodies_of(problem)
    assert np.abs(masses @ x).max() < 1e-17
    assert float(elements(problem, body="moon", primary="Jupiter").e) == pytest.approx(0.1, rel=1e-12)
    assert float(elements(problem, body="Jupiter", primary="barycentric").a) == pytest.approx(5.2, rel=1e-14)


def test_elements_of_a_solution_are_arrays_and_those_of_rebound(tmp_path):
    problem = nbody(MASSES, orbits=GIANTS, unit="au, yr, Msun", names=NAMES, t_end=60.0)
    solution = integrate(problem, HBVM(), np.linspace(0.0, 60.0, 7))
    found = solution.elements("Saturn", "jacobi")
    assert isinstance(found, Elements)
    assert all(part.shape == (7,) for part in found)
    simulation = rebound.Simulation()
    simulation.G, simulation.integrator = Units("au, yr, Msun").G, "ias15"
    masses, x, v = bodies_of(problem)
    for mass, place, speed in zip(masses, x.tolist(), v.tolist(), strict=True):
        simulation.add(m=mass, **dict(zip(("x", "y", "z", "vx", "vy", "vz"), place + speed, strict=True)))
    simulation.integrate(60.0)
    orbit = simulation.particles[2].orbit()
    assert found.a[-1] == pytest.approx(orbit.a, rel=1e-12)  # measured 6e-16
    assert found.e[-1] == pytest.approx(orbit.e, rel=1e-12)  # 3e-15
    path = tmp_path / "giants.npz"
    solution.save(path)
    assert load(path).elements("Saturn", "jacobi").a.tolist() == found.a.tolist()
    assert problem.replace(t_end=3.0).bodies == tuple(NAMES)


def test_momenta_of_relativity_have_elements_too():
    problem = nbody(MASSES[:2], orbits=GIANTS[:1], forces=[PostNewtonian(c=30.0)], t_end=1.0)
    assert problem.system.dof == 6
    assert float(elements(problem, body=1).e) == pytest.approx(0.05, rel=1e-12)
    rows = starts(problem, 1, Orbit(a=[4.0, 5.0], e=0.2))
    assert elements(problem, rows, body=1).e == pytest.approx([0.2, 0.2], rel=1e-12)


def test_starts_put_one_body_on_many_orbits_and_leave_the_others():
    problem = nbody(MASSES, orbits=[*GIANTS, Orbit(a=3.0)], massless=1, t_end=10.0)
    a, e = np.linspace(2.0, 4.0, 3)[:, np.newaxis], np.linspace(0.0, 0.3, 2)
    rows = starts(problem, -1, Orbit(a=a, e=e, inc=0.1))
    found = elements(problem, rows, body=3)
    assert found.a == pytest.approx(np.repeat(a, 2), rel=1e-14)
    assert found.e == pytest.approx(np.tile(e, 3), abs=1e-14)
    assert np.array_equal(rows[:, :9], np.tile(problem.y0[:9], (6, 1)))
    for primary in ("jacobi", "barycentric", 1):
        heavy = starts(problem, 2, Orbit(a=7.0, e=[0.1, 0.2], primary=primary))
        assert elements(problem, heavy, body=2, primary=primary).e == pytest.approx([0.1, 0.2], rel=1e-12)


def test_five_hundred_test_particles_are_one_call():
    rng = np.random.default_rng(0)
    r, angle = rng.uniform(0.3, 1.0, 500), rng.uniform(0.0, 2.0 * np.pi, 500)
    x = np.stack([r * np.cos(angle), r * np.sin(angle), 0.0 * r], axis=1)
    v = np.stack([-np.sin(angle) / np.sqrt(r), np.cos(angle) / np.sqrt(r), 0.0 * r], axis=1)
    galaxies, speeds = [[0, 0, 0], [5, 2, 0]], [[0, 0, 0], [-0.6, 0, 0]]
    with pytest.raises(InputError, match=r"massless=1, .* starts=problems\.bodies\.starts"):
        nbody([1.0, 1.0], [*galaxies, *x], [*speeds, *v], massless=500, softening=0.05, t_end=20.0)
    problem = nbody([1.0, 1.0], [*galaxies, x[0]], [*speeds, v[0]], massless=1, softening=0.05, t_end=20.0)
    made = integrate_many(problem, HBVM(tol=1e-8), starts=starts(problem, -1, x, v))
    assert made.arrived.all()
    few = nbody([1.0, 1.0], [*galaxies, *x[:3]], [*speeds, *v[:3]], massless=3, softening=0.05, t_end=20.0)
    together = integrate(few, HBVM(tol=1e-10), [20.0]).y[0, 6:15].reshape(3, 3)
    assert np.abs(made.y[:3, 0, 6:9] - together).max() < 1e-5  # measured 2e-7


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Orbit(a=1.0, e=1.2), "do not go together"),
        (lambda: Orbit(a=1.0, e=1.0), "parabolas"),
        (lambda: Orbit(a=1.0, M=0.1, f=0.2), "one of f, M and T"),
        (lambda: Orbit(a=-1.0, e=2.0, f=2.2), "asymptotes"),
        (lambda: Orbit(a=[1.0, 2.0], e=[0.1, 0.2, 0.3]), "shapes that fit"),
        (lambda: Orbit(a="one"), "finite numbers"),
        (lambda: Units("au, yr"), "one mass"),
        (lambda: Units("au, year, Msun"), "did you mean 'yr'|unknown unit 'year'"),
        (lambda: nbody([1.0], t_end=1.0), "positions and velocities, or orbits"),
        (lambda: nbody([1.0, 0.1], orbits=[], t_end=1.0), "there are 1 bodies besides"),
        (lambda: nbody([1.0, 0.1], orbits=[Orbit(a=1.0, primary=1)], t_end=1.0), "give that one before"),
        (lambda: nbody([1.0, 0.1], orbits=[Orbit(a=1.0, primary="Sol")], t_end=1.0), "no body 'Sol'"),
        (
            lambda: nbody(
                [1.0, 0.1], orbits=[Orbit(a=1.0, primary="barycenter")], names=["Sun", "Jupiter"], t_end=1.0
            ),
            "did you mean 'barycentric'",
        ),
        (lambda: nbody([1.0, 0.1], orbits=[Orbit(a=[1.0, 2.0])], t_end=1.0), "has arrays"),
        (lambda: nbody([1.0, 0.1], orbits=[Orbit(a=1.0)], names=["a"], t_end=1.0), "2 different names"),
        (
            lambda: nbody([1.0, 0.1], orbits=[Orbit(a=1.0)], unit="au, yr, Msun", G=1.0, t_end=1.0),
            "leave out G=1.0",
        ),
    ],
)
def test_what_cannot_be_is_told_in_a_sentence(call, words):
    with pytest.raises(InputError, match=words):
        call()
