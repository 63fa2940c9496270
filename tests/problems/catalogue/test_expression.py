"""Hamiltonians given as text: what is read, what is refused, and that nothing is ever run."""

import linecache
import math
import re
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import integrators
import problems
from hbvm_bench.campaign import file as campaign
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.run import loop
from problems import targets
from problems.analysis import structure
from problems.catalogue import expression
from problems.errors import InputError
from problems.graph.arguments import Mathematics
from problems.graph.nodes import PAR, Graph

_watched: list[str] | None = None


def _watch(event: str, arguments: tuple) -> None:
    if _watched is not None and event in ("exec", "import", "open", "os.system", "subprocess.Popen"):
        _watched.append(f"{event} {arguments!r}")


sys.addaudithook(_watch)  # cannot be taken off again; asleep unless a test wakes it
for _file in (__file__, expression.__file__):  # messages quote lines: read now, not while it is watched
    linecache.getlines(_file)


def _outcome(text: str):
    """Read and trace a text; nothing but `InputError` may come out, and nothing may be run."""
    global _watched
    graph = Graph(dof=1)
    symbols = Mathematics(graph)
    _watched = []
    try:
        read = expression.Formula(text)
        read.value(lambda word: graph.symbol("par", hash(word), flags=PAR), symbols)
    except InputError as error:
        message = str(error)
        assert "\n" not in message
        assert "cannot read the formula" in message or "too long" in message or "empty" in message
        return None
    finally:
        seen, _watched = _watched, None
        assert seen == [], seen
    values = {name: 1.5 for name in read.names if name != "t" and name not in read.coordinates}
    try:
        return expression.hamiltonian(text, parameters=values)
    except InputError as error:
        refused = str(error)
    assert "\n" not in refused
    return None


WORDS = "q1 p2 k pi sin sqrt( cos( log ** 0.5 1e3 1e400 3/2 == and if else lambda for in not True None"
MORE = "__class__ import // 0x1F f'{q}' := await yield *q"
SIGNS = "qpt2 +-*/^()[]{}'\",.:=<@\\#%|&~!j²é\x00_\n"
PIECES = st.sampled_from([*WORDS.split(), *MORE.split(), *SIGNS])
FUZZ = settings(deadline=None, suppress_health_check=list(HealthCheck), database=None)


def fuzz(few, many):
    """Parametrize a test by its number of examples: few, and many with the slow tests.

    1,100 in all, measured 1.5 s, and 10,500, measured 14 s.
    """
    return pytest.mark.parametrize("examples", [few, pytest.param(many, marks=pytest.mark.slow)])


@fuzz(500, 4500)
def test_any_mixture_of_pieces_is_read_or_refused_with_its_part(examples):
    @settings(FUZZ, max_examples=examples)
    @given(st.lists(PIECES, max_size=14).map("".join))
    def check(text):
        _outcome(text)

    check()


@fuzz(300, 3000)
def test_any_text_is_read_or_refused_with_its_part(examples):
    @settings(FUZZ, max_examples=examples)
    @given(st.text(max_size=60))
    def check(text):
        _outcome(text)

    check()


def _grown(children):
    numbers = st.sampled_from(["2", "0.5", "3", "(3/2)"])
    return st.one_of(
        st.tuples(children, st.sampled_from("+-*"), children).map(
            lambda x: (f"({x[0][0]} {x[1]} {x[2][0]})", _combined(x[1], x[0][1], x[2][1]))
        ),
        children.map(lambda x: (f"(-{x[0]})", lambda *a: -x[1](*a))),
        children.map(lambda x: (f"cos({x[0]})", lambda *a: math.cos(x[1](*a)))),
        children.map(lambda x: (f"sqrt(1 + {x[0]}^2)", lambda *a: math.sqrt(1 + x[1](*a) ** 2))),
        st.tuples(children, numbers).map(
            lambda x: (
                f"((2 + sin({x[0][0]}))^{x[1]})",
                lambda *a: (2 + math.sin(x[0][1](*a))) ** (1.5 if x[1] == "(3/2)" else float(x[1])),
            )
        ),
    )


def _combined(symbol, left, right):
    def value(*a):
        x, y = left(*a), right(*a)
        return x + y if symbol == "+" else x - y if symbol == "-" else x * y

    return value


LEAVES = st.sampled_from(
    [
        ("q1", lambda q, p, k: q[0]),
        ("p1", lambda q, p, k: p[0]),
        ("p2", lambda q, p, k: p[1]),
        ("k", lambda q, p, k: k),
        ("pi", lambda q, p, k: math.pi),
        ("0.75", lambda q, p, k: 0.75),
    ]
)


@fuzz(300, 3000)
def test_a_formula_means_what_it_says(examples):
    @settings(FUZZ, max_examples=examples)
    @given(st.recursive(LEAVES, _grown, max_leaves=8))
    def check(pair):
        text, value = pair
        text = f"({text}) + q2*p2*k"
        system = expression.hamiltonian(text, parameters={"k": 0.3})
        y = np.array([0.4, -0.7, 1.1, 0.2])
        found = targets.numpy(system, "hamiltonian")(0.0, y, system.pack())[0]
        expected = value(y[:2], y[2:], 0.3) + y[1] * y[3] * 0.3
        # Powers are expanded to products and half-integer ones to roots: measured 2e-14 relative.
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)

    check()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("__import__('os').system('true')", "system('true')` is not allowed"),
        ("q + __import__('os')", "calls an unknown function '__import__'"),
        ("q + __import__(q)", "unknown function '__import__'"),
        ("q.__class__", "`q.__class__` is not allowed"),
        ("p^2/2 + q.real", "`q.real` is not allowed; a formula has numbers"),
        ("eval('1')", "unknown function 'eval'"),
        ("[q for q in p]", "is not allowed"),
        ("sum(q for q in p)", "unknown function 'sum'"),
        ("(lambda: q)()", "is not allowed"),
        ("p^2 + (q if q else p)", "`q if q else p` is not allowed"),
        ("q[0]", "`q[0]` is not allowed"),
        ("q < p", "is not allowed"),
        ("q and p", "is not allowed"),
        ("not q", "is not allowed"),
        ("q @ p", "`q @ p` is not allowed"),
        ("(q := 2)", "is not allowed"),
        ("q; p", "it is not an expression"),
        ("1j*q", "`1j` is not allowed"),
        ("f'{q}'", "is not allowed"),
        ("True*q", "`True` is not allowed"),
        ("sin(q, p)", "`sin(q, p)` is wrong: sin takes 1 argument."),
        ("atan2(q)", "atan2 takes 2 arguments"),
        ("sin(x=q)", "is not allowed"),
        ("sin*q", "`sin` needs an argument"),
        ("sinn(q)", "did you mean 'sin'"),
        ("p^2 + q^9^9^9", "`9 ^ 9 ^ 9` is not a number that a double can hold"),
        ("q + (-8)^0.5", "is not a number that a double can hold"),
        ("p^2/2 + 1/0", "`1 / 0` divides by 0"),
        ("q + log(-1)", "`log(-1)` is not a number that a double can hold"),
        ("q*1e999", "not a number that a double can hold"),
        ("q*" + "9" * 400, "not a number that a double can hold"),
        ("10^100*10^100*10^100*10^100*q", "not a number that a double can hold"),
        ("2 q", "write products with *"),
        ("p^2/2 +", "it is not an expression"),
        ("q²", "it is not an expression"),
        ("   q$", "it is not an expression"),
        ("(" * 1500 + "q" + ")" * 1500, "it is not an expression"),
    ],
)
def test_what_is_not_a_formula_is_refused_with_its_part(text, reason):
    with pytest.raises(InputError) as caught:
        expression.hamiltonian(text)
    assert reason in str(caught.value)


def test_lengths_and_numbers_of_coordinates_are_bounded():
    with pytest.raises(InputError, match="too long; at most 4000"):
        expression.hamiltonian("q + " * 2000 + "p")
    with pytest.raises(InputError, match="empty formula"):
        expression.hamiltonian("   ")
    with pytest.raises(InputError, match="more than 100 degrees of freedom"):
        expression.hamiltonian("p1 + q101")
    long = " + ".join(["q*p"] * 600)
    assert expression.hamiltonian(long).field is not None


@pytest.mark.parametrize(
    ("text", "parameters", "reason"),
    [
        ("p^2/2 + k*q^2", {}, "contains 'k', which has no value; give it a value"),
        ("p^2/2 + q2^2", {}, "mixes 'p' with 'q2'"),
        ("3 + k", {"k": 1.0}, "contains no coordinate"),
        ("p^2/2", {"mass": 1.0}, "unknown parameter, not in the formula, 'mass'"),
        ("1e308*q^50", {}, "a double cannot hold"),
        ("1e308*(2*(1e308*q))", {}, "the constant inf is not finite; use finite numbers only."),
    ],
)
def test_what_is_missing_is_named(text, parameters, reason):
    with pytest.raises(InputError, match=re.escape(reason)):
        expression.hamiltonian(text, parameters=parameters)


def test_powers_bind_as_in_mathematics():
    system = expression.hamiltonian("-q^2 + 2*p**-1 + p^(1/2) - 2^0.5*q")
    value = targets.numpy(system, "hamiltonian")(0.0, np.array([3.0, 4.0]), system.pack())[0]
    assert value == pytest.approx(-9.0 + 0.5 + 2.0 - math.sqrt(2) * 3)
    assert expression.hamiltonian("p1^2/2 + q2").dof == 2


def test_formulas_have_the_operators_of_python_and_functions_of_two_arguments():
    system = expression.hamiltonian("p^2/2 + (2 + q^2)^0.3 + 2^q + q % 3 + atan2(q, p)")
    value = targets.numpy(system, "hamiltonian")(0.0, np.array([1.3, 0.4]), system.pack())[0]
    expected = 0.08 + 3.69**0.3 + 2**1.3 + 1.3 + math.atan2(1.3, 0.4)
    assert value == pytest.approx(expected, rel=1e-14)  # measured 2e-16


def test_time_and_parameters_and_invariants_can_be_given_as_text():
    driven = expression.hamiltonian("p^2/2 - cos(q) + a*q*sin(t)", parameters={"a": 0.1})
    assert structure.depends_on_time(driven)
    assert not driven.invariants
    central = expression.hamiltonian(
        "(p1^2 + p2^2)/2 - 1/sqrt(q1^2 + q2^2)", invariants={"turn": "q1*p2 - q2*p1"}
    )
    assert tuple(central.invariants) == ("energy", "turn")
    with pytest.raises(InputError, match="H has 1 degrees of freedom"):
        expression.hamiltonian("p^2 + q", invariants={"turn": "q2*p2"})


def test_a_problem_from_text_runs_prints_and_loads_again():
    text = 'expression(H="p^2/2 + k*q^4/4", q0=[1.0], p0=[0.0], parameters="k=2.0", t_end=10.0)'
    problem = make_problem(text)
    assert make_problem(repr(problem)) == problem
    found = integrators.integrate(problem, integrators.HBVM(k=4, s=2, h=0.1))
    # k = nu s/2 = 4 keeps the energy exactly: measured 4e-16.
    assert problem.errors(found.y)["energy"].max() <= 4e-15


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"parameters": "k=2"}, "unknown parameter"),
        ({"H": "p^2/2 + k*q", "parameters": "k"}, "write parameters as"),
        ({"H": "p^2/2 + k*q", "parameters": "k=inf"}, "write parameters as"),
        ({"H": "p^2/2 + k*q", "parameters": "k=1, k=2"}, "given twice"),
        ({"H": "p^2/2 + q", "parameters": "sin=1"}, "a meaning of its own"),
        ({"H": 3}, "must be text"),
        ({"H": "p^2", "parameters": 5}, "must be text"),
        ({"q0": [0.0, 1.0]}, "q0=[0.0, 1.0] of expression must be a list of 1"),
    ],
)
def test_a_problem_from_text_names_what_is_wrong(arguments, reason):
    with pytest.raises(InputError) as caught:
        problems.load("expression", **arguments)
    assert reason in str(caught.value)


def test_a_campaign_file_takes_a_hamiltonian_as_text(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        """
name = "mine"
title = "A system of my own"
problems = ["""
        + "\"expression(H='p^2/2 + k*q^4/4', q0=[1.0], p0=[0.0], parameters='k=2', t_end=5.0)\""
        + """]

[[methods]]
use = "HBVM(k=4, s=2, h=0.1)"
"""
    )
    (case,) = loop.plan(campaign.load(str(file)))
    assert case.problem.system.separable
    assert case.problem.par.tolist() == [2.0]
    file.write_text(file.read_text().replace("p^2/2", "p.x"))
    with pytest.raises(InputError, match=r"`p\.x` is not allowed"):
        loop.plan(campaign.load(str(file)))
