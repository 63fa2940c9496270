"""What cannot be traced is refused with the line and the remedy."""

import inspect
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from problems import Hamiltonian, InputError, Problem, VectorField, load, targets
from problems.errors import shown

kept: list[Any] = []


def vector(q, p):
    return [p[0] ** 2 / 2, q[0]]


def branch(q, p):
    if q[0] > 0:  # the line
        return p[0] ** 2
    return q[0]


def equality(q, p):
    return p[0] if q[0] == 0 else q[0]  # the line


def truth(q, p):
    return (q[0] and p[0]) * 1.0  # the line


def largest(q, p):
    return max(q[0], p[0])  # the line


def numpy_function(q, p):
    return p[0] ** 2 / 2 + np.sin(q[0])  # the line


def numpy_absolute(q, p):
    return np.abs(q[0])  # the line


def numpy_dot(q, p):
    return np.dot(p, p) / 2  # the line


def numpy_of_a_list(q, p):
    return np.linalg.norm([q[0], q[1]])  # the line


def numpy_array(q, p):
    return (np.array([1.0, 2.0]) * q[0])[0]  # the line


def math_function(q, p):
    return math.sqrt(q[0])  # the line


def whole_vectors(q, p):
    return q + p  # the line


def mutation(q, p):
    q[0] = 2 * q[0]  # the line
    return q[0]


def increment(q, p):
    q[0] += 1  # the line
    return q[0]


def set_parameter(q, p, par):
    par.mass = 2  # the line
    return q[0]


def undeclared_parameter(q, p, par):
    return par.mas * q[0]  # the line


def undeclared_argument(q, p, omega):
    return omega * q[0]


def parameter_as_argument(q, p, mass):
    return mass * q[0]


def undeclared_function(q, p):
    return sqrt(q[0])  # noqa: F821 -- the line


def undeclared_name(q, p):
    return omega * q[0]  # noqa: F821 -- the line


def parameter_as_name(q, p):
    return mass * q[0]  # noqa: F821 -- the line


def unknown_function(q, p, m):
    return m.sine(q[0])  # the line


def missing_argument(q, p, m):
    return m.sin() * q[0]  # the line


def nothing(q, p):
    q[0] + p[0]


def outside(q, p):
    return p[2]  # the line


def not_finite(q, p):
    return q[0] * float("nan")  # the line


def zero_division(q, p):
    return q[0] / 0  # the line


def symbol_from_elsewhere(q, p):
    return kept[0] * q[0]  # the line


def text(q, p):
    return q[0] + "1"  # the line


def python_error(q, p):
    return {}[1] * q[0]  # the line


def index_remainder(q, p, m):
    return m.sum(lambda i: q[(i + 1) % 2], range(2))  # the line


def index_comparison(q, p, m):
    return m.sum(lambda i: q[i] if i > 0 else 0, range(2))  # the line


def index_outside(q, p, m):
    return m.sum(lambda i: q[i + 1], range(2))  # the line


def index_negative(q, p, m):
    return m.sum(lambda i: q[i - 1], range(2))  # the line


def sum_of_a_list(q, p, m):
    return m.sum([q[0], q[1]])  # the line


def ragged_index(q, p, m):
    return m.sum(lambda i: q[i], [(0, 1), (1,)])  # the line


def fractional_index(q, p, m):
    return m.sum(lambda i: q[i], [0.5])  # the line


def both_halves(y, m):
    return m.sum(lambda i: y[i] ** 2, range(4))  # the line


def term_outside_its_sum(q, p, m):
    inside = []
    m.sum(lambda i: inside.append(q[i]) or q[i], range(2))
    return inside[0]


def terms_of_two_sums(q, p, m):
    inside = []
    m.sum(lambda i: inside.append(q[i]) or q[i], range(2))
    return m.sum(lambda i: inside[0] * q[i], range(1))  # the line


REFUSED: dict[Callable[..., Any], tuple[str, str]] = {
    vector: ("H returns 2 values, not one number", "return one scalar"),
    branch: ("branches on a symbol", "one formula for all states"),
    equality: ("branches on a symbol", "one formula"),
    truth: ("branches on a symbol", "one formula"),
    largest: ("branches on a symbol", "m.abs"),
    numpy_function: ("applies numpy's sin to a symbol", "use m.sin"),
    numpy_absolute: ("applies numpy's absolute to a symbol", "use m.abs"),
    numpy_dot: ("calculates with the whole vector p", "in components"),
    numpy_of_a_list: ("numpy array of symbols", "in components"),
    numpy_array: ("calculates with an array of shape (2,)", "in components"),
    math_function: ("needs the value of a symbol", "use m.sqrt"),
    whole_vectors: ("whole vector q", "in components"),
    mutation: ("changes its argument q", "x = list(q)"),
    increment: ("changes its argument q", "x = list(q)"),
    set_parameter: ("changes the parameter mass", "read only"),
    undeclared_parameter: ("unknown parameter 'mas'; did you mean 'mass'?", "parameters={'mas': value}"),
    undeclared_argument: ("asks for an argument 'omega'", "among m, p, par, q, t, y"),
    parameter_as_argument: ("asks for an argument 'mass'", "write par.mass"),
    undeclared_function: ("the name 'sqrt' is not known", "use m.sqrt"),
    undeclared_name: ("the name 'omega' is not known", "parameters={'omega': value}"),
    parameter_as_name: ("the name 'mass' is not known", "write par.mass"),
    unknown_function: ("unknown function 'm.sine'", "did you mean 'm.sin'"),
    nothing: ("H returns nothing", "return statement"),
    outside: ("p[2] does not exist", "0 to 1"),
    not_finite: ("the constant nan is not finite", "finite numbers"),
    zero_division: ("divides by the constant 0", "not zero"),
    symbol_from_elsewhere: ("belongs to another traced function", "do not keep symbols"),
    text: ("calculates with '1' as if it were one number", "in components"),
    python_error: ("H failed with KeyError", "1"),
    missing_argument: ("H failed with TypeError: m.sin() missing", "'x'"),
    index_remainder: ("does with its index more than q[a*i + b]", "for i in range(n)"),
    index_comparison: ("does with its index more than q[a*i + b]", "index list"),
    index_outside: ("q[2] does not exist", "0 to 1"),
    index_negative: ("q[-1] does not exist", "0 to 1"),
    sum_of_a_list: ("m.sum needs a term and an index list", "range(n)"),
    ragged_index: ("not a list of integers or of equally long tuples", "range(n)"),
    fractional_index: ("not a list of integers", "range(n)"),
    both_halves: ("positions and momenta at once", "use q[i] and p[i]"),
    term_outside_its_sum: ("returns a symbol of an m.sum's term", "return the sum itself"),
    terms_of_two_sums: ("mixes the terms of two sums", "inside its own term only"),
}


@pytest.mark.parametrize("function", REFUSED, ids=lambda function: function.__name__)
def test_what_cannot_be_traced_is_refused_with_line_and_remedy(function: Callable[..., Any]):
    if not kept:
        Hamiltonian(lambda q: kept.append(q[0]) or q[0], dof=1)
    said, remedy = REFUSED[function]
    with pytest.raises(InputError) as raised:
        Hamiltonian(function, dof=2, parameters={"mass": 1.0})
    message = str(raised.value)
    assert said in message
    assert remedy in message
    assert message.startswith("test_messages.py:")
    assert message.endswith(".") or function in (python_error, missing_argument)
    assert "\n" not in message
    assert ("the line" in message) == ("the line" in inspect.getsource(function))


def test_invariants_and_guards_are_refused_by_name():
    def H(p):
        return p[0] ** 2 / 2

    with pytest.raises(InputError, match="invariant 'L' returns nothing"):
        Hamiltonian(H, dof=1, invariants={"L": lambda q: None})
    with pytest.raises(InputError, match="invariant 'L' returns an empty list"):
        Hamiltonian(H, dof=1, invariants={"L": lambda q: []})
    with pytest.raises(InputError, match="guard 'g' returns 2 values"):
        Hamiltonian(H, dof=1, guards={"g": lambda q: [q[0], q[0]]})
    with pytest.raises(InputError, match="the invariant 'energy' is H itself"):
        Hamiltonian(H, dof=1, invariants={"energy": lambda q: q[0]})


@pytest.mark.parametrize(
    ("f", "said"),
    [
        (lambda t, y: y[0], "f returns one value, not a list of dim=2"),
        (lambda t, y: [y[0]], "f returns 1 values, not a list of dim=2"),
        (lambda t, q: [q[0], q[0]], "asks for an argument 'q'; name those it needs among m, par, t, y"),
        (lambda t, y: [y[0], None], "f's component 1 returns nothing"),
        (lambda t, y: np.array([y[0], y[1]]), "numpy array of symbols"),
    ],
)
def test_vector_fields_are_refused_with_their_line(f: Callable[..., Any], said: str):
    with pytest.raises(InputError) as raised:
        VectorField(f, dim=2)
    assert said in str(raised.value)
    assert str(raised.value).startswith("test_messages.py:")


def free(**options: Any) -> Hamiltonian:
    return Hamiltonian(lambda p: p[0] ** 2 / 2, dof=1, name="free", **options)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: load("sitnikof"), "unknown problem 'sitnikof'; did you mean 'sitnikov'"),
        (lambda: load("sitnikov", ee=1), "unknown argument of sitnikov 'ee'; did you mean 'e'"),
        (lambda: load("sitnikov", e=1.5), "e=1.5 of sitnikov must be an eccentricity"),
        (lambda: load("sitnikov", e="a"), "e='a' of sitnikov must be an eccentricity"),
        (lambda: load("sitnikov", d=-1.0), "must be a positive number"),
        (lambda: Hamiltonian(vector, dof=0), "dof=0 of .* must be a whole number"),
        (lambda: Hamiltonian(3, dof=1), "H must be a function, not 3"),  # type: ignore[arg-type]
        (lambda: free(parameters={"a b": 1.0}), "the parameter name 'a b' must be an identifier"),
        (lambda: free(parameters={"a": "x"}), "parameter 'a' is 'x'; give one finite number"),
        (lambda: free(parameters={"a": math.inf}), "one finite number"),
        (lambda: free(parameters={"a": 1.0}).pack({"b": 1.0}), "unknown parameter of free 'b'; known: a"),
        (lambda: free(parameters={"a": 1.0}).pack({"a": [1.0, 2.0]}), "'a' of free is one number, not 2"),
        (lambda: free(parameters={"a": [1.0]}).pack({"a": [1.0, 2.0]}), "'a' of free needs 1 numbers"),
        (lambda: Problem(3, y0=[1], t_end=1), "needs a Hamiltonian or a VectorField, not 3"),  # type: ignore[arg-type]
        (lambda: Problem(free(), q0=[0], t_end=1), "give the start as q0= and p0=.*got q0"),
        (lambda: Problem(free(), t_end=1), "got nothing"),
        (lambda: Problem(free(), q0=[0], p0=[1], v0=[1], t_end=1), "got q0, p0, v0"),
        (lambda: Problem(free(), q0=[0], p0=[math.nan], t_end=1), "p0 must be finite"),
        (lambda: Problem(free(), q0=[0], p0=[1, 2], t_end=1), "p0 must be a flat list of length 1"),
        (lambda: Problem(free(), q0=["a"], p0=[1], t_end=1), "q0 must be numbers"),
        (lambda: Problem(free(), q0=[0], p0=[1], t_end=math.nan), "t_end=nan of Problem must be a finite"),
        (
            lambda: Problem(Hamiltonian(lambda p: p[0] ** 4, dof=1), q0=[0], v0=[1], t_end=1),
            "v0= needs constant masses",
        ),
        (
            lambda: Problem(Hamiltonian(lambda q: q[0], dof=1), q0=[0], v0=[1], t_end=1),
            "does not depend on every momentum",
        ),
    ],
)
def test_bad_input_is_refused_in_one_sentence(make: Callable[[], Any], said: str):
    with pytest.raises(InputError, match=said) as raised:
        make()
    assert "\n" not in str(raised.value)


def test_a_message_does_not_write_out_a_million_numbers_to_show_eighty_characters():
    class Counted(float):
        def __repr__(self):
            written.append(self)
            return "1.0"

    written = []
    assert shown([Counted(1.0)] * 1_000_000).startswith("[1.0, 1.0, ")
    assert len(written) <= 100  # measured 80
    assert shown({"b": (1, "x"), "a": None}) == "{'a': None, 'b': (1, 'x')}"
    assert len(shown("x" * 1000)) == 80


def test_a_term_without_the_index_is_its_multiple():
    """Not one addition for each of them, which would be more operations than are compiled."""
    system = Hamiltonian(
        lambda q, p, m: p[0] ** 2 / 2 + m.sum(lambda i: q[0] ** 2, range(20_000)), dof=1, name="many"
    )
    assert targets.numpy(system, "field")(0.0, np.array([1.0, 0.0]), np.empty(0)).tolist() == [0.0, -40_000.0]
