"""Bodies with forces between them, and what else acts on them."""

import doctest
from pathlib import Path

import mpmath
import numpy as np
import pytest

import problems
from integrators import HBVM, integrate
from problems import InputError, nbody, targets
from problems.bodies import J2, PostNewtonian

rng = np.random.default_rng(5)
X, V = rng.standard_normal((4, 3)), 0.3 * rng.standard_normal((4, 3))
MASSES = [1.0, 0.3, 0.02, 0.5]
OBLATE = J2(J2=0.02, R=0.4, body=1, pole=(1.0, 2.0, -0.5))


def _accelerations(problem: problems.Problem, n: int, *, h: float = 1e-5) -> np.ndarray:
    """Return dv/dt at the start, of momenta by differences of the velocities along the flow."""
    system = problem.system
    field = targets.numpy(system, "field")
    slope = field(0.0, problem.y0, problem.par)
    if system.dof is None:
        return slope[3 * n :].reshape(n, 3)
    sides = [field(0.0, problem.y0 + side * h * slope, problem.par)[: 3 * n] for side in (1.0, -1.0)]
    return ((sides[0] - sides[1]) / (2 * h)).reshape(n, 3)


def test_newton_is_the_one_of_the_catalogue():
    known = problems.load("outer_solar_system")
    n, par = 6, known.system.unpack(known.par)
    v = known.velocity(known.y0[None])
    made = nbody(par["m"], known.y0[:18].reshape(n, 3), v.reshape(n, 3), G=par["G"], t_end=known.t_end)
    assert np.array_equal(made.y0[:18], known.y0[:18])
    assert made.system.bodies == known.system.bodies
    fields = [targets.numpy(one.system, "field")(0.0, known.y0, known.par) for one in (made, known)]
    assert np.array_equal(*fields)


@pytest.mark.parametrize("forces", [(), (OBLATE,)], ids=["newton", "J2"])
@pytest.mark.parametrize("softening", [None, 0.1])
def test_both_ways_to_write_it_give_the_same_accelerations(forces, softening):
    options = {"G": 1.3, "softening": softening, "t_end": 1.0}
    energy = nbody(MASSES, X, V, forces=forces, **options)
    nothing = lambda x: [[0.0, 0.0, 0.0] for _ in x]  # noqa: E731 -- makes it a VectorField
    field = nbody(MASSES, X, V, forces=[*forces, nothing], **options)
    assert energy.system.dof == 12
    assert field.system.dof is None
    # differences: measured 2e-9
    assert _accelerations(energy, 4) == pytest.approx(_accelerations(field, 4), rel=1e-7, abs=1e-8)


def test_j2_is_the_formula_of_the_books():
    x, k = np.array([0.7, -0.2, 0.9]), 1e-3 * 0.5**2
    orbit = nbody(
        [1.0], [[0.0] * 3, x], [[0.0] * 3, V[0]], massless=1, forces=[J2(J2=1e-3, R=0.5)], t_end=1.0
    )
    r = np.linalg.norm(x)
    z = (x[2] / r) ** 2
    wanted = -x / r**3 * (1 + 1.5 * k / r**2 * (np.array([1.0, 1.0, 3.0]) - 5 * z))
    assert _accelerations(orbit, 2)[1] == pytest.approx(wanted, rel=1e-14)
    assert _accelerations(orbit, 2)[0].tolist() == [0.0, 0.0, 0.0]


def test_massless_bodies_are_pulled_and_do_not_pull():
    with_them = nbody(MASSES[:2], X, V, massless=2, t_end=3.0)
    alone = nbody(MASSES[:2], X[:2], V[:2], t_end=3.0)
    light = nbody([*MASSES[:2], 1e-18, 1e-18], X, V, t_end=3.0)
    times = [1.0, 3.0]
    found = integrate(with_them, HBVM(), times).y
    assert found[:, :6] == pytest.approx(integrate(alone, HBVM(), times).q, abs=1e-12)  # measured 3e-14
    assert found[:, :12] == pytest.approx(integrate(light, HBVM(), times).q, abs=1e-12)  # 3e-15


def test_the_pericentre_of_general_relativity():
    c, e = 100.0, 0.3
    pair = nbody(
        [1.0, 1e-8], [[0, 0, 0], [1 - e, 0, 0]], [[0, 0, 0], [0, np.sqrt((1 + e) / (1 - e)), 0]],
        forces=[PostNewtonian(c=c)], t_end=2 * np.pi * 20,
    )  # fmt: skip
    solution = integrate(pair, HBVM(), np.linspace(0.0, 2 * np.pi * 20, 20001))
    errors = solution.errors()
    assert errors["energy"].max() < 1e-13  # measured 2e-15
    assert errors["angular_momentum"].max() < 1e-13
    x = solution.q[:, 3:6] - solution.q[:, :3]
    r = np.linalg.norm(x, axis=1)
    inner = np.flatnonzero((r[1:-1] < r[:-2]) & (r[1:-1] < r[2:])) + 1
    left, middle, right = r[inner - 1], r[inner], r[inner + 1]
    step = 0.5 * (left - right) / (left - 2 * middle + right)
    angle = np.unwrap(np.arctan2(x[:, 1], x[:, 0]))
    at = np.interp(inner + step, np.arange(angle.size), angle)
    advance = np.polyfit(np.arange(at.size), at, 1)[0] - 2 * np.pi
    assert advance == pytest.approx(
        6 * np.pi / (c**2 * (1 - e**2)), rel=0.01
    )  # next order in 1/c^2; measured 2e-3


def test_velocities_are_those_that_were_given():
    bodies = nbody(MASSES, X, V, forces=[PostNewtonian(c=10.0)], t_end=1.0)
    v = targets.numpy(bodies.system, "field")(0.0, bodies.y0, bodies.par)[:12]
    assert v == pytest.approx(V.reshape(-1), abs=1e-15)
    assert np.abs(bodies.y0[12:] - np.repeat(MASSES, 3) * V.reshape(-1)).max() > 1e-4


def test_relativity_conserves_what_it_should():
    bodies = nbody(MASSES, X, V, forces=[PostNewtonian(c=30.0)], softening=None, t_end=2.0)
    errors = integrate(bodies, HBVM(), [0.5, 1.0]).errors()
    assert {"energy", "linear_momentum", "angular_momentum"} == {*errors}
    assert max(error.max() for error in errors.values()) < 1e-12  # measured 6e-15


def _post_newtonian(masses: list[float], x: np.ndarray, v: np.ndarray, c: float) -> np.ndarray:
    """Return the accelerations of Einstein, Infeld and Hoffmann with 40 digits, written as in the books."""
    with mpmath.workdps(40):
        mu = [mpmath.mpf(mass) for mass in masses]
        x, v = (np.vectorize(mpmath.mpf, otypes=[object])(rows) for rows in (x, v))
        n = len(mu)
        r = {(a, b): mpmath.sqrt(sum((x[a] - x[b]) ** 2)) for a in range(n) for b in range(n) if a != b}
        others = {a: [b for b in range(n) if b != a] for a in range(n)}
        newton = [sum(mu[b] * (x[b] - x[a]) / r[a, b] ** 3 for b in others[a]) for a in range(n)]
        made = []
        for a in range(n):
            total = newton[a]
            for b in others[a]:
                normal = (x[a] - x[b]) / r[a, b]
                bracket = (
                    v[a] @ v[a] + 2 * (v[b] @ v[b]) - 4 * (v[a] @ v[b]) - 3 * (normal @ v[b]) ** 2 / 2
                    - 4 * sum(mu[k] / r[a, k] for k in others[a])
                    - sum(mu[k] / r[b, k] for k in others[b])
                    + (x[b] - x[a]) @ newton[b] / 2
                )  # fmt: skip
                added = (
                    -mu[b] * normal / r[a, b] ** 2 * bracket
                    + mu[b] / r[a, b] ** 2 * (normal @ (4 * v[a] - 3 * v[b])) * (v[a] - v[b])
                    + mpmath.mpf(7) / 2 * mu[b] * newton[b] / r[a, b]
                )
                total = total + added / mpmath.mpf(c) ** 2
            made.append([float(component) for component in total])
    return np.array(made)


def test_relativity_of_massless_bodies_is_the_one_of_einstein_infeld_and_hoffmann():
    bodies = nbody(MASSES[:2], X, V, massless=2, forces=[PostNewtonian(c=3.0)], t_end=1.0)
    assert bodies.system.dof is None
    wanted = _post_newtonian([*MASSES[:2], 0.0, 0.0], X, V, 3.0)
    assert _accelerations(bodies, 4) == pytest.approx(wanted, rel=1e-13, abs=1e-14)  # measured 2e-15
    newton = nbody(MASSES[:2], X, V, massless=2, t_end=1.0)
    assert np.abs(_accelerations(newton, 4) - wanted).max() > 0.01


def test_relativity_and_a_function_act_together():
    drag = lambda v: [[-0.1 * u for u in row] for row in v]  # noqa: E731
    bodies = nbody(MASSES, X, V, forces=[PostNewtonian(c=3.0), drag], t_end=1.0)
    wanted = _post_newtonian(MASSES, X, V, 3.0) - 0.1 * V
    assert _accelerations(bodies, 4) == pytest.approx(wanted, rel=1e-13, abs=1e-14)  # measured 2e-15


@pytest.mark.slow
def test_both_forms_of_relativity_differ_by_the_fourth_power_of_the_velocity_of_light():
    nothing = lambda x: [[0.0, 0.0, 0.0] for _ in x]  # noqa: E731 -- makes it a VectorField
    apart = []
    for c in (20.0, 40.0):
        energy, field = (
            nbody(MASSES, X, V, forces=[PostNewtonian(c=c), *more], t_end=1.0) for more in ((), (nothing,))
        )
        q, y = integrate(energy, HBVM(), [1.0]).q, integrate(field, HBVM(), [1.0]).y
        apart.append(np.abs(q[-1] - y[-1, :12]).max())
    assert 12.0 < apart[0] / apart[1] < 20.0  # 16, the next order in 1/c^2
    assert apart[1] < 1e-4


def test_a_force_of_ones_own():
    drag = lambda t, x, v, masses, m: [[-0.1 * u for u in row] for row in v]  # noqa: E731
    falling = nbody([1e-30], [[0.0] * 3, X[0]], [[0.0] * 3, V[0]], massless=1, forces=[drag], t_end=5.0)
    y = integrate(falling, HBVM(), [5.0]).y[-1]
    assert y[9:] == pytest.approx(V[0] * np.exp(-0.5), rel=1e-13)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"masses": [1.0, 0.0, 1.0, 1.0]}, "bodies without mass come last"),
        ({"masses": "ab"}, "list of positive numbers"),
        ({"positions": X[:3]}, r"positions must be finite numbers of shape \(4, 3\)"),
        ({"positions": [X[0], X[0], X[1], X[2]]}, "bodies 0 and 1 are at one place"),
        ({"forces": [3]}, "3 is no force"),
        ({"forces": [J2(J2=1.0, R=1.0, body=4)]}, "none of the 4 bodies"),
        ({"forces": [lambda w: w]}, "no argument 'w'"),
        ({"forces": [lambda x: x[:2]]}, "three accelerations for each of the 4 bodies"),
        ({"forces": [PostNewtonian(c=1.0), lambda x: x], "softening": 0.1}, "no relativistic form"),
        ({"G": "big"}, "G='big'"),
    ],
)
def test_what_are_no_bodies(change, words):
    with pytest.raises(InputError, match=words):
        nbody(**{"masses": MASSES, "positions": X, "velocities": V, "t_end": 1.0, **change})


def test_the_examples_of_the_page_are_true():
    page = Path(__file__).parents[3] / "docs" / "howto" / "bodies.md"
    failed, tried = doctest.testfile(str(page), module_relative=False)
    assert (failed, tried > 20) == (0, True)


def test_poles_that_are_none():
    with pytest.raises(InputError, match="three numbers, not all 0"):
        J2(J2=1.0, R=1.0, pole=[0.0, 0.0, 0.0])


def test_a_single_force_is_refused_with_the_list_that_is_meant():
    with pytest.raises(InputError, match=r"must be a list of forces, such as \[PostNewtonian"):
        nbody(MASSES, X, V, forces=PostNewtonian(c=1.0), t_end=1.0)
