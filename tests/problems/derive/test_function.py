"""Gradients of invariants, and several functions of a system as one."""

import numpy as np
import pytest

import problems
from problems import Hamiltonian, InputError, Opaque, VectorField, targets
from problems.analysis.invariants import evaluate

SMALL = 2.0**-20


def differences(system, function, state, par):
    """Central differences of a system's function in double-double, shape (outputs, dim)."""
    columns = np.concatenate([state + sign * SMALL * np.eye(system.dim) for sign in (1, -1)]).T
    values = evaluate(function, 0.3, columns, par)
    pairs = [(value[: system.dim] - value[system.dim :]) / (2 * SMALL) for value in values]
    return np.stack([pair.rounded() for pair in pairs])


@pytest.mark.parametrize("name", ["sitnikov", "kepler", "lotka_volterra", "rigid_body", "outer_solar_system"])
def test_gradients_agree_with_differences(name):
    problem = problems.load(name)
    system = problem.system
    state = problem.y0 * 1.1 + 0.05
    for invariant in system.invariants.values():
        exact = differences(system, invariant, state, problem.par)
        found = targets.numpy(system, system.gradient(invariant))(0.0, state, problem.par).reshape(
            exact.shape
        )
        assert np.abs(found - exact).max() <= 1e-10 * np.abs(exact).max()  # measured 1.5e-11, of SMALL^2


def test_the_energys_gradient_has_the_bits_of_the_field(case, states):
    system, par = case.system, case.system.pack()
    if "energy" not in system.invariants or system.dof is None:
        return
    field = targets.numpy(system, "field")(0.3, states.T, par)
    slope = targets.numpy(system, system.gradient("energy"))(0.3, states.T, par)
    assert np.array_equal(slope[system.dof :], field[: system.dof])
    assert np.array_equal(slope[: system.dof], -field[system.dof :])


@pytest.mark.parametrize("limit", [None, 0])
def test_functions_stacked_have_the_bits_of_each(case, states, limit):
    system, par = case.system, case.system.pack()
    parts = [system.field, *(system.gradient(name) for name in system.invariants)]
    together = targets.numpy(system, system.together(*parts), limit=limit)(0.3, states.T, par)
    alone = [targets.numpy(system, part, limit=limit)(0.3, states.T, par) for part in parts]
    assert np.array_equal(together, np.concatenate(alone))


def test_compiled_loops_stacked_have_the_bits_of_numpy(cases):
    system = cases["gravity"].system
    state, par = np.random.default_rng(1).uniform(-1.0, 1.0, system.dim), system.pack()
    out = np.empty(2 * system.dim)
    both = system.together(system.field, system.gradient("energy"))
    targets.numba(system, both, limit=0)(0.0, state, par, out)
    assert np.array_equal(out, targets.numpy(system, both, limit=0)(0.0, state, par))


def test_one_component_of_a_vector_has_a_name():
    problem = problems.load("kepler")
    system = problem.system
    second = system.components("lenz")["lenz[1]"]
    whole = targets.numpy(system, system.gradient("lenz"))(0.0, problem.y0, problem.par)
    part = targets.numpy(system, system.gradient(second))(0.0, problem.y0, problem.par)
    assert np.array_equal(part, whole[4:])
    value = targets.numpy(system, second)(0.0, problem.y0, problem.par)
    assert value[0] == problem.invariants(problem.y0)["lenz"][0, 1]


def test_poisson_systems_offer_gradient_and_structure():
    problem = problems.load("lotka_volterra")
    both = problem.system.together(problem.system.slope, problem.system.structure)
    made = targets.numpy(problem.system, both)(0.0, problem.y0, problem.par)
    slope, structure = made[:3], made[3:].reshape(3, 3)
    field = targets.numpy(problem.system, "field")(0.0, problem.y0, problem.par)
    assert np.array_equal(structure, -structure.T)
    assert np.allclose(structure @ slope, field, rtol=0, atol=1e-15)  # measured 4.4e-16


def test_what_a_system_has_not_is_none_and_by_name_refused():
    system = problems.load("kepler").system
    assert system.gradient("enery") is None
    with pytest.raises(InputError, match="unknown function of kepler 'forces'; did you mean 'force'"):
        system.function("forces")
    with pytest.raises(InputError, match="unknown invariant of kepler 'lens'; did you mean 'lenz'"):
        system.components("lens")
    swing = problems.load("double_pendulum").system
    assert swing.force is swing.velocity_scale is None
    rigid = problems.load("rigid_body").system
    assert rigid.force is rigid.velocity_scale is None
    free = VectorField(lambda y: [y[1], y[0]], dim=2)
    assert free.energy is None
    assert not free.invariants


def test_asking_for_an_energy_differentiates_nothing():
    system = Hamiltonian(lambda q, p: p[0] ** 2 / 2 + q[0] ** 4, dof=1)
    before = len(system.energy.graph.nodes)
    assert system.energy is not None
    assert list(system.invariants) == ["energy"]
    assert len(system.energy.graph.nodes) == before


def test_the_field_of_code_is_none():
    system = Opaque(lambda t, y: [y[1], -y[0]], dim=2, invariants={"radius": lambda y: y[0] ** 2 + y[1] ** 2})
    assert system.field is system.energy is system.force is None
    assert [function.name for function in system.functions] == ["invariant:radius"]
    with pytest.raises(InputError, match="is not traced"):
        system.function("field")


def test_a_gradient_that_is_zero_has_all_its_outputs():
    system = Hamiltonian(lambda p: p[0] ** 2 / 2, dof=2, invariants={"one": lambda: 1.0}, name="idle")
    assert np.array_equal(
        targets.numpy(system, system.gradient("one"))(0.0, np.ones(4), np.empty(0)), np.zeros(4)
    )
