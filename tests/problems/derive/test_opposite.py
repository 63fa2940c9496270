"""Formulas that are minus one another are recognised, however the minus is written."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from problems import InputError, Poisson, VectorField, targets
from problems.derive.opposite import opposite

VARIABLES = 3
STATES = np.random.default_rng(4).uniform(-2.0, 2.0, (VARIABLES, 30))


@st.composite
def formulas(draw, depth=4):
    """Return a formula as nested tuples."""
    if depth == 0 or draw(st.integers(0, 4)) == 0:
        return draw(st.one_of(st.integers(0, VARIABLES - 1), st.sampled_from([0.5, 2.0, -3.0, 0.1])))
    kind = draw(st.sampled_from(["+", "-", "*", "/", "where", "sin", "pow"]))
    if kind == "pow":
        return kind, draw(formulas(depth - 1)), draw(st.integers(2, 5))
    parts = {"sin": 1, "where": 3}.get(kind, 2)
    return kind, *(draw(formulas(depth - 1)) for _ in range(parts))


def value(e, y, m):
    if isinstance(e, int):
        return y[e]
    if isinstance(e, float):
        return e
    kind, *parts = e
    if kind == "pow":
        return value(parts[0], y, m) ** parts[1]
    a, *others = (value(part, y, m) for part in parts)
    match kind:
        case "sin":
            return m.sin(a)
        case "where":
            return m.where(y[0] > a, *others)
        case "/":
            return a / (3.0 + others[0] * others[0])
    return {"+": lambda x, z: x + z, "-": lambda x, z: x - z, "*": lambda x, z: x * z}[kind](a, others[0])


def minus(e, y, m, draw):
    """Return minus the value, written in some way that rounds alike."""
    if isinstance(e, int | float) or e[0] == "sin" or draw(st.integers(0, 3)) == 0:
        return -value(e, y, m)
    kind, *parts = e
    if kind == "pow":
        odd = parts[1] % 2 == 1
        return minus(parts[0], y, m, draw) ** parts[1] if odd else -value(e, y, m)
    if kind == "where":
        return m.where(y[0] > value(parts[0], y, m), *(minus(part, y, m, draw) for part in parts[1:]))
    a, b = parts
    first = draw(st.booleans())
    match kind:
        case "+":
            x, z = minus(a, y, m, draw), minus(b, y, m, draw)
            return x + z if first else z + x
        case "-":
            return value(b, y, m) - value(a, y, m) if first else minus(a, y, m, draw) + value(b, y, m)
        case "*":
            x, z = minus(a, y, m, draw), value(b, y, m)
            return x * z if first else z * x
    below = value(b, y, m)
    return minus(a, y, m, draw) / (3.0 + below * below)


def mutated(e, draw):
    """Return a formula of the same form in which a place or two may be another."""
    if isinstance(e, int | float):
        return draw(st.sampled_from([e, e, e, 0, 1, 2, 0.5, -0.5, 2.0]))
    kind, *parts = e
    if kind in "+-*/":
        kind = draw(st.sampled_from([kind] * 8 + [*"+-*/"]))
    if kind == "pow":
        return kind, mutated(parts[0], draw), parts[1] + draw(st.sampled_from([0, 0, 0, 1]))
    if len(parts) == 2 and draw(st.integers(0, 3)) == 0:
        parts = parts[::-1]
    return kind, *(mutated(part, draw) for part in parts)


class TestSearch:
    @settings(max_examples=60, deadline=None)
    @given(formulas(), st.data())
    def test_whatever_rounds_to_minus_the_other_is_seen(self, e, data):
        try:
            Poisson(
                lambda y: y[0],
                lambda y, m: [[0, value(e, y, m), 0], [minus(e, y, m, data.draw), 0, 0], [0, 0, 0]],
                dim=VARIABLES,
            )
        except InputError as error:  # powers of constants may overflow
            if "skew" in str(error):
                raise

    @pytest.mark.slow
    @settings(max_examples=2000, deadline=None)
    @given(formulas(), st.data())
    def test_what_is_seen_is_true(self, e, data):
        self._compared(e, data.draw)

    @settings(max_examples=60, deadline=None)
    @given(formulas(depth=2), st.data())
    def test_what_is_seen_is_true_of_small_ones(self, e, data):
        self._compared(e, data.draw)

    @staticmethod
    def _compared(e, draw):
        other = mutated(e, draw)
        try:
            system = VectorField(lambda y, m: [value(e, y, m), minus(other, y, m, draw), y[2]], dim=VARIABLES)
        except InputError:
            return
        (a,), (b,), _ = system.field.outputs
        if opposite([(a.node, b.node)]) == [True]:
            first, second, _ = targets.numpy(system, "field")(0.0, STATES, np.empty(0))
            assert np.array_equal(first, -second, equal_nan=True)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (lambda y: -1 / (1 + y[0] ** 2), lambda y: 1 / (1 + y[0] ** 2)),
        (lambda y: y[0] - y[1], lambda y: y[1] - y[0]),
        (lambda y: -2 * y[0], lambda y: 2 * y[0]),
        (lambda y: -y[0] - y[1], lambda y: y[1] + y[0]),
        (lambda y: y[0] * (y[1] - 1) / 3, lambda y: (1 - y[1]) * y[0] / 3),
        (lambda y: 0.0, lambda y: -0.0),
    ],
)
def test_a_structure_matrix_may_have_both(a, b):
    system = Poisson(lambda y, m: m.cos(y[0]) + m.sin(y[1]), lambda y: [[0, a(y)], [b(y), 0]], dim=2)
    y = np.array([0.3, 0.8])
    B = targets.numpy(system, system.structure)(0.0, y, system.pack()).reshape(2, 2)
    assert (B == -B.T).all()


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (lambda y: -1 / (1 + y[0] ** 2), lambda y: 1 / (1 + y[1] ** 2)),
        (lambda y: y[0] + y[1], lambda y: y[0] - y[1]),
        (lambda y: y[0] ** 2, lambda y: (-y[0]) ** 2),
    ],
)
def test_a_structure_matrix_with_others_is_refused(a, b):
    with pytest.raises(InputError, match="not skew-symmetric as it is written"):
        Poisson(lambda y, m: m.cos(y[0]) + m.sin(y[1]), lambda y: [[0, a(y)], [b(y), 0]], dim=2)
