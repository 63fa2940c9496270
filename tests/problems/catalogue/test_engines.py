"""The same field on every engine.

Differences are in units in the last place of what is added up in an output: the sum of the sizes of its
terms. Relative to the largest single term instead, compilers that contract products and sums come to 20
(lennard_jones: each of six neighbours adds powers up to 14 of a distance, which nearly cancel) and 12
(cluster), and to at most 6 on every other problem: measured on these states.
"""

import numpy as np
import pytest

from problems import targets

STATES = 200
TRANSCENDENTAL = {"sin", "cos", "exp", "log"}


def _numba(problem, y):
    field, out = targets.numba(problem.system, "field"), np.empty(y.shape)
    for i in range(y.shape[1]):
        column = np.empty(len(y))
        field(0.0, np.ascontiguousarray(y[:, i]), problem.par, column)
        out[:, i] = column
    return out


def _uses_transcendental(problem):
    text = targets.source(problem.system, "field", "numba").text
    return any(f"{name}(" in text for name in TRANSCENDENTAL)


def test_numpy_and_numba_agree_bit_for_bit_or_within_2_ulp_of_the_terms(small, states, magnitudes):
    y = states(small, STATES)
    ours = targets.numpy(small.system, "field")(0.0, y, small.par)
    other = _numba(small, y)
    if _uses_transcendental(small):
        # The C library's functions and numpy's differ in the last bit; measured: 0.6 ulp.
        assert (np.abs(ours - other) <= 2 * np.spacing(magnitudes(small, y))).all()
    else:
        assert (ours == other).all()


def test_jax_agrees_within_8_ulp_of_the_terms(small, states, magnitudes):
    jax = pytest.importorskip("jax")
    y = states(small, STATES)
    ours = targets.numpy(small.system, "field")(0.0, y, small.par)
    field = targets.jax(small.system, "field")
    other = np.asarray(jax.jit(jax.vmap(lambda column: field(0.0, column, small.par), 1, 1))(y))
    # Compiled code contracts products and sums; measured: 5 ulp (solar_system).
    assert (np.abs(ours - other) <= 8 * np.spacing(magnitudes(small, y))).all()


def test_heyoka_agrees_within_8_ulp_of_the_terms(small, states, magnitudes):
    hy = pytest.importorskip("heyoka")
    y = states(small, STATES)
    ours = targets.numpy(small.system, "field")(0.0, y, small.par)
    pairs = targets.heyoka(small.system)
    right = [expression for _, expression in pairs]
    compiled = hy.cfunc(right, vars=[variable for variable, _ in pairs], compact_mode=True)
    rows = 1 + max((int(str(p)[1:]) for e in right for p in hy.get_params(e)), default=-1)
    par = np.ascontiguousarray(np.broadcast_to(small.par[:rows, np.newaxis], (rows, STATES)))
    other = compiled(np.ascontiguousarray(y), **({"pars": par} if rows else {}))
    # Measured: 5 ulp (solar_system).
    assert (np.abs(ours - other) <= 8 * np.spacing(magnitudes(small, y))).all()
