"""Problems: frozen, hashable, printable; their invariants in double-double."""

import dataclasses
import subprocess
import sys

import mpmath
import numpy as np
import pytest

import problems
from problems import Hamiltonian, InputError, Problem, VectorField


def oscillator(q, p, par):
    return p[0] ** 2 / (2 * par.m) + par.k * q[0] ** 2 / 2


def swinging(**options):
    system = Hamiltonian(oscillator, dof=1, parameters={"m": 2.0, "k": 0.5})
    return Problem(system, q0=[0.5], p0=[0.25], t_end=10.0, **options)


def test_a_named_problem_prints_as_the_call_that_makes_it():
    problem = problems.load("sitnikov", e=0.6, m3=1e-4, t_end=100)
    assert repr(problem) == "sitnikov(e=0.6, m3=0.0001, t_end=100)"
    again = eval(repr(problem), {"sitnikov": problems.registry.factory("sitnikov")})  # noqa: S307 -- our own
    assert again == problem
    assert hash(again) == hash(problem)
    assert repr(problems.load("sitnikov")) == "sitnikov(e=0.75)"


def test_a_problem_of_ones_own_prints_what_it_was_made_with():
    expected = "Problem(Hamiltonian(oscillator, dof=1), q0=[0.5], p0=[0.25], t_end=10.0)"
    assert repr(swinging()) == expected
    with_values = swinging(parameters={"k": 2.0}, t0=1.0)
    assert "parameters={'k': 2.0}, t0=1.0, t_end=10.0" in repr(with_values)


def test_problems_are_frozen_and_hashable():
    problem = swinging()
    with pytest.raises(dataclasses.FrozenInstanceError):
        problem.t_end = 3.0  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        problem.y0[0] = 1.0
    assert problem == swinging()
    assert problem != swinging(parameters={"k": 0.25})
    assert len({problem, swinging(), swinging(parameters={"k": 0.25})}) == 2
    assert problem != 3


def test_parameters_are_packed_in_order_with_defaults():
    system = Hamiltonian(oscillator, dof=1, parameters={"m": 2.0, "extra": [1.0, 2.0, 3.0], "k": 0.5})
    assert np.array_equal(system.pack({"k": 9.0}), [2.0, 1.0, 2.0, 3.0, 9.0])
    assert swinging(parameters={"m": 4.0}).par.tolist() == [4.0, 0.5]


def test_velocities_give_momenta_rounded_once():
    system = Hamiltonian(oscillator, dof=1, parameters={"m": 1e-5, "k": 0.5})
    problem = Problem(system, q0=[0.0], v0=[0.3], t_end=1.0)
    assert problem.y0[1] == 1e-5 * 0.3
    assert problem.velocity(problem.y0) == [[0.3]]


def test_a_system_without_constant_masses_has_no_velocities():
    problem = Problem(Hamiltonian(lambda p: p[0] ** 4, dof=1), q0=[0.0], p0=[1.0], t_end=1.0)
    assert problem.velocity(problem.y0) is None


def test_invariants_are_exact_sums_rounded_once():
    """Terms that cancel to the last digits: in double the energy would be lost."""
    system = Hamiltonian(lambda q, p: p[0] ** 2 / 2 - q[0] ** 2 / 2, dof=1)
    q, p = 1e8 + 1.0, 1e8 + 1.0 + 2.0**-20
    problem = Problem(system, q0=[q], p0=[p], t_end=1.0)
    with mpmath.workdps(60):
        exact = float((mpmath.mpf(p) ** 2 - mpmath.mpf(q) ** 2) / 2)
    assert problem.invariants([q, p])["energy"] == [exact]
    assert p**2 / 2 - q**2 / 2 != exact


def test_errors_are_formed_before_rounding():
    problem = swinging()
    state = problem.y0.copy()
    state[0] += 2.0**-54  # half an ulp of 0.5: changes the energy by 1e-17 relative
    states = np.array([problem.y0, state])
    error = problem.errors(states)["energy"]
    with mpmath.workdps(60):
        start, now = (
            mpmath.mpf(p) ** 2 / 4 + mpmath.mpf(0.5) * mpmath.mpf(q) ** 2 / 2 for q, p in states.tolist()
        )
        exact = float(abs(now - start) / start)
    assert error[0] == 0.0
    assert error[1] == pytest.approx(exact, rel=1e-15)


def test_errors_are_relative_to_the_largest_terms_in_the_two_norm():
    def H(p):
        return (p[0] ** 2 + p[1] ** 2) / 2

    system = Hamiltonian(H, dof=2, invariants={"P": lambda p: [p[0], p[1]], "Z": lambda q: q[0]})
    problem = Problem(system, q0=[0.0, 0.0], p0=[3.0, 4.0], t_end=1.0)
    errors = problem.errors([[1e-3, 0.0, 3.0, 4.0], [0.0, 0.0, 3.0 + 3e-3, 4.0 + 4e-3]])
    assert errors["P"] == pytest.approx([0.0, 1e-3 / 1.001], rel=1e-12)
    assert errors["Z"].tolist() == [1.0, 0.0]


def test_invariants_have_their_names_and_shapes_with_the_energy_first():
    problem = problems.load("sitnikov")
    states = np.tile(problem.y0, (5, 1))
    found = problem.invariants(states)
    assert [(name, values.shape) for name, values in found.items()] == [
        ("energy", (5,)),
        ("linear_momentum", (5, 3)),
        ("angular_momentum", (5, 3)),
    ]
    assert all((error == 0).all() for error in problem.errors(states).values())
    assert problem.invariants(problem.y0)["energy"].shape == (1,)
    assert problem.guards(states)["off_axis"].shape == (5,)


def test_declared_sums_give_the_same_invariants_as_written_out_ones(cases):
    case = cases["gravity"]
    rng = np.random.default_rng(5)
    states = rng.normal(size=(40, case.system.dim))
    problem = Problem(case.system, y0=states[0], t_end=1.0)
    par = problem.par
    masses, G = par[:7], par[7]
    expected = []
    with mpmath.workdps(40):
        for state in states[:5]:
            q, p = np.split(np.array([mpmath.mpf(float(x)) for x in state]), 2)
            kinetic = sum(p[3 * i + c] ** 2 / (2 * mpmath.mpf(masses[i])) for i in range(7) for c in range(3))
            potential = sum(
                mpmath.mpf(masses[i])
                * mpmath.mpf(masses[j])
                / mpmath.sqrt(sum((q[3 * i + c] - q[3 * j + c]) ** 2 for c in range(3)))
                for i in range(7)
                for j in range(i)
            )
            expected.append(float(kinetic - mpmath.mpf(G) * potential))
    assert problem.invariants(states)["energy"][:5].tolist() == expected


def test_an_energy_that_depends_on_time_is_not_an_invariant():
    def H(q, p, t, m):
        return p[0] ** 2 / 2 - q[0] * m.cos(t)

    problem = Problem(Hamiltonian(H, dof=1), q0=[0.0], p0=[1.0], t_end=1.0)
    assert problem.invariants(problem.y0) == {}


def test_an_invariant_may_depend_on_time():
    def H(p):
        return p[0] ** 2 / 2

    system = Hamiltonian(H, dof=1, invariants={"start": lambda q, p, t: q[0] - t * p[0]})
    problem = Problem(system, q0=[1.0], p0=[0.5], t_end=4.0)
    times = np.array([0.0, 2.0, 4.0])
    states = np.stack([1.0 + 0.5 * times, np.full(3, 0.5)], axis=1)
    assert problem.invariants(states, times)["start"].tolist() == [1.0, 1.0, 1.0]
    assert problem.errors(states, times)["start"].tolist() == [0.0, 0.0, 0.0]
    with pytest.raises(InputError, match="start depends on time; give the times of the states as t="):
        problem.invariants(states)


def test_states_of_the_wrong_shape_are_refused():
    with pytest.raises(InputError, match=r"states must have the shape \(n, 2\), not \(3,\)"):
        swinging().invariants([1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="t must be 2 times"):
        swinging().invariants([[1.0, 2.0], [1.0, 2.0]], [0.0, 1.0, 2.0])


def test_states_that_are_not_finite_give_nan_in_silence():
    found = swinging().invariants([[np.nan, 1.0], [np.inf, 1.0], [0.5, 0.25]])["energy"]
    assert not np.isfinite(found[:2]).any()
    assert np.isfinite(found[2])


def test_a_vector_field_starts_from_a_whole_state():
    field = VectorField(lambda t, y, m: [y[1], -y[0] + m.sin(t)], dim=2, name="forced")
    problem = Problem(field, y0=[1.0, 0.0], t_end=100.0)
    assert repr(problem) == "Problem(VectorField(forced, dim=2), y0=[1.0, 0.0], t_end=100.0)"
    assert problem.invariants(problem.y0) == {}
    with pytest.raises(InputError, match="starts from y0="):
        Problem(field, q0=[1.0], p0=[0.0], t_end=1.0)


def test_importing_problems_loads_no_engine():
    code = (
        "import problems, sys; problems.load('sitnikov'); "
        "heavy = {'jax', 'heyoka', 'numba', 'sympy', 'scipy', "
        "'mpmath', 'rebound', 'matplotlib'}; print(sorted(heavy & set(sys.modules)))"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"


def test_all_registered_problems_load_by_their_defaults():
    for name in problems.names():
        problem = problems.load(name)
        assert problem.name == name
        assert repr(problem).startswith(f"{name}(")


def test_replace_keeps_what_is_not_replaced():
    problem = swinging(parameters={"m": 3.0})
    other = problem.replace(y0=[1.0, 0.0], parameters={"k": 2.0}, t_end=5.0)
    assert problem.system.unpack(other.par) == {"m": 3.0, "k": 2.0}
    assert (other.system, other.y0.tolist(), other.t_end) == (problem.system, [1.0, 0.0], 5.0)
    with pytest.raises(InputError, match="y0 must be"):
        problem.replace(y0=[1.0])
