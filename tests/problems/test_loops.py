"""Loops in vector fields: every target and every derivative, against NumPy and against differences."""

import pickle
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse

from integrators import HBVM, integrate
from integrators.kernel.native import binary, stages
from problems import Hamiltonian, InputError, Problem, System, VectorField, targets
from problems.analysis import invariants
from problems.graph.loops import affine
from problems.targets import called

RNG = np.random.default_rng(3)
N = 6
K = RNG.normal(size=(N, N))
SPARSE = scipy.sparse.random(N, N, 0.4, random_state=1, format="csr")
PAIRS = [(i, j) for i in range(N) for j in range(i)]
NEAR = [[(k, (i + k) % N) for k in range(i)] for i in range(N)]  # the first has no neighbours
W1, B1, W2, W3 = (RNG.normal(size=shape) for shape in ((8, 3), (8,), (8, 8), (3, 8)))
WIDE = 4
CELLS = np.arange(WIDE * WIDE).reshape(WIDE, WIDE)
STENCIL = np.stack(
    [CELLS, *(np.roll(CELLS, shift, axis) for axis in (0, 1) for shift in (1, -1))], axis=-1
).reshape(-1, 5)


@dataclass
class Case:
    """A system with loops, and the same right-hand side on NumPy's arrays."""

    system: System
    plain: Callable[[np.ndarray], np.ndarray]


def ring() -> Case:
    def f(y, par, m):
        return m.each(
            lambda i, left, right: par.a * (y[left] - 2 * y[i] + y[right]) - y[i] ** 3,
            [(i, (i - 1) % N, (i + 1) % N) for i in range(N)],
        )

    return Case(
        VectorField(f, dim=N, parameters={"a": 2.0}),
        lambda y: 2 * (np.roll(y, 1) - 2 * y + np.roll(y, -1)) - y**3,
    )


def grid() -> Case:
    n = WIDE * WIDE

    def f(y, par, m):
        u, v = y[:n], y[n:]

        def laplace(w, c, up, down, left, right):
            return w[up] + w[down] + w[left] + w[right] - 4 * w[c]

        return [
            m.each(
                lambda c, *near: 1 + u[c] ** 2 * v[c] - 4.4 * u[c] + par.a * laplace(u, c, *near), STENCIL
            ),
            m.each(lambda c, *near: 3.4 * u[c] - u[c] ** 2 * v[c] + par.a * laplace(v, c, *near), STENCIL),
        ]

    def plain(y):
        u, v = y.reshape(2, WIDE, WIDE)

        def laplace(w):
            return sum(np.roll(w, shift, axis) for axis in (0, 1) for shift in (1, -1)) - 4 * w

        parts = 1 + u * u * v - 4.4 * u + 0.3 * laplace(u), 3.4 * u - u * u * v + 0.3 * laplace(v)
        return np.concatenate([part.ravel() for part in parts])

    return Case(VectorField(f, dim=2 * n, parameters={"a": 0.3}), plain)


def all_to_all() -> Case:
    def f(y, par, m):
        def term(i):
            return par.K[i, i] + m.sum(lambda j: par.K[i, j] * m.sin(y[j] - y[i]), range(N)) / N

        return m.each(term, range(N))

    return Case(
        VectorField(f, dim=N, parameters={"K": K}),
        lambda y: np.diag(K) + (K * np.sin(y - y[:, np.newaxis])).sum(axis=1) / N,
    )


def dense() -> Case:
    return Case(VectorField(lambda y, m: m.dot(K, y), dim=N, name="dense"), lambda y: K @ y)


def sparse() -> Case:
    def f(y, m):
        flow = m.dot(SPARSE, y)
        return m.each(lambda i: flow[i] * y[i] - y[i] ** 2, range(N))

    return Case(VectorField(f, dim=N), lambda y: (SPARSE @ y) * y - y * y)


def neural() -> Case:
    def f(y, par, m):
        first = m.dot(par.W1, y)
        hidden = m.each(lambda i: m.tanh(first[i] + par.b[i]), range(8))
        second = m.dot(W2, hidden)
        return m.dot(W3, m.each(lambda i: m.tanh(second[i]), range(8)))

    return Case(
        VectorField(f, dim=3, parameters={"W1": W1, "b": B1}),
        lambda y: W3 @ np.tanh(W2 @ np.tanh(W1 @ y + B1)),
    )


def pairs() -> Case:
    def f(y, m):
        def pull(i, j):
            force = (y[j] - y[i]) ** 3
            return {i: force, j: -force}

        return [*y[N:], m.scatter(pull, PAIRS, N)]

    def plain(y):
        force = np.zeros(N)
        for i, j in PAIRS:
            force[i] += (y[j] - y[i]) ** 3
            force[j] -= (y[j] - y[i]) ** 3
        return np.concatenate([y[N:], force])

    return Case(VectorField(f, dim=2 * N), plain)


def nested() -> Case:
    weights = RNG.normal(size=N)

    def f(y, m):
        mean, c = m.sum(lambda i: y[2 * i], range(N)) / N, m.array(weights)

        def inner(j):
            return m.sum(lambda k: y[2 * k + 1] * c[k] + j, range(3))

        def term(i, near):
            total = m.sum(lambda k, j: c[k] * y[2 * j] * inner(j), near)
            return m.exp(-0.1 * total) - mean * i, y[2 * i] * c[i]

        return m.each(term, enumerate(NEAR))

    def plain(y):
        a, b = y[::2], y[1::2]
        out = np.empty(2 * N)
        for i in range(N):
            total = sum(weights[k] * a[j] * sum(b[:3] * weights[:3] + j) for k, j in NEAR[i])
            out[2 * i : 2 * i + 2] = np.exp(-0.1 * total) - a.mean() * i, a[i] * weights[i]
        return out

    return Case(VectorField(f, dim=2 * N), plain)


def hamiltonian() -> Case:
    def H(q, p, m):
        def term(i):
            return p[i] ** 2 / 2 + m.log(1 + m.sum(lambda j: (q[i] - q[j]) ** 2, range(N)))

        return m.sum(term, range(N))

    def plain(y):
        q, p = y[:N], y[N:]
        apart = q[:, np.newaxis] - q
        size = 1 + (apart**2).sum(axis=1)
        return np.concatenate([p, -(2 * apart / size[:, np.newaxis] + 2 * apart / size).sum(axis=1)])

    return Case(Hamiltonian(H, dof=N), plain)


CASES = [ring, grid, all_to_all, dense, sparse, neural, pairs, nested, hamiltonian]


@pytest.fixture(params=CASES, ids=lambda make: make.__name__, scope="module")
def case(request):
    return request.param()


@pytest.fixture
def y(case):
    return np.random.default_rng(5).normal(size=case.system.dim)


@pytest.mark.parametrize("limit", [0, 700, None])
def test_loops_have_the_value_of_the_same_formula_in_numpy(case, y, limit):
    system, par, expected = case.system, case.system.pack(), case.plain(y)
    assert targets.numpy(system, "field", limit=limit)(0.0, y, par) == pytest.approx(expected, abs=1e-13)
    namespace = {**vars(called), **{f: getattr(np, f) for f in FUNCTIONS}}
    made = targets.source(system, "field", "numba", limit=limit)
    exec(made.text, namespace)  # noqa: S102 -- emitted from a graph
    out = np.empty(system.dim)
    namespace[made.name](0.0, y, par, out)
    assert out == pytest.approx(expected, abs=1e-13)  # measured 2e-15
    digits = invariants.evaluate(system.field, 0.0, np.stack([y, y], axis=1), par)
    assert [value.rounded()[1] for value in digits] == pytest.approx(expected, abs=1e-13)


FUNCTIONS = ("sin", "exp", "tanh", "log")


def test_derivatives_of_loops_are_those_that_differences_give(case, y):
    system, par = case.system, case.system.pack()
    steps = 1e-6 * np.eye(system.dim)
    by_differences = np.stack([(case.plain(y + e) - case.plain(y - e)) / 2e-6 for e in steps], axis=1)
    jacobian = system.jacobian()
    matrix = np.zeros((system.dim, system.dim))
    matrix[jacobian.rows, jacobian.columns] = targets.numpy(system, jacobian, limit=0)(0.0, y, par)
    assert matrix == pytest.approx(by_differences, abs=1e-7)  # measured 5e-9
    along = RNG.normal(size=system.dim)
    state = np.concatenate([along, y])
    tangent = targets.numpy(system, system.tangent("field", 1), limit=0)(0.0, state, par)
    assert tangent == pytest.approx(matrix @ along, abs=1e-12)  # measured 1e-14
    product = targets.numpy(system, system.product("state"), limit=0)(0.0, state, par)
    assert product == pytest.approx(along @ matrix, abs=1e-12)  # measured 1e-14


def test_the_jacobian_has_the_entries_of_the_graph_only():
    assert ring().system.jacobian().rows.size == 3 * N
    assert grid().system.jacobian().rows.size == 2 * WIDE * WIDE * 6
    assert sparse().system.jacobian().rows.size == np.count_nonzero(SPARSE.toarray() + np.eye(N))


def test_loops_are_unrolled_for_heyoka(case):
    pytest.importorskip("heyoka")
    assert len(targets.heyoka(case.system)) == case.system.dim


def test_a_huge_text_for_heyoka_is_refused_before_it_is_written():
    n = 1000
    system = VectorField(
        lambda y, m: m.each(lambda i: m.sum(lambda j: y[j] - y[i], range(n)), range(n)), dim=n
    )
    begun = time.process_time()
    with pytest.raises(InputError, match=r"heyoka has 4,002,000 operations with all loops written out"):
        targets.source(system, "field", "heyoka")
    assert time.process_time() - begun < 2.0  # measured 0.01


def test_slices_of_a_large_state_are_no_operations():
    n = 20_000

    def f(y, m):
        u, v = y[:n], y[n:]
        return [m.each(lambda i: v[i], range(n)), m.each(lambda i: -u[i], range(n))]

    assert targets.source(VectorField(f, dim=2 * n), "field", "numba").cost < 60  # measured 28


def test_loops_run_in_jax(case, y):
    pytest.importorskip("jax")
    value = targets.jax(case.system, "field", limit=0)(0.0, y, case.system.pack())
    assert np.asarray(value) == pytest.approx(case.plain(y), abs=1e-13)


def test_a_pickled_system_has_the_same_loops(case):
    again = pickle.loads(pickle.dumps(case.system))
    assert targets.fingerprint(again) == targets.fingerprint(case.system)


def test_the_code_does_not_grow_with_the_number_of_components():
    def network(n):
        near = [[(i + 1) % n, (i + 3) % n, (i * i + 1) % n] for i in range(n)]

        def f(y, m):
            return m.each(lambda i, js: m.sum(lambda j: m.sin(y[j] - y[i]), js), enumerate(near))

        return VectorField(f, dim=n)

    small, large = (targets.source(network(n), "field", "numba") for n in (400, 2000))
    assert small.text.count("\n") == large.text.count("\n")
    assert small.cost == large.cost < 100  # measured 63


def decays(n):
    """Return y' = -y by a product that is stored before a loop uses it."""
    minus = -scipy.sparse.eye_array(n, format="csr")

    def f(y, m):
        flow = m.dot(minus, y)
        return m.each(lambda i: flow[i], range(n))

    return VectorField(f, dim=n)


def test_what_loops_store_in_between_lies_on_no_stack_where_it_is_long():
    text = binary.lower(*stages.on_lanes(targets.numba(decays(1000), "field").py_func, 16))
    assert "alloca" not in text
    assert text.count("ptr @malloc(i64 128064)") == text.count("call void @free(") == 1


@pytest.mark.slow
def test_what_loops_store_in_between_needs_no_stack():
    n = 80_000  # 16 stages of that are 10 MB, and a stack has 8
    problem = Problem(decays(n), y0=np.ones(n), t_end=0.1)
    solution = integrate(problem, HBVM(k=16, s=8, h=0.1), [0.1])
    assert solution.y[-1] == pytest.approx(np.full(n, np.exp(-0.1)), rel=1e-15)  # measured 1.3e-16


def test_a_python_loop_over_thousands_of_cells_is_refused_at_once():
    def f(y):
        return [y[(i + 1) % 6000] - 2 * y[i] * y[i - 1] + y[i] ** 3 for i in range(6000)]

    begun = time.process_time()
    with pytest.raises(InputError, match=r"m\.each\(lambda i: -y\[i\], range\(n\)\)"):
        VectorField(f, dim=6000)
    assert time.process_time() - begun < 20.0  # measured 0.3 alone, 2.3 in a process full of objects


def test_many_small_sums_stay_loops_instead_of_being_unrolled():
    def f(y, m):
        return [m.sum(lambda j, i=i: m.sin(y[j] - y[i]), range(50)) for i in range(50)]

    assert targets.source(VectorField(f, dim=50), "field", "numba").text.count("sin(") == 50


@pytest.mark.parametrize(
    ("f", "sentence"),
    [
        (lambda y, m: m.each(lambda i: y[i], range(4)), "returns 4 values, not a list of dim=3"),
        (
            lambda y, m: m.each(lambda i: y[i] + m.each(lambda j: y[j], range(3))[0], range(3)),
            "inside the term",
        ),
        (lambda y, m: m.each(lambda i: y[i + 1], range(3)), r"y\[3\] does not exist"),
        (lambda y, m: m.each(lambda i: y[i], range(3)) + y, "all values of m.each"),
        (lambda y, m: m.dot(np.ones((3, 2)), y), "2 columns and a vector of 3 numbers"),
        (lambda y, m: m.each(lambda i, js: y[js[0]], enumerate([[0], [1], [2]])), "list that differs"),
        (lambda y, m: m.scatter(lambda i: y[i], range(3), 3), "no dictionary"),
        (lambda y, m: m.dot([[1.0, np.nan, 0.0]] * 3, y), "m.dot takes"),
        (lambda y, m: m.each(lambda i: m.array([1.0, np.inf])[i], range(2)), "finite numbers"),
    ],
)
def test_what_is_no_loop_is_refused_with_a_sentence(f, sentence):
    with pytest.raises(InputError, match=sentence):
        VectorField(f, dim=3)


def test_an_index_is_found_as_an_affine_function_of_others():
    rows = np.indices((7, 5)).reshape(2, -1).T
    assert affine(rows, 5 * rows[:, 0] + rows[:, 1]).coefficients == (5, 1)
    assert affine(rows, rows[:, 0] ** 2) is None


def random_network(seed: int) -> VectorField:
    """Return a field of random terms over random lists, two of them one after the other."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 7))
    near = [rng.integers(0, n, rng.integers(0, 4)).tolist() for _ in range(n)]
    links = rng.integers(0, n, (int(rng.integers(1, 9)), 2))
    matrix = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.6)
    constants = rng.normal(size=n)
    outer = rng.integers(0, 4, 2)

    def f(y, par, m):
        def wave(x):
            return [m.sin(x), m.tanh(x), x * x, x / (1 + x * x)][outer[0]]

        def total(i, js):
            return m.sum(lambda j: par.K[i, j] * wave(y[j] - c[i] * y[i]), js)

        c, flow = m.array(constants), m.dot(matrix, y)
        first = m.each(lambda i, js: wave(flow[i]) + total(i, js), enumerate(near))
        pulled = m.scatter(lambda i, j: {i: first[j] * y[i], j: -wave(first[i])}, links, n)
        mean = m.sum(lambda i: first[i] * y[i], range(n)) / n
        if outer[1] == 0:
            return pulled
        last = m.each(lambda i: pulled[i] * par.a + mean * c[i] + first[n - 1 - i], range(n))
        return [last[0], *list(last)[1:]] if outer[1] == 3 else last

    parameters = {"K": rng.normal(size=(n, n)), "a": 0.7}
    return VectorField(f, dim=n, parameters=parameters, name=f"random_{seed}")


def check_random(seed: int) -> None:
    system = random_network(seed)
    y, par = np.random.default_rng(seed).normal(size=system.dim), system.pack()

    def both(function, state):
        looped, unrolled = (
            targets.numpy(system, function, limit=limit)(0.0, state, par) for limit in (0, None)
        )
        scale = 1.0 + np.abs(unrolled).max()
        assert looped == pytest.approx(unrolled, abs=1e-13 * scale)  # measured 2e-15
        return unrolled

    both("field", y)
    along = np.random.default_rng(seed + 1).normal(size=system.dim)
    jacobian = system.jacobian()
    matrix = np.zeros((system.dim, system.dim))
    matrix[jacobian.rows, jacobian.columns] = both(jacobian.function, y)
    scale = 1.0 + np.abs(matrix).max()
    tangent = both(system.tangent("field", 1), np.concatenate([along, y]))
    product = both(system.product("state"), np.concatenate([along, y]))
    assert matrix @ along == pytest.approx(tangent, abs=1e-12 * scale)
    assert along @ matrix == pytest.approx(product, abs=1e-12 * scale)


@pytest.mark.parametrize("seed", [*range(18), 273, 289])  # the last two: terms that nothing reads
def test_random_loops_and_their_derivatives_are_those_of_the_unrolled_formula(seed):
    check_random(seed)


@pytest.mark.slow
def test_many_random_loops_and_their_derivatives_are_those_of_the_unrolled_formula():
    for seed in range(18, 500):
        check_random(seed)
