"""Messages name what was given, what is wrong and the fix."""

import numba
import pytest

import problems
from integrators import HBVM, integrate
from problems import Hamiltonian, InputError, Problem

SPRING = Problem(Hamiltonian(lambda q, p: (p[0] ** 2 + q[0] ** 2) / 2, dof=1), q0=[1.0], p0=[0.0], t_end=1.0)


@pytest.mark.parametrize(
    ("times", "says"),
    [
        ([0, 5, 5, 10], r"times\[1\] = 5.0 is followed by times\[2\] = 5.0"),
        ([1, 3, 2], r"times\[1\] = 3.0 is followed by times\[2\] = 2.0"),
        ([-1, -3, -2], r"times\[1\] = -3.0 is followed by times\[2\] = -2.0"),
        ([-1, 1], "-1.0 and 1.0 lie on both sides of it: integrate twice"),
    ],
)
def test_the_times_that_are_out_of_order_are_named(times, says):
    with pytest.raises(InputError, match=says):
        integrate(SPRING, HBVM(), times)


@numba.njit
def potential(q):
    return q[0] ** 2 / 2


def test_a_compiled_formula_is_refused_without_numbas_dump():
    with pytest.raises(InputError, match=r"compiled by numba.*potential\.py_func") as caught:
        Hamiltonian(potential, dof=1)
    assert len(str(caught.value)) < 250


def test_a_formula_that_calls_a_compiled_function_is_refused_without_numbas_dump():
    with pytest.raises(InputError, match=r"numba has compiled.*py_func") as caught:
        Hamiltonian(lambda q, p: p[0] ** 2 / 2 + potential(q), dof=1)
    assert len(str(caught.value)) < 250
    assert Hamiltonian(lambda q, p: p[0] ** 2 / 2 + potential.py_func(q), dof=1).separable


def test_multipliers_of_sympys_equations_are_named():
    sympy = pytest.importorskip("sympy")
    mechanics = pytest.importorskip("sympy.physics.mechanics")
    x, y = mechanics.dynamicsymbols("x y")
    m, g, length = sympy.symbols("m g length")
    L = m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y
    equations = mechanics.LagrangesMethod(L, [x, y], hol_coneqs=[x**2 + y**2 - length**2])
    equations.form_lagranges_equations()
    with pytest.raises(InputError, match=r"5 unknowns for 4 coordinates.*last 1 are Lagrange multipliers"):
        problems.from_sympy(equations, parameters={m: 1.0, g: 9.81, length: 1.0})
