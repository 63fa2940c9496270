"""Systems from SymPy are those that are written by hand."""

import numpy as np
import pytest

from integrators import HBVM, integrate
from problems import Hamiltonian, InputError, Problem, VectorField, from_sympy, targets
from problems.symbolic import solution

sympy = pytest.importorskip("sympy")
q1, q2, p1, p2, a, t = sympy.symbols("q1 q2 p1 p2 a t")


def _henon_heiles(q, p):
    return (p[0] ** 2 + p[1] ** 2) / 2 + (q[0] ** 2 + q[1] ** 2) / 2 + q[0] ** 2 * q[1] - q[1] ** 3 / 3


def _softened(q, p, par, m):
    return p[0] ** 2 / 2 + p[1] ** 2 / (2 * par.a) - 1 / m.sqrt(q[0] ** 2 + q[1] ** 2 + 1)


def _driven(t, q, p, par, m):
    kinetic = p[0] ** 2 / 2 + p[1] ** 2
    return kinetic + par.a * m.exp(q[0] - q[1]) * m.cos(t) + m.abs(q[0]) * m.sqrt(m.abs(q[0]))


def _functions(q, p, m):
    kinetic = p[0] ** 2 / 2 + p[1] ** 2 / 2
    return kinetic + m.log(2 + q[0] ** 2) / m.tanh(q[1]) + m.atan2(q[0], q[1]) + np.pi * q[0]


S = sympy
KINETIC = (p1**2 + p2**2) / 2


@pytest.mark.parametrize(
    ("expression", "by_hand"),
    [
        (KINETIC + (q1**2 + q2**2) / 2 + q1**2 * q2 - q2**3 / 3, _henon_heiles),
        (p1**2 / 2 + p2**2 / (2 * a) - 1 / S.sqrt(q1**2 + q2**2 + 1), _softened),
        (p1**2 / 2 + p2**2 + a * S.exp(q1 - q2) * S.cos(t) + S.Abs(q1) ** S.Rational(3, 2), _driven),
        (KINETIC + S.log(2 + q1**2) / S.tanh(q2) + S.atan2(q1, q2) + S.pi * q1, _functions),
    ],
)
def test_a_hamiltonian(expression, by_hand):
    made = from_sympy(expression, [q1, q2], [p1, p2], parameters={a: 1.7})
    known = Hamiltonian(by_hand, dof=2, parameters={"a": 1.7})
    y = np.random.default_rng(1).uniform(0.3, 1.5, (4, 50))
    fields = [targets.numpy(system, "field")(np.full(50, 0.4), y, system.pack()) for system in (made, known)]
    assert fields[0] == pytest.approx(fields[1], rel=1e-13, abs=1e-14)
    assert made.separable == known.separable


def test_kanes_equations():
    mechanics = pytest.importorskip("sympy.physics.mechanics")
    q, u = mechanics.dynamicsymbols("q u")
    qd = mechanics.dynamicsymbols("q", 1)
    m, g, length = sympy.symbols("m g l")
    frame = mechanics.ReferenceFrame("N")
    turned = frame.orientnew("A", "Axis", [q, frame.z])
    turned.set_ang_vel(frame, u * frame.z)
    pivot = mechanics.Point("O")
    pivot.set_vel(frame, 0)
    bob = pivot.locatenew("P", length * turned.x)
    bob.v2pt_theory(pivot, frame, turned)
    kane = mechanics.KanesMethod(frame, q_ind=[q], u_ind=[u], kd_eqs=[qd - u])
    kane.kanes_equations([mechanics.Particle("bob", bob, m)], [(bob, m * g * frame.x)])
    made = from_sympy(kane, parameters={m: 2.0, g: 9.81, length: 1.5})
    assert isinstance(made, VectorField)
    found = integrate(Problem(made, y0=[1.0, 0.0], t_end=5.0), HBVM(), [5.0]).y[-1]
    known = VectorField(lambda y, m: [y[1], -9.81 / 1.5 * m.sin(y[0])], dim=2)
    wanted = integrate(Problem(known, y0=[1.0, 0.0], t_end=5.0), HBVM(), [5.0]).y[-1]
    assert found == pytest.approx(wanted, abs=1e-12)  # measured 2e-15


def test_lagranges_equations():
    mechanics = pytest.importorskip("sympy.physics.mechanics")
    x, y = mechanics.dynamicsymbols("x y")
    xd, yd = mechanics.dynamicsymbols("x y", 1)
    lagrangian = (xd**2 + (1 + x**2) * yd**2) / 2 - x**2 / 2 - sympy.cos(y)
    equations = mechanics.LagrangesMethod(lagrangian, [x, y])
    equations.form_lagranges_equations()
    made = Problem(from_sympy(equations), y0=[0.3, 0.2, -0.1, 0.4], t_end=4.0)
    states = integrate(made, HBVM(), [1.0, 4.0]).y
    vx, vy = states[:, 2], states[:, 3]
    energy = (vx**2 + (1 + states[:, 0] ** 2) * vy**2) / 2 + states[:, 0] ** 2 / 2 + np.cos(states[:, 1])
    start = (0.01 + 1.09 * 0.16) / 2 + 0.045 + np.cos(0.2)
    assert energy == pytest.approx(start, abs=1e-13)  # measured 4e-16


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((p1**2 + a * q1, [q1], [p1]), "the symbol 'a' has no value"),
        ((p1**2, [q1, q2], [p1]), "as many q as p"),
        ((3, [q1], [p1]), "must be an expression of SymPy"),
        ((p1**2 + sympy.gamma(q1), [q1], [p1]), r"no formula may call gamma\(q1\)"),
    ],
)
def test_what_is_no_system(arguments, words):
    with pytest.raises(InputError, match=words):
        from_sympy(*arguments)


def links(n):
    """Return a pendulum of n links on a cart by Kane's method, and its parameters."""
    import sympy
    from sympy.physics import mechanics

    q, u = mechanics.dynamicsymbols(f"q:{n + 1}"), mechanics.dynamicsymbols(f"u:{n + 1}")
    masses, lengths = sympy.symbols(f"m:{n + 1}"), sympy.symbols(f"l:{n}")
    g, t = sympy.symbols("g t")
    frame, origin = mechanics.ReferenceFrame("I"), mechanics.Point("O")
    origin.set_vel(frame, 0)
    point = origin.locatenew("P0", q[0] * frame.x)
    point.set_vel(frame, u[0] * frame.x)
    particles = [mechanics.Particle("cart", point, masses[0])]
    forces, kinematic = [(point, -masses[0] * g * frame.y)], [q[0].diff(t) - u[0]]
    for i in range(n):
        link = frame.orientnew(f"B{i}", "Axis", [q[i + 1], frame.z])
        link.set_ang_vel(frame, u[i + 1] * frame.z)
        following = point.locatenew(f"P{i + 1}", lengths[i] * link.x)
        following.v2pt_theory(point, frame, link)
        point = following
        particles.append(mechanics.Particle(f"mass{i}", point, masses[i + 1]))
        forces.append((point, -masses[i + 1] * g * frame.y))
        kinematic.append(q[i + 1].diff(t) - u[i + 1])
    method = mechanics.KanesMethod(frame, q_ind=q, u_ind=u, kd_eqs=kinematic)
    method.kanes_equations(particles, forces)
    return method, {g: 9.81, **dict.fromkeys(masses, 1.0), **dict.fromkeys(lengths, 0.5)}


@pytest.mark.parametrize("n", [2, 5])
def test_a_chain_of_links_has_the_field_that_its_mass_matrix_gives(n):
    sympy = pytest.importorskip("sympy")
    method, parameters = links(n)
    system = from_sympy(method, parameters=parameters)
    symbols = [*method.q, *method.u, *parameters]
    both = sympy.lambdify(symbols, [method.mass_matrix_full, method.forcing_full], "numpy", cse=True)
    for seed in range(5):
        y = np.random.default_rng(seed).normal(size=2 * n + 2)
        matrix, forcing = both(*y, *parameters.values())
        expected = np.linalg.solve(matrix, forcing).ravel()
        value = targets.numpy(system, "field")(0.0, y, system.pack())
        assert value == pytest.approx(expected, rel=1e-11, abs=1e-11)  # measured 3e-14


def test_a_linear_system_of_formulas_is_solved_where_a_pivot_is_zero():
    assert solution([[0.0, 2.0, 4.0], [3.0, 1.0, 5.0]]) == [1.0, 2.0]
    with pytest.raises(InputError, match="singular"):
        solution([[0.0, 1.0, 1.0], [0.0, 2.0, 1.0]])
