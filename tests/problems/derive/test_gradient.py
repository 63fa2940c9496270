"""Gradients against SymPy and against mpmath on generated expressions."""

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy
from hypothesis import example, given, settings
from hypothesis import strategies as st

from problems import Hamiltonian, targets
from problems.analysis.invariants import evaluate


class SympyMath:
    """The functions of m on SymPy's symbols."""

    pi = sympy.Float(np.pi, 60)
    sqrt, sin, cos, tan, exp, log, abs = (
        staticmethod(f)
        for f in (sympy.sqrt, sympy.sin, sympy.cos, sympy.tan, sympy.exp, sympy.log, sympy.Abs)
    )

    @staticmethod
    def sum(term: Callable[..., Any], index: Any) -> Any:
        return sum(term(*(i if isinstance(i, tuple) else (i,))) for i in index)


class SympyParameters:
    def __init__(self, system: Any) -> None:
        for name, value in system.parameters.items():
            exact = (
                [sympy.Float(v, 60) for v in value] if isinstance(value, tuple) else sympy.Float(value, 60)
            )
            setattr(self, name, exact)


def arguments_of(function: Callable[..., Any], offered: dict[str, Any]) -> list[Any]:
    names = function.__code__.co_varnames[: function.__code__.co_argcount]
    return [offered[name] for name in names]


def test_fields_agree_with_sympys_gradient(case, states):
    system = case.system
    if system.dof is None:
        return
    q = sympy.symbols(f"q:{system.dof}", real=True)
    p = sympy.symbols(f"p:{system.dof}", real=True)
    t = sympy.Symbol("t")
    offered = {"q": q, "p": p, "t": t, "m": SympyMath, "par": SympyParameters(system)}
    energy = sympy.sympify(case.function(*arguments_of(case.function, offered)))
    places = range(system.dim) if system.dim <= 18 else (0, 5, system.dof, system.dim - 1)
    rows = states[:5]
    found = evaluate(system.function("field"), 0.3, rows.T, system.pack())
    for place in places:
        variable = p[place] if place < system.dof else q[place - system.dof]
        derivative = sympy.diff(energy, variable) * (1 if place < system.dof else -1)
        exact = sympy.lambdify([t, q, p], derivative, "mpmath")
        for k, row in enumerate(rows):
            state = [mpmath.mpf(float(x)) for x in row]
            with mpmath.workdps(50):
                expected = exact(mpmath.mpf(0.3), state[: system.dof], state[system.dof :])
                value = mpmath.mpf(float(found[place].hi[k])) + mpmath.mpf(float(found[place].lo[k]))
                # Measured 2e-29 (lennard_jones, where terms of 1e12 cancel), else 1e-30. What SymPy knows of
                # a constant such as 0.3 is its double: both sides calculate with the same numbers.
                assert abs(value - expected) <= 1e-27 * max(1, abs(expected)), (place, k)


# --- generated expressions ----------------------------------------------------------------------

leaves = st.sampled_from(["x", "y", "a", "b", "x", "y"])
UNARY = {
    "neg": lambda m, u: -u,
    "sin": lambda m, u: m.sin(u),
    "cos": lambda m, u: m.cos(u),
    "exp": lambda m, u: m.exp(m.sin(u)),
    "sqrt": lambda m, u: m.sqrt(1 + u * u),
    "log": lambda m, u: m.log(2 + u * u),
    "inverse": lambda m, u: 1 / (1 + u * u),
    "cube": lambda m, u: u**3,
    "square": lambda m, u: u**2,
    "root5": lambda m, u: (1 + u * u) ** 2.5,
    "rootm3": lambda m, u: (1 + u * u) ** -1.5,
    "inverse_root": lambda m, u: 3 / m.sqrt(1 + u * u),
    "half": lambda m, u: u / 2,
    "third": lambda m, u: u * u / 3,
}
BINARY = {
    "add": lambda m, u, v: u + v,
    "sub": lambda m, u, v: u - v,
    "mul": lambda m, u, v: u * v,
    "div": lambda m, u, v: u / (1 + v * v),
    "kepler": lambda m, u, v: u / m.sqrt(1 + u * u + v * v),
}
trees = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(st.sampled_from(sorted(UNARY)), inner),
        st.tuples(st.sampled_from(sorted(BINARY)), inner, inner),
    ),
    max_leaves=12,
)


def build(tree: Any, m: Any, leaf: dict[str, Any]) -> Any:
    """Evaluate a tree; a subtree that occurs twice is one object, as in a user's function."""
    if isinstance(tree, str):
        return leaf[tree]
    values = [build(branch, m, leaf) for branch in tree[1:]]
    return (UNARY | BINARY)[tree[0]](m, *values)


@settings(max_examples=150, deadline=None)
@given(trees, st.floats(-2, 2), st.floats(-2, 2))
@example(("add", ("third", "y"), ("div", "x", "y")), 0.0, 1.0)  # a quotient of constants that is not a double
def test_gradients_of_generated_expressions(tree: Any, x: float, y: float):
    def H(q, par, m):
        return build(tree, m, {"x": q[0], "y": q[1], "a": par.a, "b": par.b})

    system = Hamiltonian(H, dof=2, parameters={"a": 0.7, "b": 2.0})
    state = np.array([[x], [y], [0.0], [0.0]])
    values = evaluate(system.function("field"), 0.0, state, system.pack())
    with mpmath.workdps(60):
        leaf = {"a": mpmath.mpf(0.7), "b": mpmath.mpf(2)}
        for place, at in ((2, (1, 0)), (3, (0, 1))):
            expected = -mpmath.diff(
                lambda u, v: mpmath.mpf(1) * build(tree, mpmath, leaf | {"x": u, "y": v}),
                (mpmath.mpf(x), mpmath.mpf(y)),
                at,
            )
            value = mpmath.mpf(float(values[place].hi[0])) + mpmath.mpf(float(values[place].lo[0]))
            scale = max(1, abs(expected))
            # Measured 1e-24: mpmath's differences of 60 digits, and cancellation inside towers of cubes.
            assert abs(value - expected) <= 1e-20 * scale * scale


def test_a_shared_factor_is_not_counted_twice():
    def H(q):
        x = q[0]
        return x * x * x * x + x + x

    (value,) = evaluate(Hamiltonian(H, dof=1).function("force"), 0.0, np.array([[3.0]]), np.zeros(0))
    assert value.rounded() == [-(4 * 27.0 + 2)]


def test_half_and_two_cancel_before_anything_is_rounded():
    system = Hamiltonian(lambda q, p: p[0] ** 2 / 2 + 0.1 * q[0] ** 2 / 0.3, dof=1)
    assert "*" not in targets.source(system, "velocity_scale", "numba").text
    text = targets.source(system, "force", "numba").text
    assert text.count("*") + text.count("/") == 1  # one constant times q


def test_the_derivative_of_a_constant_energy_is_zero():
    system = Hamiltonian(lambda q: 3.5, dof=1)
    assert np.array_equal(targets.numpy(system, "field")(0.0, np.ones(2), np.zeros(0)), [0.0, 0.0])


@pytest.mark.parametrize("n", range(2, 10))
def test_powers_are_products(n: int):
    system = Hamiltonian(lambda q, p: p[0] ** 2 / 2 + q[0] ** n, dof=1)
    made = targets.source(system, "hamiltonian", "numba").text
    assert "**" not in made
    assert "pow" not in made
    value = targets.numpy(system, "hamiltonian")(0.0, np.array([3.0, 0.0]), np.zeros(0))
    assert value == [3.0**n]
