"""Gradients by the adjoint are the derivatives of the steps that are taken, to rounding."""

import doctest
from pathlib import Path

import numpy as np
import pytest

import problems
from integrators import HBVM, IAS15, Gauss, gradient, integrate
from integrators.dynamics.recorded import Recorded
from problems import Hamiltonian, InputError, Problem, VectorField
from problems.evaluate.wide import evaluate
from tests.integrators.kernel.test_variations import SYSTEMS, flow, wide

NUDGE = 1e-11  # of differences in 36 digits; see `test_variations`
WIDTH = 20


def net(y, par, m):
    """A field of WIDTH components with WIDTH^2 parameters."""
    return [
        m.tanh(m.sum(lambda j, i=i: par.w[WIDTH * i + j] * y[j], range(WIDTH))) - 0.1 * y[i]
        for i in range(WIDTH)
    ]


def chain(t, q, p, par, m):
    """Four parameters, and explicit time."""
    springs = par.k[0] * q[0] ** 2 + par.k[1] * (q[1] - q[0]) ** 2
    return p[0] ** 2 / (2 * par.m) + p[1] ** 2 / 2 + springs + par.a * m.cos(t) * m.sin(q[1])


PROBLEMS = {
    4: lambda: Problem(
        Hamiltonian(chain, dof=2, parameters={"k": [0.7, 0.4], "m": 1.3, "a": 0.2}),
        q0=[0.3, -0.4], p0=[0.5, 0.8], t_end=2.0,
    ),
    400: lambda: Problem(
        VectorField(
            net, dim=WIDTH,
            parameters={"w": (np.random.default_rng(0).standard_normal(WIDTH**2) / WIDTH**0.5).tolist()},
        ),
        y0=np.linspace(-1.0, 1.0, WIDTH), t_end=2.0,
    ),
}  # fmt: skip
NAMES = {4: ["y0", "k", "m", "a"], 400: ["y0", "w"]}


def loss(y, m):
    return m.sin(y[0]) * y[1] + y[2] ** 2


def stacked(grads, names):
    return np.concatenate([np.ravel(grads[name]) for name in names])


@pytest.mark.parametrize(
    ("count", "k", "s", "steps"),
    [(4, 3, 3, 2), (4, 6, 3, 2)] + [pytest.param(400, k, 3, 3, marks=pytest.mark.slow) for k in (4, 3)],
)
def test_they_are_the_differences_of_the_steps_in_36_digits(count, k, s, steps):
    problem, h, rng = PROBLEMS[count](), 0.25, np.random.default_rng(k)
    method = Gauss(s=s, h=h) if k == s else HBVM(k=k, s=s, h=h)
    value, grads = gradient(problem, method, loss, NAMES[count], t_end=steps * h)
    assert stacked(grads, NAMES[count][1:]).size == count
    dim, traced, e = problem.system.dim, problem.system.trace(loss, "loss"), wide([NUDGE])[0]
    y, par, all_of_them = wide(problem.y0), wide(problem.par), stacked(grads, NAMES[count])
    ways = rng.standard_normal((2, dim + count))
    ways[1, :dim] = 0.0  # the parameters alone
    for way in ways:
        moved = e * wide(way)
        ends = [
            flow(problem, k, s, wide([h] * steps), y + i * moved[:dim], par + i * moved[dim:])
            for i in (1, -1)
        ]
        values = [evaluate(traced, steps * h, end, par)[0] for end in ends]
        found = float((values[0] - values[1]) / (2 * e))
        assert abs(all_of_them @ way - found) < 1e-14 * np.linalg.norm(all_of_them)  # measured: 4e-16
    end = integrate(problem, method, [steps * h]).y[0]
    assert value == pytest.approx(np.sin(end[0]) * end[1] + end[2] ** 2, rel=1e-15)


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize(
    "method",
    [
        Gauss(s=4, h=0.07),
        HBVM(k=11, s=4, h=0.2),
        HBVM(k=20, s=3, h=0.2),
        Gauss(s=6, tol=1e-8),
        HBVM(tol=1e-10),
    ],
    ids=repr,
)  # fmt: skip
def test_they_are_what_tangent_vectors_say(name, method):
    problem = SYSTEMS[name]()
    if problem.system.kind == "poisson" and isinstance(method, HBVM):
        pytest.skip("no Runge-Kutta method there")
    names, end = ["y0", "t0", *problem.system.parameters], problem.t0 + 1.6
    _, grads = gradient(problem, method, lambda y, m: m.exp(0.3 * y[0]) + y[1] ** 2, names, t_end=end)
    made = integrate(problem, method, [end], variations=names)
    slope = np.zeros(problem.system.dim)
    slope[:2] = 0.3 * np.exp(0.3 * made.y[0, 0]), 2.0 * made.y[0, 1]
    wanted = slope @ made.variations[0]
    assert np.abs(stacked(grads, names) - wanted).max() < 1e-14 * np.abs(wanted).max()  # measured: 4.2e-16


@pytest.mark.parametrize("method", [Gauss(s=4, h=0.02), HBVM(tol=1e-12)], ids=repr)
def test_with_little_memory_steps_are_made_again_with_the_same_bits(method):
    problem = PROBLEMS[4]()
    program = method.compile(problem.system)
    much = Recorded(program, problem, [30.0])
    little = Recorded(program, problem, [30.0], memory=much.kept / 7)
    assert much.steps == little.steps > 20
    assert 0 < little.kept <= much.kept / 7
    ends = [each.pulled_back(np.ones((1, 4)), parameters=True) for each in (much, little)]
    assert all(map(np.array_equal, *ends))


@pytest.mark.parametrize(
    "method",
    [Gauss(s=4, h=0.11), HBVM(k=8, s=4, h=0.3), HBVM(), HBVM(tol=1e-6), Gauss(s=5, tol=1e-9)],
    ids=repr,
)
@pytest.mark.parametrize("backwards", [False, True])
def test_a_sum_over_samples_has_the_derivatives_of_the_samples(method, backwards):
    problem, names = PROBLEMS[4](), ["y0", "t0", *NAMES[4][1:]]
    times = np.sort(np.random.default_rng(1).uniform(0.0, 9.0, 40)) * (-1.0 if backwards else 1.0)
    times = np.concatenate([[0.0], np.sort(times)[:: -1 if backwards else 1]])
    data = np.random.default_rng(2).standard_normal((41, 2))

    def misfit(y, par, data, t, m):
        return (y[0] - data[0]) ** 2 + m.sin(y[1] * par.m + t) * data[1]

    value, grads = gradient(problem, method, misfit, names, times=times, data=data)
    made = integrate(problem, method, times, variations=names)
    (a, b), m = made.y.T[:2], problem.system.parameters["m"]
    assert value == pytest.approx(
        np.sum((a - data[:, 0]) ** 2 + np.sin(b * m + times) * data[:, 1]), rel=1e-13
    )
    slopes = np.zeros_like(made.y)
    slopes[:, 0], turn = 2.0 * (a - data[:, 0]), np.cos(b * m + times) * data[:, 1]
    slopes[:, 1] = turn * m
    wanted = np.einsum("id,idn->n", slopes, made.variations)
    wanted[names.index("m") + 3 + 1] += np.sum(turn * b)  # y0 has four columns and k two
    found = stacked(grads, names)
    assert np.abs(found - wanted).max() < 1e-13 * np.abs(wanted).max()  # measured: 1.2e-15


def test_samples_with_little_memory_and_single_numbers_as_data():
    problem, times = PROBLEMS[4](), np.linspace(0.5, 30.0, 37)
    for method in (Gauss(s=4, h=0.02), HBVM(tol=1e-12)):
        options = {"times": times, "data": np.sin(times)}
        much = gradient(problem, method, lambda y, data: (y[0] - data) ** 2, NAMES[4], **options)
        little = gradient(
            problem, method, lambda y, data: (y[0] - data) ** 2, NAMES[4], memory=4e4, **options
        )
        assert much[0] == little[0]
        assert all(np.array_equal(much[1][name], little[1][name]) for name in NAMES[4])


def test_backwards_in_time():
    problem = PROBLEMS[4]()
    for method in (Gauss(s=5, h=0.1), HBVM(tol=1e-11)):
        _, grads = gradient(problem, method, lambda q: q[0], ["y0", "m"], t_end=-1.37)
        made = integrate(problem, method, [-1.37], variations=["y0", "m"])
        found = stacked(grads, ["y0", "m"])
        assert np.abs(found - made.variations[0, 0]).max() < 1e-14  # measured: 5.6e-17


def test_stiff_steps_that_newton_solves_have_them():
    problem = problems.load("stiff_chain")
    program = Gauss(s=3, h=0.1).compile(problem.system)
    recorded = Recorded(program, problem, [1.05])
    assert "Newton" in recorded.solver
    dof, rng = problem.system.dof, np.random.default_rng(0)
    ends = rng.standard_normal((2, 2 * dof))
    starts = [recorded.pulled_back(end[np.newaxis], parameters=True)[0] for end in ends]
    J = np.kron([[0, 1], [-1, 0]], np.eye(dof))
    size = np.linalg.norm(starts[0]) * np.linalg.norm(starts[1])
    assert (
        abs(starts[0] @ J @ starts[1] - ends[0] @ J @ ends[1]) < 1e-14 * size
    )  # symplectic; measured: 3e-16
    way, nudge = rng.standard_normal(2 * dof), 1e-6
    starts_beside = [problem.y0 + i * nudge * way for i in (1, -1)]
    moved = [program.start(y, problem.par).advance([1.05]).y[0] for y in starts_beside]
    slope = ends[0] @ (moved[0] - moved[1]) / (2 * nudge)
    assert abs(starts[0] @ way - slope) < 1e-7 * np.linalg.norm(starts[0])  # measured: 3e-11


def test_what_depends_on_the_parameters_and_the_time_alone():
    problem = PROBLEMS[4]()
    value, grads = gradient(problem, Gauss(s=4, h=0.1), lambda t, par: t * par.m**2, ["y0", "m", "k"])
    assert value == 2.0 * 1.3**2
    assert grads["m"] == pytest.approx(5.2, rel=1e-15)
    assert not grads["y0"].any()
    assert grads["m"].shape == ()
    assert grads["k"].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"wrt": ["z0"]}, "'z0'"),
        ({"loss": None}, "loss=None"),
        ({"loss": lambda y: y[0] > 1}, "loss"),
        ({"t_end": 1e300}, "h=0.1"),
        ({"memory": 0.0}, "memory"),
        ({"data": [1.0]}, "data belong to samples"),
        ({"times": [1.0]}, "leave out t_end=1.0"),
        ({"times": [1.0, 0.5], "t_end": None}, "strictly monotone"),
        ({"times": [1.0, 2.0], "data": [1.0], "t_end": None}, r"shape \(2,\) or \(2, n\)"),
        ({"times": [1.0], "data": [np.nan], "t_end": None}, "finite numbers"),
        ({"times": [1.0], "loss": lambda q, data: q[0] - data, "t_end": None}, "argument 'data'"),
    ],
)
def test_what_cannot_be_is_said(keywords, words):
    given = {"loss": lambda q: q[0], "t_end": 1.0, **keywords}
    with pytest.raises(InputError, match=words):
        gradient(problems.load("pendulum"), Gauss(s=4, h=0.1), **given)


def test_methods_without_an_adjoint_are_refused():
    with pytest.raises(InputError, match="Runge-Kutta"):
        gradient(problems.load("rigid_body"), HBVM(k=4, s=2, h=0.1), lambda y: y[0])
    with pytest.raises(InputError, match="use Gauss or HBVM"):
        gradient(problems.load("pendulum"), IAS15(), lambda q: q[0])


def test_the_guide_on_fitting_shows_what_happens():
    page = Path(__file__).parents[3] / "docs" / "howto" / "fitting.md"
    failed, tried = doctest.testfile(str(page), module_relative=False)
    assert (failed, tried > 10) == (0, True)
