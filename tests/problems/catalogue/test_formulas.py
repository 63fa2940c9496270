"""The equations of motion against a second derivation, written down independently of H."""

import numpy as np
import pytest

import problems
from problems import targets

STATES = 20


@pytest.fixture
def motion(states):
    """States and their derivatives, split into positions, momenta, and their rates."""

    def evaluate(problem):
        y = states(problem, STATES, seed=7)
        dy = targets.numpy(problem.system, "field")(0.0, y, problem.par)
        dof = problem.system.dof
        return y[:dof], y[dof:], dy[:dof], dy[dof:]

    return evaluate


def _close(a, b, tolerance=1e-12):
    # Two derivations differ by rounding: measured below 1e-13 of the largest component.
    a, b = np.asarray(a), np.asarray(b)
    assert np.abs(a - b).max() <= tolerance * np.abs(b).max()


def _newton(m, q, G=1.0, eps=0.0):
    """Accelerations of bodies q (n, dimension, states)."""
    rates = np.zeros_like(q)
    for i in range(len(q)):
        for j in range(len(q)):
            if i != j:
                gap = q[j] - q[i]
                rates[i] += G * m[j] * gap / (np.sum(gap**2, axis=0) + eps**2) ** 1.5
    return rates


@pytest.mark.parametrize(
    ("name", "arguments", "dimension"),
    [
        ("sitnikov", {}, 3),
        ("outer_solar_system", {}, 3),
        ("outer_solar_system", {"unit": "day"}, 3),
        ("solar_system", {}, 3),
        ("figure_eight", {}, 2),
        ("pythagorean", {}, 2),
        ("cluster", {"n": 4}, 3),
        ("cluster", {"n": 12}, 3),
    ],
)
def test_bodies_follow_newtons_law(motion, name, arguments, dimension):
    problem = problems.load(name, **arguments)
    q, p, dq, dp = motion(problem)
    values = {**problem.system.parameters}
    n = len(q) // dimension
    m = problem.par[:n]
    G = problem.par[n] if "G" in values else 1.0
    eps = problem.par[n] if "eps" in values else 0.0
    mass = np.repeat(m, dimension)[:, np.newaxis]
    _close(dq, p / mass)
    rates = _newton(m, q.reshape(n, dimension, -1), G, eps).reshape(q.shape)
    _close(dp, mass * rates)


def test_henon_heiles_has_its_force(motion):
    (x, y), p, dq, dp = motion(problems.load("henon_heiles"))
    _close(dq, p)
    _close(dp, [-x - 2 * x * y, -y - x**2 + y**2])


def test_kepler_pendulum_morse_and_diatomic_have_their_forces(motion):
    q, p, dq, dp = motion(problems.load("kepler"))
    _close(dp, -q / np.sum(q**2, axis=0) ** 1.5)
    q, p, dq, dp = motion(problems.load("pendulum"))
    _close(dp, -np.sin(q))
    _close(dq, p)
    q, p, dq, dp = motion(problems.load("morse", D=2.0, a=1.5, m=3.0))
    _close(dq, p / 3)
    _close(dp, -2 * 2.0 * 1.5 * (np.exp(-1.5 * q) - np.exp(-3.0 * q)))
    q, p, dq, dp = motion(problems.load("diatomic"))
    r = np.hypot(*q)
    pull = 2 * 4.0 * 2.0 * (1 - np.exp(-2 * (r - 1))) * np.exp(-2 * (r - 1))
    _close(dp, -pull * q / r)


def test_the_double_pendulum_obeys_its_lagrange_equations(motion):
    m1, m2, l1, l2, g = 1.3, 0.7, 0.9, 1.2, 2.0
    problem = problems.load("double_pendulum", m1=m1, m2=m2, l1=l1, l2=l2, g=g)
    q, p, dq, dp = motion(problem)
    d = q[0] - q[1]
    # p = K(q) q' with the mass matrix of L. D. Landau, E. M. Lifshitz, Mechanics, section 5, problem 1.
    _close(p[0], (m1 + m2) * l1**2 * dq[0] + m2 * l1 * l2 * np.cos(d) * dq[1], 1e-11)
    _close(p[1], m2 * l2**2 * dq[1] + m2 * l1 * l2 * np.cos(d) * dq[0], 1e-11)
    # dp/dt = dL/dq.
    twist = m2 * l1 * l2 * dq[0] * dq[1] * np.sin(d)
    _close(dp[0], -twist - (m1 + m2) * g * l1 * np.sin(q[0]), 1e-11)
    _close(dp[1], twist - m2 * g * l2 * np.sin(q[1]), 1e-11)


def test_the_restricted_problem_is_newtons_law_in_a_turning_frame(motion):
    problem = problems.load("cr3bp")
    q, p, dq, dp = motion(problem)
    mu = problem.par[0]
    v = p + np.array([q[1], -q[0]])
    _close(dq, v)
    r1, r2 = np.hypot(q[0] + mu, q[1]), np.hypot(q[0] - 1 + mu, q[1])
    earth, moon = np.array([[-mu], [0.0]]), np.array([[1 - mu], [0.0]])
    pull = -(1 - mu) * (q - earth) / r1**3 - mu * (q - moon) / r2**3
    # x'' = 2 y' + x + pull, y'' = -2 x' + y + pull; and p' = q'' + (-y', x').
    acceleration = np.array([2 * v[1], -2 * v[0]]) + q + pull
    _close(dp, acceleration + np.array([-v[1], v[0]]))


def test_a_charged_particle_feels_the_lorentz_force(motion):
    q, p, dq, dp = motion(problems.load("charged_particle"))
    r = np.hypot(*q)
    field = 0.01 * q / r**3
    v = p - np.array([-q[1], q[0]]) * r / 3
    _close(dq, v)
    # v' = E + v x B; p' = v' + dA/dt along the motion.
    lorentz = field + r * np.array([v[1], -v[0]])
    rate = np.sum(q * v, axis=0) / r
    drift = np.array([-q[1], q[0]]) * rate / 3 + np.array([-v[1], v[0]]) * r / 3
    _close(dp, lorentz + drift)


def test_a_penning_trap_feels_the_lorentz_force_and_its_multipoles(motion):
    problem = problems.load("penning_trap", omega_c=4.0, omega_z=1.5, c4=0.3)
    q, p, dq, dp = motion(problem)
    x, y, z = q
    v = np.array([p[0] + 2.0 * y, p[1] - 2.0 * x, p[2]])
    _close(dq, v)
    rho = x**2 + y**2
    side = 1.5**2 / 2 + 0.3 * (6 * z**2 - 1.5 * rho)
    electric = np.array([side * x, side * y, -(1.5**2) * z - 0.3 * (4 * z**3 - 6 * z * rho)])
    lorentz = electric + 4.0 * np.array([v[1], -v[0], 0 * v[0]])
    _close(dp, lorentz + 2.0 * np.array([-v[1], v[0], 0 * v[0]]))


def test_the_swinging_spring_hangs_and_pulls(motion):
    problem = problems.load("spring_pendulum", k=30.0, l0=0.6, g=9.0, m=1.5)
    q, p, dq, dp = motion(problem)
    r = np.sqrt(np.sum(q**2, axis=0))
    _close(dq, p / 1.5)
    _close(dp, -30.0 * (r - 0.6) * q / r - 1.5 * 9.0 * np.array([[0.0], [0.0], [1.0]]))
    rest = problems.load("spring_pendulum", x=0.0, z=0.0, vy=0.0)
    # The force at rest is a difference of two equal forces; measured: 0.
    assert np.abs(targets.numpy(rest.system, "field")(0.0, rest.y0, rest.par)).max() <= 1e-14


@pytest.mark.parametrize("n", [8, 100])
def test_chains_pull_on_their_neighbours(motion, n):
    q, p, dq, dp = motion(problems.load("fput", n=n, alpha=0.3, beta=0.7))
    r = np.diff(np.vstack([0 * q[:1], q, 0 * q[:1]]), axis=0)
    pull = r + 0.3 * r**2 + 0.7 * r**3
    _close(dq, p)
    _close(dp, np.diff(pull, axis=0))
    q, p, dq, dp = motion(problems.load("toda", n=n))
    push = np.exp(q - np.roll(q, -1, axis=0))
    _close(dp, np.roll(push, 1, axis=0) - push)
    problem = problems.load("sine_gordon", n=n, length=20.0)
    q, p, dq, dp = motion(problem)
    second = (np.roll(q, -1, axis=0) - 2 * q + np.roll(q, 1, axis=0)) * (n / 20.0) ** 2
    _close(dp, second - np.sin(q))
    problem = problems.load("nonlinear_wave", n=n, mass=0.5, kappa=2.0)
    q, p, dq, dp = motion(problem)
    second = (np.roll(q, -1, axis=0) - 2 * q + np.roll(q, 1, axis=0)) * (n / (2 * np.pi)) ** 2
    _close(dp, second - 0.5 * q - 2.0 * q**3)


def test_the_stiff_chain_is_the_books_chain_in_scaled_coordinates(motion):
    problem = problems.load("stiff_chain", omega=30.0)
    x, y, dx, dy = motion(problem)
    # Positions u_1 .. u_6 of the masses: x_i = (u_2i + u_2i-1)/sqrt 2, x_{3+i} = (u_2i - u_2i-1)/sqrt 2;
    # H = 1/2 sum u'^2 + omega^2/4 sum (u_2i - u_2i-1)^2 + sum of the soft lengths to the fourth.
    odd, even = (x[:3] - x[3:]) / np.sqrt(2), (x[:3] + x[3:]) / np.sqrt(2)
    wall = 0 * odd[:1]
    soft = np.vstack([odd, wall]) - np.vstack([wall, even])
    stiff = even - odd
    force_odd = -4 * soft[:-1] ** 3 + 30.0**2 / 2 * stiff
    force_even = 4 * soft[1:] ** 3 - 30.0**2 / 2 * stiff
    _close(dx, y)
    _close(dy[:3], (force_even + force_odd) / np.sqrt(2), 1e-11)
    _close(dy[3:], (force_even - force_odd) / np.sqrt(2), 1e-11)


@pytest.mark.parametrize("rings", [1, 2])
def test_atoms_feel_the_lennard_jones_force(motion, rings):
    problem = problems.load("lennard_jones", rings=rings)
    q, p, dq, dp = motion(problem)
    m, eps, sigma = problem.par
    place = q.reshape(-1, 2, STATES)
    force = np.zeros_like(place)
    for i in range(len(place)):
        for j in range(len(place)):
            if i != j:
                gap = place[i] - place[j]
                r = np.hypot(*gap)
                force[i] += 24 * eps * (2 * (sigma / r) ** 12 - (sigma / r) ** 6) * gap / r**2
    _close(dq, p / m)
    _close(dp, force.reshape(q.shape))


def test_poisson_systems_have_their_equations(states):
    problem = problems.load("lotka_volterra")
    y = states(problem, STATES)
    dy = targets.numpy(problem.system, "field")(0.0, y, problem.par)
    a, b, c, nu, mu = problem.par
    species = [
        y[0] * (c * y[1] + c * nu) + b * c * y[0] * y[2] * (-a) - b * c * y[0] * mu,
        -c * a * b * y[0] * y[1] + a * y[1] * y[2] + mu * y[1],
        -b * c * a * b * y[0] * y[2] + y[1] * y[2] + nu * y[2],
    ]
    _close(dy, species)
    problem = problems.load("rigid_body", quartic=0.4)
    y = states(problem, STATES)
    dy = targets.numpy(problem.system, "field")(0.0, y, problem.par)
    omega = y / np.array([[2.0], [1.0], [2 / 3]]) + 0.4 * y**3
    _close(dy, np.cross(y, omega, axis=0))


def test_the_planar_quintic_is_the_papers(motion):
    (q,), (p,), (dq,), (dp,) = motion(problems.load("period_annulus"))
    # H = p^2/2 + p^4 + (p^2 + p^4) q + (1/2 + p + p^2) q^2 for the paper's coefficients.
    _close(dq, p + 4 * p**3 + (2 * p + 4 * p**3) * q + (1 + 2 * p) * q**2)
    _close(dp, -(p**2 + p**4) - (1 + 2 * p + 2 * p**2) * q)


def test_energies_are_the_published_ones():
    # E. Hairer, C. Lubich, G. Wanner, section I.4: -1260.2 k_B and the temperature 22.72 K.
    argon = problems.load("lennard_jones")
    assert argon.invariants(argon.y0)["energy"] == pytest.approx(-1260.2, abs=0.05)
    v = argon.velocity(argon.y0)[0]
    assert argon.par[0] * np.sum(v**2) / (2 * 7) == pytest.approx(22.72, abs=0.005)
    # The potential of the 3-4-5 triangle: 12/5 + 15/4 + 20/3.
    pythagorean = problems.load("pythagorean")
    assert pythagorean.invariants(pythagorean.y0)["energy"] == pytest.approx(-769 / 60, rel=1e-15)
    assert problems.load("sitnikov").invariants(problems.load("sitnikov").y0)["energy"][0] == -0.17500675
