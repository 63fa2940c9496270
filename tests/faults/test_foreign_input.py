"""Input that is more than numbers is refused with the fix, and a formula that is not the same twice."""

import itertools
import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import problems
from integrators import HBVM, Event, integrate, integrate_many
from problems import Hamiltonian, InputError, Opaque, Problem, VectorField

SYSTEM = Hamiltonian(
    lambda q, p, par: (p[0] ** 2 + par.k * q[0] ** 2) / 2, dof=1, parameters={"k": 1.0}, name="spring"
)
PROBLEM = Problem(SYSTEM, q0=[1.0], p0=[0.0], t_end=1.0)


class Lengths(np.ndarray):
    """As astropy's quantities: a subclass of ndarray."""

    unit = "km"

    def __new__(cls, values):
        return np.asarray(values, float).view(cls)


class Speed:
    """As pint's: no array, but made into one by NumPy."""

    units = "m/s"

    def __init__(self, values):
        self.values = values

    def __float__(self):
        return float(self.values)

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.values, dtype)


class Other(np.ndarray):
    """Some other subclass."""


FOREIGN = {
    "astropy": (Lengths, "has the unit km.*to_value"),
    "pint": (Speed, "has the unit m/s.*m_as"),
    "masked": (np.ma.array, r"is a masked array.*\.filled"),
    "complex": (lambda x: np.asarray(x) + 0j, r"is complex.*real and imaginary parts"),
    "boolean": (lambda x: np.asarray(x) > 0.0, "has True or False"),
    "subclass": (lambda x: np.asarray(x, float).view(Other), "is a Other.*np.asarray"),
}

PLACES = {
    "q0": lambda of: Problem(SYSTEM, q0=of([1.0]), p0=[0.0], t_end=1.0),
    "y0": lambda of: Problem(SYSTEM, y0=of([1.0, 0.0]), t_end=1.0),
    "parameter": lambda of: Problem(SYSTEM, q0=[1.0], p0=[0.0], t_end=1.0, parameters={"k": of(2.0)}),
    "times": lambda of: integrate(PROBLEM, HBVM(), of([0.5, 1.0])),
    "one time": lambda of: integrate(PROBLEM, HBVM(), of(1.0)),
    "dense": lambda of: integrate(PROBLEM, HBVM(), [1.0])(of(0.5)),
    "starts": lambda of: integrate_many(PROBLEM, HBVM(), starts=of([[1.0, 0.0]]), times=[1.0]),
    "values": lambda of: integrate_many(PROBLEM, HBVM(), parameters={"k": of([1.0, 2.0])}, times=[1.0]),
    "masses": lambda of: problems.nbody(of([1.0, 0.1]), np.eye(2, 3), np.zeros((2, 3)), t_end=1.0),
    "positions": lambda of: problems.nbody([1.0, 0.1], of(np.eye(2, 3)), np.zeros((2, 3)), t_end=1.0),
    "derivative": lambda of: integrate(
        Problem(Opaque(lambda t, y: of([1.0]), dim=1), y0=[1.0], t_end=1.0), HBVM(), [1.0]
    ),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", FOREIGN)
def test_what_is_more_than_numbers_is_refused_with_the_fix(kind, place):
    make, message = FOREIGN[kind]
    with pytest.raises(InputError, match=message):
        PLACES[place](make)


ONE = {
    "t0": lambda x: Problem(SYSTEM, q0=[1.0], p0=[0.0], t0=x, t_end=1.0),
    "t_end": lambda x: Problem(SYSTEM, q0=[1.0], p0=[0.0], t_end=x),
    "tol": lambda x: HBVM(tol=x),
}


@pytest.mark.parametrize("kind", [kind for kind in FOREIGN if kind != "boolean"])
@pytest.mark.parametrize("place", ONE)
def test_one_number_too(kind, place):
    make, message = FOREIGN[kind]
    value = make(0.5)
    with pytest.raises(InputError, match=message):
        ONE[place](value)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(
    "make",
    [
        np.array,
        lambda x: np.asarray(x, np.float32),
        lambda x: np.asarray(x).tolist(),
        lambda x: np.float64(x),
    ],
    ids=["array", "float32", "list", "numpy"],
)
def test_numbers_are_not_refused(place, make):
    PLACES[place](make)


@st.composite
def nested(draw):
    """Return numbers, and the same with one of them replaced by something else."""
    values = draw(st.lists(st.floats(-10.0, 10.0) | st.integers(-5, 5), min_size=2, max_size=5))
    place = draw(st.integers(0, len(values) - 1))
    wrong = draw(
        st.sampled_from([Speed(1.0), Lengths(1.0), 1j, True, np.True_, np.complex128(1.0), np.ma.masked])
    )
    return values, [wrong if i == place else x for i, x in enumerate(values)]


@given(nested(), st.booleans())
@settings(max_examples=60, deadline=None)
def test_one_foreign_number_among_others_is_found(lists, as_tuple):
    good, bad = lists
    system = VectorField(lambda y: list(y), dim=len(good))
    Problem(system, y0=tuple(good) if as_tuple else good, t_end=1.0)
    with pytest.raises(InputError, match=r"unit|complex|True or False|masked"):
        Problem(system, y0=tuple(bad) if as_tuple else bad, t_end=1.0)


def test_a_complex_number_in_a_formula_is_refused():
    with pytest.raises(InputError, match=r"complex number.*real and imaginary parts"):
        VectorField(lambda y: [-1j * y[0]], dim=1)


class TestFormulasThatChange:
    def test_random_numbers(self):
        with pytest.raises(InputError, match=r"f is another formula.*random numbers.*parameters"):
            VectorField(lambda y: [random.random() * y[0]], dim=1)

    def test_a_counter(self):
        count = itertools.count()
        with pytest.raises(InputError, match="another formula when it is called again"):
            Hamiltonian(lambda q, p: p[0] ** 2 / 2 + q[0] ** 2 * next(count), dof=1)

    def test_in_an_event_it_is_called_with_numbers(self):
        count = itertools.count()
        event = Event(lambda y: y[0] - 0.5 + 0.0 * next(count), name="half")
        solution = integrate(
            Problem(VectorField(lambda y: [-1.0], dim=1), y0=[1.0], t_end=1.0), HBVM(), events=event
        )
        assert solution.events["half"].t == pytest.approx([0.5], abs=1e-14)

    def test_a_formula_with_loops_and_lists_is_the_same_twice(self):
        def f(t, y, m):
            dy = [-y[i] for i in range(3)]
            dy[1] = dy[1] + m.table(t, [0, 1, 2, 3], [0, 1, 0, 1])
            return dy

        assert VectorField(f, dim=3).dim == 3


class TestScipysEvents:
    FALL = Problem(VectorField(lambda y: [y[1], -9.81], dim=2), y0=[1.0, 0.0], t_end=3.0)

    def ground(self, **attributes):
        def ground(t, y):
            return y[0]

        for name, value in attributes.items():
            setattr(ground, name, value)
        return ground

    @pytest.mark.parametrize("wrapped", [False, True])
    def test_terminal_and_direction_are_taken_over(self, wrapped):
        ground = self.ground(terminal=True, direction=-1.0)
        solution = integrate(self.FALL, HBVM(), events=Event(ground) if wrapped else ground)
        assert solution.status == "event"
        # Measured 0.
        assert abs(solution.t_stop - math.sqrt(2.0 / 9.81)) < 1e-14

    def test_the_other_direction_is_not_seen(self):
        solution = integrate(self.FALL, HBVM(), events=self.ground(terminal=True, direction=1))
        assert solution.status == "finished"
        assert not len(solution.events["ground"])

    def test_two_that_contradict_each_other_are_refused(self):
        with pytest.raises(InputError, match="direction=-1 and the event direction=1"):
            Event(self.ground(direction=-1), direction=1)


class TestOpaqueFields:
    @staticmethod
    def run(f):
        return integrate(Problem(Opaque(f, dim=2), y0=[1.0, 0.0], t_end=1.0), HBVM(), [1.0])

    def test_a_component_that_was_not_written(self):
        def f(t, y, dy):
            dy[0] = y[1]

        with pytest.raises(InputError, match=r"f has not written dy\[1\].*all 2 derivatives"):
            self.run(f)

    def test_an_array_that_was_rebound(self):
        def f(t, y, dy):
            dy = [y[1], -y[0]]  # noqa: F841

        with pytest.raises(InputError, match=r"f has not written dy\[0\]"):
            self.run(f)

    def test_a_third_argument_that_is_something_else(self):
        with pytest.raises(
            InputError, match=r"takes a third argument, which is the array for the derivative"
        ):
            self.run(lambda t, y, k: [y[1], -y[0]])

    def test_too_few_values(self):
        with pytest.raises(InputError, match=r"array of shape \(1,\), not \(2,\)"):
            self.run(lambda t, y: [y[1]])

    def test_a_field_that_writes_nan_is_not_finite(self):
        def f(t, y, dy):
            dy[:] = [y[1], math.nan]

        assert self.run(f).status == "not_finite"
