"""What a decorated function makes of its own signature."""

import math
import pickle
from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
import pytest

from problems import Hamiltonian, InputError, Problem, UnknownNameError
from problems.checks import Must, Positive, at_least
from problems.entry import entry

Pair = Annotated[Sequence[float], Must("a list of 2 finite numbers", lambda values: len(values) == 2)]


@entry(title="an oscillator", references=("a book",), notes="Swings.", shows=("n", "k"))
def oscillator(
    *,
    k: Positive = 1.0,
    n: Annotated[int, at_least(2)] = 2,
    start: Pair = (0.0, 1.0),
    kind: Literal["soft", "hard"] = "soft",
    order: Literal[4, 2] = 4,
    share: Annotated[float, Must("a number between 0 and 1", lambda x: 0 < x < 1)] | None = None,
    label: str = "",
    whole: int = 1,
    extra: Any = None,
    t_end: float = 1.0,
) -> Problem:
    """Return an oscillator."""
    system = Hamiltonian(
        lambda q, p, par: p[0] ** 2 / 2 + par.k * q[0] ** 2 / 2, dof=1, parameters={"k": 1.0}
    )
    assert isinstance(start, tuple)
    return Problem(system, q0=[start[0]], p0=[start[1]], parameters={"k": k}, t_end=t_end)


def test_a_problem_prints_what_is_always_shown_and_what_was_changed():
    assert repr(oscillator()) == "oscillator(n=2, k=1.0)"
    assert repr(oscillator(t_end=2.0, kind="hard", k=3)) == "oscillator(n=2, k=3, kind='hard', t_end=2.0)"
    assert repr(oscillator(start=[1, 2])) == "oscillator(n=2, k=1.0, start=(1.0, 2.0))"
    assert repr(oscillator(share=None, kind="soft", t_end=1.0)) == "oscillator(n=2, k=1.0)"


def test_a_problem_says_what_its_decorator_says():
    problem = oscillator()
    assert (problem.name, problem.title) == ("oscillator", "an oscillator")
    assert (problem.references, problem.notes) == (("a book",), "Swings.")
    assert oscillator() == problem != oscillator(kind="hard")


def test_without_a_title_the_problem_keeps_its_own():
    @entry(title=None, references=(), notes="")
    def titled(*, t_end: float = 1.0) -> Problem:
        return Problem(Hamiltonian(lambda p: p[0], dof=1), q0=[0.0], p0=[0.0], t_end=t_end, title="mine")

    assert titled().title == "mine"


def test_a_decorated_function_is_still_that_function():
    assert oscillator.__doc__ == "Return an oscillator."
    assert (oscillator.__module__, oscillator.__name__) == (__name__, "oscillator")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"k": 0}, "k=0 of oscillator must be a positive number."),
        ({"k": "1"}, "k='1' of oscillator must be a positive number."),
        ({"k": math.nan}, "k=nan of oscillator must be a positive number."),
        ({"k": True}, "k=True of oscillator must be a positive number."),
        ({"k": 10**400}, "k=about 1e400 of oscillator must be a positive number."),
        ({"n": 1}, "n=1 of oscillator must be a whole number of at least 2."),
        ({"n": 2.0}, "n=2.0 of oscillator must be a whole number of at least 2."),
        ({"n": None}, "n=None of oscillator must be a whole number of at least 2."),
        ({"whole": True}, "whole=True of oscillator must be a whole number."),
        ({"start": [1.0]}, "start=[1.0] of oscillator must be a list of 2 finite numbers."),
        ({"start": "ab"}, "start='ab' of oscillator must be a list of 2 finite numbers."),
        ({"start": [1.0, math.inf]}, "start=[1.0, inf] of oscillator must be a list of 2 finite numbers."),
        ({"order": 3}, "order=3 of oscillator must be one of 4, 2."),
        ({"order": 4.0}, "order=4.0 of oscillator must be one of 4, 2."),
        ({"order": True}, "order=True of oscillator must be one of 4, 2."),
        ({"order": np.zeros(2)}, "order=array([0., 0.]) of oscillator must be one of 4, 2."),
        ({"share": 1}, "share=1 of oscillator must be a number between 0 and 1."),
        ({"label": 3}, "label=3 of oscillator must be text."),
        ({"t_end": None}, "t_end=None of oscillator must be a finite number."),
    ],
)
def test_a_value_that_its_annotation_does_not_allow_is_refused(arguments, message):
    with pytest.raises(InputError) as caught:
        oscillator(**arguments)
    assert str(caught.value) == message


def test_what_is_not_annotated_with_a_kind_is_passed_on():
    assert repr(oscillator(extra=[1])) == "oscillator(n=2, k=1.0, extra=[1])"


def test_words_and_names_are_refused_with_the_nearest():
    with pytest.raises(UnknownNameError, match="unknown kind of oscillator 'sofd'; did you mean 'soft'"):
        oscillator(kind="sofd")
    with pytest.raises(UnknownNameError, match="unknown argument of oscillator 'knd'; did you mean 'kind'"):
        oscillator(knd="soft")
    with pytest.raises(InputError, match="oscillator takes its arguments by name"):
        oscillator(1.0)


def by_place(k: float = 1.0) -> Any:
    """Return no problem."""


def by_name(*, k: float = 1.0) -> Any:
    """Return no problem."""


@pytest.mark.parametrize(
    ("words", "make", "message"),
    [
        ({"references": "a book"}, by_name, "references='a book' of entry must be a list of texts."),
        ({"title": 3}, by_name, "title=3 of entry must be text."),
        ({"shows": ("j",)}, by_name, "unknown argument of by_name in shows 'j'; known: k."),
        ({}, by_place, "k of by_place must be taken by name; write def by_place(*, ...)."),
        ({}, by_name, "by_name must return a problems.Problem, not None."),
    ],
)
def test_a_decorator_that_is_misused_says_how(words, make, message):
    with pytest.raises(InputError) as caught:
        entry(**{"title": "x", "references": (), "notes": "", **words})(make)()
    assert str(caught.value) == message


def test_a_decorated_function_can_be_sent_to_another_process():
    from problems.catalogue.kepler import kepler

    assert pickle.loads(pickle.dumps(kepler)) is kepler
