"""Gradients of invariants, and several functions of a system as one."""

import numpy as np
import pytest

import problems
from problems import Hamiltonian, InputError, emit
from problems.analysis.invariants import evaluate

SMALL = 2.0**-20


def differences(system, what, state, par):
    """Central differences of a system's function in double-double, shape (outputs, dim)."""
    columns = np.concatenate([state + sign * SMALL * np.eye(system.dim) for sign in (1, -1)]).T
    values = evaluate(system.function(what), 0.3, columns, par)
    pairs = [(value[: system.dim] - value[system.dim :]) / (2 * SMALL) for value in values]
    return np.stack([pair.rounded() for pair in pairs])


@pytest.mark.parametrize("name", ["sitnikov", "kepler", "lotka_volterra", "rigid_body", "outer_solar_system"])
def test_gradients_agree_with_differences(name):
    problem = problems.load(name)
    system = problem.system
    state = problem.y0 * 1.1 + 0.05
    for invariant in system.invariant_names:
        exact = differences(system, f"invariant:{invariant}", state, problem.par)
        found = emit.numpy(system, f"gradient:{invariant}")(0.0, state, problem.par).reshape(exact.shape)
        assert np.abs(found - exact).max() <= 1e-10 * np.abs(exact).max()  # measured 1.5e-11, of SMALL^2


def test_the_energys_gradient_has_the_bits_of_the_field(case, states):
    system, par = case.system, case.system.pack()
    if "energy" not in system.invariant_names or system.dof is None:
        return
    field = emit.numpy(system, "field")(0.3, states.T, par)
    slope = emit.numpy(system, "gradient:energy")(0.3, states.T, par)
    assert np.array_equal(slope[system.dof :], field[: system.dof])
    assert np.array_equal(slope[: system.dof], -field[system.dof :])


@pytest.mark.parametrize("limit", [None, 0])
def test_functions_stacked_have_the_bits_of_each(case, states, limit):
    system, par = case.system, case.system.pack()
    parts = ["field", *(f"gradient:{name}" for name in system.invariant_names)]
    together = emit.numpy(system, ", ".join(parts), limit=limit)(0.3, states.T, par)
    alone = [emit.numpy(system, part, limit=limit)(0.3, states.T, par) for part in parts]
    assert np.array_equal(together, np.concatenate(alone))


def test_compiled_loops_stacked_have_the_bits_of_numpy(cases):
    system = cases["gravity"].system
    state, par = np.random.default_rng(1).uniform(-1.0, 1.0, system.dim), system.pack()
    out = np.empty(2 * system.dim)
    emit.numba(system, "field, gradient:energy", limit=0)(0.0, state, par, out)
    assert np.array_equal(out, emit.numpy(system, "field, gradient:energy", limit=0)(0.0, state, par))


def test_one_component_of_a_vector_has_a_name():
    problem = problems.load("kepler")
    whole = emit.numpy(problem.system, "gradient:lenz")(0.0, problem.y0, problem.par)
    part = emit.numpy(problem.system, "gradient:lenz[1]")(0.0, problem.y0, problem.par)
    assert np.array_equal(part, whole[4:])
    value = emit.numpy(problem.system, "invariant:lenz[1]")(0.0, problem.y0, problem.par)
    assert value[0] == problem.invariants(problem.y0)["lenz"][0, 1]


def test_poisson_systems_offer_gradient_and_structure():
    problem = problems.load("lotka_volterra")
    made = emit.numpy(problem.system, "gradient, structure")(0.0, problem.y0, problem.par)
    slope, structure = made[:3], made[3:].reshape(3, 3)
    field = emit.numpy(problem.system, "field")(0.0, problem.y0, problem.par)
    assert np.array_equal(structure, -structure.T)
    assert np.allclose(structure @ slope, field, rtol=0, atol=1e-15)  # measured 4.4e-16


@pytest.mark.parametrize(
    "what", ["gradient:enery", "gradient:lenz[2]", "invariant:energy[1]", "gradient:", "field, nothing"]
)
def test_unknown_functions_are_refused(what):
    with pytest.raises(InputError, match="unknown function of kepler"):
        problems.load("kepler").system.function(what)


def test_a_gradient_that_is_zero_has_all_its_outputs():
    system = Hamiltonian(lambda p: p[0] ** 2 / 2, dof=2, invariants={"one": lambda: 1.0}, name="idle")
    assert np.array_equal(emit.numpy(system, "gradient:one")(0.0, np.ones(4), np.empty(0)), np.zeros(4))
