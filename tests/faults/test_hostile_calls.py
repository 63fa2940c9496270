"""Every public function with hostile values of every argument: one short sentence, or a result."""

import datetime
import fractions
import itertools
import random
import warnings

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, advise, integrate, integrate_many, load, order_of, stability
from problems import InputError


class Odd:
    """What has a broken repr, length and conversion."""

    def __repr__(self):
        raise RuntimeError("no repr")

    def __len__(self):
        raise RuntimeError("no length")


HOSTILE = [
    None,
    True,
    0,
    -1,
    1.5,
    10**400,
    -(10**30),
    float("nan"),
    float("inf"),
    1e308,
    5e-324,
    1j,
    "",
    "x" * 100_000,
    "nul\0byte",
    "\x1b[2J",
    b"bytes",
    [],
    [[]],
    [None],
    ["a"],
    [1, [2]],
    {},
    {"a": 1},
    {1: 2},
    set(),
    object(),
    Odd(),
    int,
    len,
    lambda: None,
    np.array(1.0),
    np.zeros((2, 3)),
    np.array(["a"]),
    np.array([1j]),
    np.array([None]),
    np.array([]),
    np.float64("nan"),
    datetime.datetime(2026, 1, 1),
    fractions.Fraction(1, 3),
    range(0),
]
pendulum = problems.load("pendulum")
SYSTEM = pendulum.system
METHOD = Gauss(s=2, h=0.1)
SOLUTION = integrate(pendulum, METHOD, [0.5, 1.0])
H = {"H": lambda q, p: p[0] ** 2 / 2 + q[0] ** 2, "dof": 1}
CALLS = {
    "integrate": (
        integrate,
        {
            "problem": pendulum,
            "method": METHOD,
            "times": [1.0],
            "sample": None,
            "events": (),
            "progress": False,
            "checkpoint": None,
            "every_seconds": 60.0,
            "resume": None,
        },
    ),
    "integrate_many": (
        integrate_many,
        {
            "problem": pendulum,
            "method": METHOD,
            "starts": [[0.1, 0.2]],
            "parameters": {},
            "times": [1.0],
            "threads": 1,
            "progress": False,
            "events": (),
            "backend": None,
        },
    ),
    "advise": (advise, {"problem": None, "accuracy": 0.0}),
    "compile": (METHOD.compile, {"system": SYSTEM}),
    "compile_adaptive": (HBVM().compile, {"system": SYSTEM}),
    "load": (load, {"path": "missing.npz", "problem": None}),
    "save": (SOLUTION.save, {"path": None}),
    "solution": (SOLUTION, {"t": 1.0}),
    "order_of": (order_of, {"method": METHOD}),
    "stability": (stability, {"method": METHOD, "z": 1j}),
    "Gauss": (Gauss, {"s": 2, "h": 0.1}),
    "HBVM": (HBVM, {"k": 4, "s": 2, "h": 0.1}),
    "problems.load": (problems.load, {"name": "pendulum"}),
    "Hamiltonian": (
        problems.Hamiltonian,
        {**H, "parameters": {}, "invariants": {}, "guards": {}, "name": None},
    ),
    "Problem": (
        problems.Problem,
        {
            "system": SYSTEM,
            "q0": [0.1],
            "p0": [0.2],
            "parameters": {},
            "t0": 0.0,
            "t_end": 1.0,
            "times": None,
        },
    ),
    "invariants": (pendulum.invariants, {"y": [[0.1, 0.2]], "t": None}),
    "errors": (pendulum.errors, {"y": [[0.1, 0.2]], "t": None}),
}
POSITIONAL = {"save", "solution", "order_of", "problems.load", "compile", "compile_adaptive"}


def cases():
    """Return every call with one argument that is hostile."""
    return [
        (name, argument, k)
        for name, (_, given) in CALLS.items()
        for argument, k in itertools.product(given, range(len(HOSTILE)))
        if not (argument == "progress" and callable(HOSTILE[k]))  # which is called, and may raise
    ]


def is_clean(name, arguments):
    """Call, and fail on anything but a result or a short sentence of an error that a user understands."""
    function = CALLS[name][0]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            function(*arguments.values()) if name in POSITIONAL else function(**arguments)
    except InputError as error:
        said = str(error)
    else:
        return
    assert len(said) < 1000, f"{name}: {len(said)} characters"
    assert not set(said) & {"\0", "\x1b"}, f"{name}: {said!r}"


def attempt(case):
    name, argument, k = case
    is_clean(name, {**CALLS[name][1], argument: HOSTILE[k]})


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("case", random.Random(5).sample(cases(), 250), ids=str)
def test_a_hostile_argument_gets_a_sentence(case):
    attempt(case)


@pytest.mark.slow
@pytest.mark.parametrize("case", cases(), ids=str)
def test_every_hostile_argument_gets_a_sentence(case):
    attempt(case)


def test_one_number_is_the_end():
    found = integrate(pendulum, METHOD, 10.0)
    assert (found.t.size, found.t[0], found.t[-1]) == (1001, pendulum.t0, 10.0)
    assert np.array_equal(integrate(pendulum, HBVM(), times=1.0).t, np.linspace(0.0, 1.0, 1001))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: integrate(SYSTEM, HBVM(), 10.0), "a system without a start"),
        (lambda: advise(SYSTEM), "a system without a start"),
        (lambda: advise("pendulum"), "problem must be a Problem, not 'pendulum'"),
        (lambda: HBVM().compile(pendulum), "takes a system, such as problem.system"),
        (lambda: integrate(pendulum, METHOD, checkpoint=3), "checkpoint=3 of integrate must be a path"),
        (lambda: integrate(pendulum, METHOD, resume="a\0b"), "resume=.* of integrate must be a path"),
        (lambda: SOLUTION.save(None), "path=None of save must be a path"),
        (lambda: stability(METHOD, "z"), "z='z' of stability must be complex numbers"),
    ],
)
def test_what_is_wrong_is_said(call, says):
    with pytest.raises(InputError, match=says):
        call()
