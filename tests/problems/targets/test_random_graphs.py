"""Every emitted text against the graph's own evaluation, on random graphs: loops, tables, Jacobians."""

import math
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from problems import Hamiltonian, System, VectorField, targets
from problems.analysis.invariants import evaluate
from problems.derive.function import Function
from problems.derive.jacobian import Jacobian
from problems.targets import called, printer

DIM = 6
KNOTS, VALUES = [-2.0, -1.0, 0.3, 1.0, 2.0], [0.0, 1.0, -0.5, 0.2, 0.7]
PARAMETERS = {"a": 0.7, "w": [1.5, -0.4, 0.9, 0.2, -1.1, 0.6]}


def index_lists(r: Random, n: int) -> list[Any]:
    """Return lists of every kind that becomes a loop of its own form."""
    return [
        range(n),
        range(1, n, 2),
        [(i, j) for i in range(n) for j in range(i)],  # two nested ranges
        [(i, j) for i in range(n) for j in range(i + 1, n)],
        [(i, j) for i in range(2) for j in range(n)],
        [(i, (i + 1) % n) for i in range(n)],  # a chain: two ranges
        [(r.randrange(n), r.randrange(n)) for _ in range(r.randint(5, 12))],  # read from a table
        [tuple(r.randrange(n) for _ in range(3)) for _ in range(6)],
    ]


class Expressions:
    """Random formulas whose values stay near 1, so that rounding is never amplified much."""

    def __init__(self, r: Random, leaves: list[Callable[[], Any]], m: Any, *, tables: bool) -> None:
        self.r, self.leaves, self.m, self.tables = r, leaves, m, tables

    def tree(self, depth: int) -> Any:
        r, m = self.r, self.m
        if depth == 0 or r.random() < 0.15:
            return r.choice(self.leaves)()
        x = self.tree(depth - 1)
        match r.randrange(14):
            case 0:
                return m.sin(x)
            case 1:
                return m.tanh(x)
            case 2:
                return m.sqrt(x * x + 1.0)
            case 3 | 4 | 5 if self.tables:
                return m.table(x, KNOTS, VALUES)
            case 6:
                return m.tanh(x) ** 3
            case 7:
                return m.where(x > 0.1, m.cos(x), x * 0.5 + 0.9)
            case 8:
                return -x
        y = self.tree(depth - 1)
        match r.randrange(5):
            case 0:
                return x + y
            case 1:
                return x - y
            case 2:
                return x / (2.0 + y * y)
            case 3:
                return m.atan2(x, 2.0 + m.abs(y))
            case _:
                return m.tanh(x) * y


def random_system(r: Random, *, tables: bool) -> System:
    """Return a Hamiltonian or a vector field of sums over lists and of formulas beside them."""
    hamiltonian = r.random() < 0.5
    plan = [(r.randrange(8), r.randint(1, 3), r.getrandbits(32)) for _ in range(r.randint(1, 3))]
    lists = index_lists(r, DIM)
    outside = r.getrandbits(32)

    def formula(y: Any, t: Any, par: Any, m: Any, terms: list[Any]) -> Any:
        """Return a random combination of sums and of what stands outside of them."""
        total = None
        beside: list[Callable[[], Any]] = [lambda: y[0], lambda: y[DIM - 1], lambda: par.a, lambda: t]
        for which, depth, seed in terms:

            def term(*indices: Any, depth: int = depth, seed: int = seed) -> Any:
                own = Random(seed)
                leaves: list[Callable[[], Any]] = [
                    lambda: y[own.choice(indices)],
                    lambda: y[own.choice(indices)],
                    lambda: par.w[own.choice(indices)],
                    lambda: own.choice(indices) * 0.25,
                    own.choice(beside),
                ]
                return Expressions(own, leaves, m, tables=tables).tree(depth) * y[indices[0]]

            part = m.sum(term, lists[which])
            beside.append(lambda part=part: part * 0.1)
            total = part if total is None else total + part
        own = Random(outside)
        return total + Expressions(own, beside, m, tables=tables).tree(3) * y[1]

    if hamiltonian:
        separable = r.random() < 0.5

        def H(q: Any, p: Any, t: Any, par: Any, m: Any) -> Any:
            kinetic = m.sum(lambda i: p[i] ** 2 / 2, range(DIM))
            coupling = 0.0 if separable else formula(p, t, par, m, plan[:1]) * 0.1
            return kinetic + coupling + formula(q, t, par, m, plan)

        return Hamiltonian(H, dof=DIM, parameters=PARAMETERS, invariants={"other": H}, name="random")

    def field(y: Any, t: Any, par: Any, m: Any) -> Any:
        return [formula(y, t, par, m, [plan[i % len(plan)]]) + y[i] for i in range(DIM)]

    return VectorField(field, dim=DIM, parameters=PARAMETERS, name="random")


def functions(system: System) -> list[Function | Jacobian]:
    """Return everything of a system that is emitted."""
    stacked = [] if system.energy is None else [system.together(system.field, system.energy)]
    derived = (system.gradient("other"), system.jacobian())
    return [*system.functions, *stacked, *(function for function in derived if function is not None)]


def on_python(system: System, what: Function | Jacobian, limit: int | None) -> Callable[..., np.ndarray]:
    """Return the text for numba as a Python function: what numba would compile."""
    made = targets.source(system, what, "numba", limit=limit)
    namespace: dict[str, Any] = {
        **{name: getattr(math, name) for name in dir(math)},
        **vars(called),
        "sign": np.sign,
    }
    exec(made.text, namespace)  # noqa: S102 -- the text under test
    inner, n = namespace[made.name], n_outputs(system, what)

    def evaluate(t: float, y: np.ndarray, par: np.ndarray) -> np.ndarray:
        out = np.full(n, np.nan)
        inner(t, y, par, out)
        return out

    return evaluate


def graph_of(system: System, what: Function | Jacobian) -> Any:
    return what.function if isinstance(what, Jacobian) else what


def n_outputs(system: System, what: Function | Jacobian) -> int:
    return len(graph_of(system, what).outputs)


def on_numba(system: System, what: Function | Jacobian, limit: int | None) -> Callable[..., np.ndarray]:
    inner, n = targets.numba(system, what, limit=limit), n_outputs(system, what)

    def evaluate(t: float, y: np.ndarray, par: np.ndarray) -> np.ndarray:
        out = np.full(n, np.nan)
        inner(t, y, par, out)
        return out

    return evaluate


def on_heyoka(system: System, what: Function | Jacobian, limit: int | None) -> Callable[..., np.ndarray]:
    hy = pytest.importorskip("heyoka")
    assert limit is None
    found = targets.heyoka(system, "field")
    inner = hy.cfunc([rhs for _, rhs in found], [variable for variable, _ in found])
    return lambda t, y, par: inner(y, pars=par[: inner.nparams], time=t)


def agree(seed_or_random: Random, engine: Any, limits: tuple[int | None, ...], **options: Any) -> None:
    """Assert that an engine computes every function of a random system as the graph does."""
    system = random_system(seed_or_random, **options)
    rng = np.random.default_rng(seed_or_random.getrandbits(32))
    y, par = rng.uniform(-1.5, 1.5, system.dim), system.pack()
    asked = ["field"] if engine is on_heyoka else functions(system)
    for what in asked:
        parts = evaluate(graph_of(system, what), 0.3, y[:, np.newaxis], par)
        exact = np.array([float(part.rounded()[0]) for part in parts])
        for limit in limits:
            found = np.asarray(engine(system, what, limit)(0.3, y, par))
            # Measured at most 9e-16 in 80 systems; another component read is off by 1e-3 and more.
            assert np.abs(found - exact).max() <= 1e-11 * (1.0 + np.abs(exact).max()), (what, limit)


LIMITS = (0, targets.SMALL, None)
randoms = st.randoms(use_true_random=False)


@settings(max_examples=25, deadline=None)
@given(randoms)
def test_the_text_for_numba_computes_what_the_graph_says(r):
    agree(r, on_python, LIMITS, tables=True)


@settings(max_examples=25, deadline=None)
@given(randoms)
def test_the_text_for_numpy_computes_what_the_graph_says(r):
    agree(r, lambda system, what, limit: targets.numpy(system, what, limit=limit), LIMITS, tables=True)


@pytest.mark.slow
@settings(max_examples=1000, deadline=None)
@given(randoms)
def test_a_thousand_graphs(r):
    agree(r, on_python, LIMITS, tables=True)
    agree(r, lambda system, what, limit: targets.numpy(system, what, limit=limit), LIMITS, tables=True)


@pytest.mark.slow
@pytest.mark.parametrize("engine", [targets.jax, on_numba, on_heyoka])
@settings(max_examples=8, deadline=None)
@given(randoms)
def test_compiled_texts_compute_what_the_graph_says(engine, r):
    if engine is targets.jax:
        pytest.importorskip("jax")
        agree(r, lambda system, what, limit: targets.jax(system, what, limit=limit), (0,), tables=True)
    elif engine is on_heyoka:
        agree(r, engine, (None,), tables=False)
    else:
        agree(r, engine, (0,), tables=True)


def test_a_table_in_a_sum_reads_its_own_component():
    rng = np.random.default_rng(0)
    pairs = [tuple(map(int, rng.integers(0, 40, 2))) for _ in range(300)]

    def field(y, m):
        first = m.sum(lambda i, j: m.table(y[i], KNOTS, VALUES) * y[j] ** 3, pairs)
        return [first, *(y[i] for i in range(39))]

    system = VectorField(field, dim=40, name="tables")
    y = rng.normal(size=40)
    (exact, *_) = evaluate(system.function("field"), 0.0, y[:, np.newaxis], np.empty(0))
    assert on_python(system, system.field, targets.SMALL)(0.0, y, np.empty(0))[0] == pytest.approx(
        float(exact.rounded()[0]), rel=1e-13
    )


@pytest.mark.parametrize("digits", range(1, 17))
def test_the_rows_of_a_list_in_two_pieces_each_add_their_own_term(digits):
    # A value used once is printed where it is used, where its text is short. The text can be short in one
    # piece of the list and too long in the next, whose variables have one digit more.
    literal = float("0." + "1" * digits)

    def field(y, m):
        def term(i, j):
            a, b, c, d = m.sin(y[i]), m.sin(y[j]), m.cos(y[i]), m.cos(y[j])
            inner = m.tanh(m.atan(m.tanh(m.atan(m.tanh(m.atan(m.tanh(a * b * c * d + literal)))))))
            return inner * (a - b + c - d)

        return [m.sum(term, [(i, (i + 1) % 6) for i in range(6)]), *(y[i] for i in range(5))]

    system = VectorField(field, dim=6, name="pieces")
    y = np.linspace(-1.0, 1.2, 6)
    (exact, *_) = evaluate(system.function("field"), 0.0, y[:, np.newaxis], np.empty(0))
    found = on_python(system, system.field, 0)(0.0, y, np.empty(0))[0]
    assert found == pytest.approx(float(exact.rounded()[0]), rel=1e-13)


def test_variables_of_two_kinds_never_have_one_name():
    prefixes = list(printer._PREFIX.values())
    assert len(set(prefixes)) == len(prefixes)
    assert all(prefix.isidentifier() and prefix.isalpha() for prefix in prefixes)
    assert not {f"{prefix}{n}" for prefix in prefixes for n in range(99)} & {
        *targets._MATHEMATICS,
        "t",
        "par",
    }
