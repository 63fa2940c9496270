"""Errors of invariants: relative to the sum of absolute terms, of one start or of many."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import problems
from integrators import HBVM, Event, integrate, integrate_many
from problems import Hamiltonian, Problem
from problems.analysis import deviations
from problems.analysis.sizes import with_sizes
from problems.evaluate.pairs import evaluate

SYSTEM = Hamiltonian(
    lambda q, p, par: (p[0] ** 2 + p[1] ** 2) / (2 * par.mass) + par.k * (q[0] ** 2 + q[1] ** 2) / 2,
    dof=2,
    parameters={"mass": 1.0, "k": 1.0},
    invariants={
        "angular_momentum": lambda q, p: q[0] * p[1] - q[1] * p[0],
        "fradkin": lambda q, p, par: [p[0] * p[1] / par.mass + par.k * q[0] * q[1], q[0] ** 2, p[1] ** 2],
    },
    name="oscillator",
)
SCALES = (1.0, 1e150, 1e-80, 1e-150, 1e-170, 0.0)
"""The squares of the last but one are below the smallest double."""


@pytest.mark.parametrize("scale", SCALES)
def test_each_row_has_the_errors_that_it_has_alone(scale):
    rng = np.random.default_rng(3)
    n = 40
    y0 = scale * rng.normal(size=(n, 4))
    y = y0 * (1.0 + 1e-3 * rng.normal(size=(n, 4)))
    y0[:10, 2:] = y[:10, 2:] = 0.0  # no angular momentum
    y[20, 1] = np.nan
    par = rng.uniform(0.5, 2.0, size=(2, n))
    t0, t = rng.normal(size=n), rng.normal(size=n)
    owner = np.arange(n)
    together = deviations.errors(SYSTEM, par, y, t, starts=(t0, y0), owner=owner)
    for i in range(n):
        alone = deviations.errors(SYSTEM, par[:, i], y[i : i + 1], t[i : i + 1], starts=(t0[i], y0[i]))
        for name, errors in together.items():
            assert np.isnan(errors[i]) == np.isnan(alone[name][0]) == (i == 20), (name, i)
            # measured 4e-16: norms of vectors are added up in another order
            assert i == 20 or abs(errors[i] - alone[name][0]) <= 1e-15 * abs(alone[name][0]), (name, i)


@pytest.mark.parametrize("scale", SCALES[:-1])
def test_errors_do_not_depend_on_the_unit(scale):
    rng = np.random.default_rng(4)
    y0, par = rng.normal(size=4), np.array([1.0, 1.0])
    y = y0 * (1.0 + 1e-3 * rng.normal(size=(20, 4)))
    y[:, 0] = y0[0]  # so that rounding of the scaled states is the only difference
    wanted = deviations.errors(SYSTEM, par, y, None, starts=(0.0, y0))
    found = deviations.errors(SYSTEM, par, scale * y, None, starts=(0.0, scale * y0))
    for name in wanted:
        # Measured 1.2e-12: differences of 1e-3 of states that were rounded.
        assert found[name] == pytest.approx(wanted[name], rel=1e-11)


def sizes_at(system, y):
    function = system.invariants["energy"]
    values = evaluate(with_sizes(function), 0.0, np.asarray(y, float).reshape(-1, 1), system.pack())
    return [float(value.rounded()[0]) for value in values]


@pytest.mark.parametrize(
    ("H", "terms"),
    [
        (lambda q, p, m: p[0] ** 2 / 2 - m.cos(q[0]), [0.18, math.cos(0.4)]),
        (lambda q, p, m: (p[0] ** 2 - 2 * m.cos(q[0])) / 2 + 7, [0.18, math.cos(0.4)]),
        (lambda q, p, par: -par.k * (p[0] ** 2 - q[0]) / par.k, [0.36, 0.4]),
        (lambda q, p: (q[0] - p[0]) ** 2 - q[0] * p[0], [0.04, 0.24]),
        (lambda q, p, m: m.where(q[0] > p[0], 5.0, q[0] - p[0]), [0.4, 0.6]),
        (lambda q, p, m: m.sum(lambda i: q[i] - 3 * p[i], range(1)) + m.sqrt(q[0] + p[0]), [0.4, 1.8, 1.0]),
        (lambda q, p: 3.0, []),
    ],
)
def test_the_terms_are_those_that_are_written(H, terms):
    system = Hamiltonian(H, dof=1, parameters={"k": 3.0})
    assert sizes_at(system, [0.4, 0.6])[1] == pytest.approx(math.fsum(terms), rel=1e-15)


FACTORS = {
    "q0": lambda q, p, m: q[0],
    "p1": lambda q, p, m: p[1],
    "difference": lambda q, p, m: (q[0] - q[1]) ** 3,
    "cosine": lambda q, p, m: m.cos(q[1]),
    "inverse": lambda q, p, m: 1 / (1 + q[0] ** 2),
    "square": lambda q, p, m: p[0] ** 2,
}


class Numeric:
    cos = staticmethod(np.cos)


@st.composite
def sums(draw):
    """Return terms, each a coefficient and factors, and where groups of them are multiplied by a number."""
    term = st.tuples(
        st.floats(-5.0, 5.0).filter(bool), st.lists(st.sampled_from(sorted(FACTORS)), min_size=1, max_size=3)
    )
    return draw(
        st.lists(
            st.tuples(st.floats(0.5, 2.0), st.lists(term, min_size=1, max_size=4)), min_size=1, max_size=3
        )
    )


def _check_sizes(groups, y):
    def products(q, p, m):
        return [
            [c * math.prod((FACTORS[name](q, p, m) for name in names), start=1.0) for c, names in terms]
            for _, terms in groups
        ]

    def H(q, p, m):
        total = 1.5
        for (factor, _), values in zip(groups, products(q, p, m), strict=True):
            inside = values[0]
            for value in values[1:]:
                inside = inside - value
            total = total + factor * inside
        return total

    wanted = sum(
        factor * abs(value)
        for (factor, _), values in zip(groups, products(y[:2], y[2:], Numeric), strict=True)
        for value in values
    )
    # Equal formulas are one node, so c*x - c*x is written, but 0*x is not.
    found = sizes_at(Hamiltonian(H, dof=2), y)
    assert found[1] == pytest.approx(wanted, rel=1e-13, abs=1e-300)
    assert abs(found[0] - 1.5) <= found[1] * (1 + 1e-13) + 1e-15  # of the constant


STATES = st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4)


@settings(max_examples=20, deadline=None)
@given(sums(), STATES)
def test_sizes_of_some_sums(groups, y):
    _check_sizes(groups, y)


@pytest.mark.slow
@settings(max_examples=2000, deadline=None)
@given(sums(), STATES)
def test_sizes_of_many_sums(groups, y):
    _check_sizes(groups, y)


class TestWhereTheInitialValueCancels:
    def test_a_pendulum_from_the_horizontal(self):
        system = Hamiltonian(
            lambda q, p, m, par: p[0] ** 2 / 2 - par.g * m.cos(q[0]), dof=1, parameters={"g": 9.81}
        )
        solution = integrate(Problem(system, q0=[np.pi / 2], p0=[0.0], t_end=20.0), HBVM())
        # Measured 1.5e-16; relative to the initial energy it was 2.4.
        assert solution.errors()["energy"].max() < 1e-15
        assert "energy" in str(solution)

    def test_a_parabola(self):
        parabola = Problem(
            problems.load("kepler").system, q0=[1.0, 0.0], p0=[0.0, math.sqrt(2.0)], t_end=100.0
        )
        # Measured 9.4e-17.
        assert integrate(parabola, HBVM()).errors()["energy"].max() < 1e-15

    @pytest.mark.parametrize("seed", range(20))
    def test_random_starts_of_energy_zero(self, seed):
        rng = np.random.default_rng(seed)
        a, b, c = rng.uniform(0.5, 2.0, 3)
        system = Hamiltonian(
            lambda q, p, m: a * p[0] ** 2 / 2 + b * p[1] ** 2 / 2 - c * m.cos(q[0]) - m.cos(q[1] - q[0]),
            dof=2,
        )
        q = rng.uniform(-1.0, 1.0, 2)
        depth = c * math.cos(q[0]) + math.cos(q[1] - q[0])
        p = rng.normal(size=2)
        p *= math.sqrt(max(depth, 0.0) / (a * p[0] ** 2 / 2 + b * p[1] ** 2 / 2))
        solution = integrate(Problem(system, q0=q, p0=p, t_end=5.0), HBVM(), np.linspace(0.0, 5.0, 11))
        # Measured 3.5e-16.
        assert solution.errors()["energy"].max() < 2e-15


class TestEnsembles:
    def problem(self):
        return Problem(
            Hamiltonian(lambda q, p, par: p[0] ** 2 / 2 + par.g * q[0], dof=1, parameters={"g": 1.0}),
            q0=[1.0], p0=[0.0], t_end=3.0,
        )  # fmt: skip

    @pytest.mark.parametrize("bounces", [False, True])
    def test_they_have_the_errors_of_their_trajectories(self, bounces):
        bounce = Event(lambda q: q[0], name="floor", direction=-1, then=lambda y: [y[0], -0.7 * y[1]])
        starts = np.column_stack([np.linspace(0.5, 2.0, 7), np.linspace(-1.0, 1.0, 7)])
        many = integrate_many(
            self.problem(), HBVM(), starts=starts, times=[1.0, 2.0, 3.0],
            parameters={"g": np.linspace(1.0, 2.0, 7)}, events=[bounce] if bounces else [],
        )  # fmt: skip
        errors, values = many.errors()["energy"], many.invariants()["energy"]
        assert errors.shape == values.shape == (7, 3)
        for i, one in enumerate(many):
            assert one.errors()["energy"].tolist() == errors[i].tolist()
            assert one.invariants()["energy"].tolist() == values[i].tolist()
        assert errors.max() < 1e-13  # measured 7e-16

    def test_a_thousand_cost_less_than_fifty_evaluations_of_one(self):
        problem = problems.load("kepler", e=0.3, t_end=1.0)
        many = integrate_many(problem, HBVM(), starts=np.tile(problem.y0, (1000, 1)), times=[1.0])
        one, both = many[0], []
        from problems.analysis import invariants

        original = invariants.evaluate
        try:
            invariants.evaluate = lambda *given: both.append(1) or original(*given)
            one.errors()
            alone = len(both)
            many.errors()
        finally:
            invariants.evaluate = original
        assert len(both) == 2 * alone
