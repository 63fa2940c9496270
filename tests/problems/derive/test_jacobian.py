"""Jacobians of fields and forces: the right entries, and none where there are none."""

import numpy as np
import pytest

import problems
from problems import Hamiltonian, InputError, Opaque, targets
from problems.analysis.invariants import evaluate
from problems.derive import jacobian as module

STEP = 2.0**-20


def dense(system, what, state, par, limit):
    """Return a Jacobian as a matrix, its entries from the emitted function."""
    found = system.jacobian(what)
    matrix = np.zeros(found.shape)
    matrix[found.rows, found.columns] = targets.numpy(system, found, limit=limit)(0.3, state, par)
    return matrix


@pytest.mark.parametrize("limit", [None, 0])
@pytest.mark.parametrize("what", ["field", "force"])
def test_entries_agree_with_differences(case, states, what, limit):
    system, par, state = case.system, case.system.pack(), states[0]
    if what == "force" and not system.separable:
        with pytest.raises(InputError, match="unknown function of"):
            system.jacobian(what)
        return
    found = dense(system, what, state, par, limit)
    columns = np.concatenate([state + sign * STEP * np.eye(system.dim) for sign in (1, -1)]).T
    values = evaluate(system.function(what), 0.3, columns, par)
    pairs = [(value[: system.dim] - value[system.dim :]) / (2 * STEP) for value in values]
    expected = np.stack([pair.rounded() for pair in pairs])[:, : len(found)]
    # Differences have errors of STEP^2 times the third derivatives: measured at most 1.1e-10, relative.
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


def test_only_entries_that_can_differ_from_zero_are_listed():
    found = problems.load("sine_gordon", n=16).system.jacobian("force")
    assert found.rows.size == 3 * 16  # each mass and its two neighbours, in a ring
    assert found.density == 3 / 16


def test_a_constant_field_has_one_entry_which_is_zero():
    system = Hamiltonian(lambda p: p[0], dof=1)
    assert np.array_equal(dense(system, "field", np.ones(2), np.empty(0), None), np.zeros((2, 2)))


def test_there_is_none_of_functions_that_are_not_traced_and_of_endless_lists(monkeypatch):
    assert Opaque(lambda t, y: -y, dim=2).jacobian() is None
    monkeypatch.setattr(module, "LARGEST", 20)
    assert problems.load("sine_gordon", n=16).system.jacobian() is None


def test_another_name_is_refused():
    with pytest.raises(InputError, match="unknown Jacobian 'fields'; did you mean 'field'"):
        problems.load("kepler").system.jacobian("fields")
