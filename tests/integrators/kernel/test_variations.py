"""Variations are the derivatives of the steps that are taken, to rounding."""

import mpmath
import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, Status, integrate, integrate_many, load
from integrators.coefficients.legendre import tables
from problems import Hamiltonian, InputError, Lagrangian, Poisson, Problem, VectorField
from problems.evaluate.wide import evaluate

_MP = mpmath.MPContext()
_MP.dps = 36
NUDGE = 1e-11  # of differences: their own error is 1e-22, and what 36 digits leave 1e-25


def wide(numbers):
    return np.array([_MP.mpf(float(x)) for x in np.ravel(numbers)], dtype=object)


def flow(problem, k, s, lengths, y, par):
    """Return where steps of HBVM(k, s) of these lengths lead to, calculated with 36 digits."""
    table, t = tables(k, s), _MP.mpf(problem.t0)
    nodes, weights, integrals, projection = (
        (wide(part.hi) + wide(part.lo)).reshape(part.hi.shape)
        for part in (table.nodes, table.weights, table.integrals, table.projection)
    )
    matrix = integrals.dot(projection)
    for h in lengths:
        values = np.array([evaluate(problem.system.field, t, y, par)] * k, dtype=object)
        change = 1
        while change > 1e-32:
            stages = y + h * matrix.dot(values)
            new = np.array(
                [
                    evaluate(problem.system.field, t + c * h, stage, par)
                    for c, stage in zip(nodes, stages, strict=True)
                ]
            )
            change = max(abs(x) for x in (new - values).ravel())
            values = new
        y, t = y + h * weights.dot(values), t + h
    return y


def difference(problem, k, s, lengths, state, parameters):
    """Return the derivative of `flow` along one direction."""
    y, par, e = wide(problem.y0), wide(problem.par), _MP.mpf(NUDGE)
    ends = [
        flow(problem, k, s, lengths, y + i * e * wide(state), par + i * e * wide(parameters)) for i in (1, -1)
    ]
    return ((ends[0] - ends[1]) / (2 * e)).astype(float)


def top(q, p, par, m):
    """Not separable."""
    return p[0] ** 2 * (1.0 + q[0] ** 2) / 2 + par.a * m.cos(q[0])


def masses(q, p, par, m):
    """Separable, with velocities that depend on parameters."""
    kinetic = p[0] ** 2 / (2 * par.m[0]) + p[1] ** 2 / (2 * par.m[1])
    return kinetic + m.exp(q[0] - q[1]) + par.k * (q[0] ** 2 + q[1] ** 2) / 2


def summed(q, p, m):
    """With a sum that stays a loop."""
    return m.sum(lambda i: p[i] ** 2, range(3)) / 2 + m.sum(
        lambda i, j: 1 / m.sqrt(1.0 + (q[i] - q[j]) ** 2), [(i, j) for i in range(3) for j in range(i)]
    )


def swing(t, q, v, par, m):
    """A pendulum of varying length, as a Lagrangian."""
    length = 1.0 + par.a * m.cos(t)
    return length**2 * v[0] ** 2 / 2 + length * m.cos(q[0])


def driven(t, y, par, m):
    return [y[1], -m.sin(y[0]) + par.a * m.cos(par.w * t), m.where(y[0] > 9.0, 0.0, y[0] * y[2])]


def euler(y, par):
    return (y[0] ** 2 / par.I[0] + y[1] ** 2 / par.I[1] + y[2] ** 2 / par.I[2]) / 2


def cross(y):
    return [[0.0, -y[2], y[1]], [y[2], 0.0, -y[0]], [-y[1], y[0], 0.0]]


SYSTEMS = {
    "separable": lambda: problems.load("henon_heiles"),
    "not separable": lambda: Problem(
        Hamiltonian(top, dof=1, parameters={"a": 0.7}), q0=[0.3], p0=[0.8], t_end=10.0
    ),
    "masses": lambda: Problem(
        Hamiltonian(masses, dof=2, parameters={"m": [1.0, 2.5], "k": 1.5}),
        q0=[0.3, -0.2],
        p0=[0.8, 0.1],
        t_end=10.0,
    ),
    "sums": lambda: Problem(Hamiltonian(summed, dof=3), q0=[0.3, -0.2, 0.9], p0=[0.8, 0.1, 0.3], t_end=10.0),
    "Lagrangian": lambda: Problem(
        Lagrangian(swing, dof=1, parameters={"a": 0.1}), q0=[0.3], v0=[0.8], t_end=10.0
    ),
    "driven": lambda: Problem(
        VectorField(driven, dim=3, parameters={"a": 0.4, "w": 1.3}), y0=[0.3, 0.4, 0.7], t_end=10.0, t0=0.5
    ),
    "Poisson": lambda: Problem(
        Poisson(euler, cross, dim=3, parameters={"I": [1.0, 2.0, 3.5]}), y0=[0.3, 0.4, 0.7], t_end=10.0
    ),
}


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize(("k", "solver"), [(3, "auto"), (10, "auto"), (3, "newton"), (10, "blended")])
def test_they_are_the_derivatives_of_the_steps_to_rounding(name, k, solver):
    problem, rng = SYSTEMS[name](), np.random.default_rng(len(name) + k)
    s, h = {3: (3, 0.2), 10: (4, 0.3)}[k]
    if problem.system.kind == "poisson":
        k = s  # with more stages HBVM is no Runge-Kutta method there
    n_par = problem.system.n_par
    state, parameters = rng.standard_normal((problem.system.dim, 2)), rng.standard_normal((n_par, 2))
    method = Gauss(s=s, h=h, solver=solver) if k == s else HBVM(k=k, s=s, h=h, solver=solver)
    stepper = method.compile(problem.system).start(problem.y0, problem.par, problem.t0)
    stepper.follow(state, parameters)
    times = problem.t0 + np.array([h, 1.4 * h])  # a step, and a part of one
    assert stepper.advance(times).status is Status.FINISHED
    lengths = [
        _MP.mpf(float(times[0])) - _MP.mpf(problem.t0),
        _MP.mpf(float(times[1])) - _MP.mpf(float(times[0])),
    ]
    for i in range(2):
        found = difference(problem, k, s, lengths[: i + 1], state[:, 0], parameters[:, 0])
        error = np.abs(stepper.variations[i, :, 0] - found).max() / np.abs(found).max()
        assert error < 2e-15  # measured: at most 1.4e-16


def stiff(y, par):
    """Fast decay onto a slow curve."""
    return [par.l * (y[1] - y[0] - y[0] ** 3), y[2] - y[1], -y[1] * y[0]]


@pytest.mark.parametrize("tol", [None, 1e-9])
def test_stiff_steps_are_differentiated_by_the_solver_that_takes_them(tol):
    system = VectorField(stiff, dim=3, parameters={"l": 1e5})
    problem = Problem(system, y0=[0.5, 0.625, 0.3], t_end=2.0)
    method = Gauss(s=3, h=None if tol else 0.01, tol=tol)
    made = integrate(problem, method, [0.0, 1.0, 2.0], variations=["y0", "l"])
    assert made.status is Status.FINISHED
    assert made.stats.extra["implicit"]["steps"] > 0
    assert np.array_equal(made.y, integrate(problem, method, [0.0, 1.0, 2.0]).y)
    moved = np.array([0.0, 0.0, 1e-6])
    ends = [
        integrate(Problem(system, y0=problem.y0 + sign * moved, t_end=2.0), method, [0.0, 1.0, 2.0]).y
        for sign in (1, -1)
    ]
    found = (ends[0] - ends[1]) / 2e-6
    # measured: 1.3e-10 and 1.9e-9, where the steps of the differences vary with the start
    assert np.abs(made.variations[:, :, 2] - found).max() < 1e-8


def test_with_many_stages_too():
    problem = problems.load("pendulum")
    state = np.array([0.3, 0.7])
    solution = integrate(problem, HBVM(k=20, s=3, h=0.5), [0.5], variations=state[:, np.newaxis])
    found = difference(problem, 20, 3, [_MP.mpf(0.5)], state, np.zeros(0))
    assert np.abs(solution.variations[0, :, 0] - found).max() < 1e-15  # measured: 0


def test_the_steps_of_a_tolerance_are_differentiated_as_they_are_taken():
    problem = SYSTEMS["driven"]()
    solution = integrate(
        problem, Gauss(s=4, tol=1e-5), [problem.t0, 2.5], "steps", variations=["y0", "a", "w"]
    )
    assert 5 < solution.t.size < 20
    assert np.array_equal(solution.variations[0], np.eye(3, 5))
    lengths = np.diff(wide(solution.t))
    for column, state, parameters in ((1, [0, 1, 0], [0, 0]), (3, [0, 0, 0], [1, 0])):
        found = difference(problem, 4, 4, lengths, state, parameters)
        error = np.abs(solution.variations[-1, :, column] - found).max() / np.abs(found).max()
        assert error < 1e-14  # measured: 0, the differences are rounded to doubles


@pytest.mark.parametrize("method", [Gauss(s=3, h=0.5), Gauss(s=8, h=0.75), Gauss(s=6, tol=1e-9)], ids=repr)
def test_the_map_of_gauss_is_symplectic(method):
    problem = problems.load("henon_heiles")
    solution = integrate(problem, method, np.arange(0.0, 100.0, 0.7), variations="y0")
    J = np.kron([[0, 1], [-1, 0]], np.eye(2))
    maps = solution.variations
    errors = np.abs(np.swapaxes(maps, 1, 2) @ J @ maps - J).max(axis=(1, 2))
    assert (errors / np.linalg.norm(maps, axis=(1, 2)) ** 2).max() < 2e-15  # measured: 3e-16


@pytest.mark.slow
def test_the_map_of_each_of_a_million_steps_is_symplectic():
    problem, J = problems.load("henon_heiles"), np.kron([[0, 1], [-1, 0]], np.eye(2))
    stepper = Gauss(s=6, h=0.5).compile(problem.system).start(problem.y0, problem.par)
    worst = 0.0
    for first in range(0, 1_000_000, 25):
        stepper.follow(np.eye(4), np.zeros((0, 4)))
        made = stepper.advance([stepper.t, (first + 25) * 0.5], sample="steps")
        maps = stepper.variations
        assert len(made.t) == 26
        products = np.swapaxes(maps, 1, 2) @ J @ maps
        changes = np.abs(np.diff(products, axis=0)).max(axis=(1, 2))
        worst = max(worst, float((changes / np.linalg.norm(maps[1:], axis=(1, 2)) ** 2).max()))
    assert worst < 1e-15  # measured: 1.8e-16


def test_they_change_nothing_of_the_trajectory():
    problem, times = problems.load("kepler", e=0.6), np.linspace(0.0, 30.0, 40)
    for method in (HBVM(), Gauss(s=8, h=0.1)):
        plain = integrate(problem, method, times)
        assert np.array_equal(plain.y, integrate(problem, method, times, variations=["y0", "t0"]).y)


@pytest.mark.parametrize("sample", ["partial", "steps", "stop"])
def test_every_way_to_sample_has_them(sample):
    problem, times = problems.load("pendulum"), np.linspace(0.0, 5.0, 4)
    exact = integrate(problem, Gauss(s=8, tol=1e-15), times, variations=["y0", "t0"])
    for method in (Gauss(s=6, h=0.1), HBVM(tol=1e-14)):
        made = integrate(problem, method, times, sample, variations=["y0", "t0"])
        assert made.variations.shape == (*made.y.shape, 3)
        assert np.abs(made.variations[-1] - exact.variations[-1]).max() < 1e-9 or sample == "steps"
        # The derivative with respect to t0 is minus the velocity of where the trajectory has come to.
        slope = np.array([made.y[:, 1], -np.sin(made.y[:, 0])]).T
        assert np.abs(made.variations[:, :, 2] + slope).max() < 1e-9  # measured: 2.2e-16


def test_backwards_many_vectors_and_events():
    problem = problems.load("fput")
    times = [0.0, -1.0, -1.3]
    made = integrate(problem, Gauss(s=8, h=0.1), times, events=lambda q: q[1] - q[2], variations="y0")
    assert made.variations.shape == (3, problem.system.dim, problem.system.dim)  # in groups
    one = integrate(problem, Gauss(s=8, h=0.1), times, variations=np.eye(problem.system.dim)[:, [5]])
    assert np.abs(one.variations[:, :, 0] - made.variations[:, :, 5]).max() < 1e-14  # measured: 0


@pytest.mark.parametrize("method", [Gauss(s=6, h=0.1), Gauss(s=6, tol=1e-9)], ids=repr)
def test_single_steps_take_them_along(method):
    problem, times = problems.load("pendulum"), np.array([2.0])
    program = method.compile(problem.system)
    ends = []
    for singly in (0, 7):
        stepper = program.start(problem.y0, problem.par)
        stepper.follow(np.eye(2), np.zeros((0, 2)))
        for _ in range(singly):
            stepper.step()
        stepper.advance(times)
        ends.append(stepper.variations)
    # measured: 0 with fixed step size; adaptive first steps depend on the interval, 2e-12
    assert np.abs(ends[0] - ends[1]).max() < (0.0 if method.h else 1e-9) + 1e-300


def test_a_solution_keeps_them_in_its_file(tmp_path):
    made = integrate(problems.load("pendulum"), Gauss(s=4, h=0.1), [0.0, 1.0], variations="y0")
    made.save(tmp_path / "solution.npz")
    found = load(tmp_path / "solution.npz")
    assert np.array_equal(found.variations, made.variations)
    assert np.array_equal(found.variations_at([0.5, 1.0]), made.variations_at([0.5, 1.0]))


@pytest.mark.parametrize("method", [Gauss(s=6, h=0.1), HBVM(tol=1e-13), Gauss(s=4, h=0.1, solver="newton")])
def test_a_solution_has_them_at_any_time(method):
    problem = SYSTEMS["masses"]()
    wanted, times = ["y0", "k"], np.array([[0.05, 3.07], [10.0, 4.0]])
    made = integrate(problem, method, [4.0, 8.0, 10.0], variations=wanted)
    exact = integrate(problem, Gauss(s=8, h=0.025), np.unique(times), variations=wanted).variations
    found = made.variations_at(times)
    assert found.shape == (2, 2, 4, 5)
    assert np.array_equal(found[1, 0], made.variations[2])
    error = np.abs(found.reshape(4, 4, 5) - exact[[0, 1, 3, 2]]).max() / np.abs(exact).max()
    assert error < 1e-10
    with pytest.raises(InputError, match="no variations"):
        integrate(problem, method, [1.0]).variations_at(0.5)


@pytest.mark.parametrize(
    "method", [Gauss(s=4, h=0.1), Gauss(s=4, h=0.1, solver="newton"), Gauss(s=4, tol=1e-8)], ids=repr
)
def test_a_run_that_was_broken_off_goes_on_with_them(method, tmp_path):
    """The bits of an unbroken run; the break is after a step that is solved ahead."""
    problem, times = SYSTEMS["masses"](), np.linspace(0.0, 10.0, 38)
    wanted, file = ["y0", "k", "m"], tmp_path / "file"
    whole = integrate(problem, method, times, variations=wanted)

    def stop(progress):
        if progress.t > 4.0:
            raise KeyboardInterrupt

    broken = integrate(
        problem, method, times, variations=wanted, checkpoint=file, every_seconds=0, progress=stop
    )
    assert broken.status is Status.INTERRUPTED
    assert 0 < broken.t.size < times.size
    resumed = integrate(problem, method, times, variations=wanted, resume=file)
    assert np.array_equal(resumed.y, whole.y)
    assert np.array_equal(resumed.variations, whole.variations)
    with pytest.raises(InputError, match="variations"):
        integrate(problem, method, times, variations="y0", resume=file)


def test_a_checkpoint_without_them_is_refused():
    problem = problems.load("pendulum")
    stepper = Gauss(s=4, h=0.1).compile(problem.system).start(problem.y0, problem.par)
    before = stepper.checkpoint()
    stepper.follow(np.eye(2), np.zeros((0, 2)))
    with pytest.raises(InputError, match="no tangent vectors"):
        stepper.restore(before)


def test_an_ensemble_has_those_of_each_trajectory(tmp_path):
    problem, method = SYSTEMS["masses"](), HBVM(tol=1e-12)
    starts = problem.y0 * np.array([[0.9], [1.0], [1.2]])
    asked = {"starts": starts, "parameters": {"k": [1.0, 1.5, 2.0]}, "times": [1.0, 2.5]}
    for threads in (1, 2):
        made = integrate_many(problem, method, **asked, variations=["t0", "k"], threads=threads)
        assert made.variations.shape == (3, 2, 4, 2)
    one = Problem(problem.system, y0=starts[2], parameters={"m": [1.0, 2.5], "k": 2.0}, t_end=10.0)
    alone = integrate(one, method, [1.0, 2.5], variations=["t0", "k"])
    assert np.array_equal(made.variations[2], alone.variations)
    assert np.array_equal(made[2].variations, alone.variations)
    assert np.array_equal(made[1:].variations, made.variations[1:])
    assert np.array_equal(made[2].variations_at(1.7), alone.variations_at(1.7))
    with pytest.raises(InputError, match="leave out backend"):
        integrate_many(problem, method, **asked, variations="y0", sample="steps")
    with pytest.raises(InputError, match="unknown variation"):
        integrate_many(problem, method, **asked, variations="y1")


def test_each_trajectory_of_an_ensemble_has_vectors_of_its_own(tmp_path):
    """The bits of single trajectories, also from a file and after a break."""
    problem, method, times = SYSTEMS["masses"](), Gauss(s=4, tol=1e-9), [1.0, 2.55]
    rng = np.random.default_rng(5)
    starts = problem.y0 * rng.uniform(0.9, 1.1, (3, 1))
    vectors = rng.standard_normal((3, 4, 2))
    asked = {"starts": starts, "times": times, "variations": vectors, "checkpoint": tmp_path / "kept"}

    def stop(progress):
        raise KeyboardInterrupt

    broken = integrate_many(problem, method, **asked, piece=2, progress=stop)
    assert [str(status) for status in broken.status] == ["finished", "finished", "interrupted"]
    assert np.isnan(broken.variations[2]).all()
    made = integrate_many(problem, method, **asked, resume=asked["checkpoint"])
    made.save(tmp_path / "made.npz")
    for found in (made, load(tmp_path / "made.npz"), integrate_many(problem, method, **asked, threads=2)):
        for i in range(3):
            one = integrate(problem.replace(y0=starts[i]), method, times, variations=vectors[i])
            assert np.array_equal(found.y[i], one.y)
            assert np.array_equal(found[i].variations, one.variations)
            assert np.array_equal(found[i].directions[0], vectors[i])
    with pytest.raises(InputError, match=r"\(2, 4, 2\) must be vectors .* of 3 trajectories"):
        integrate_many(problem, method, **asked | {"variations": vectors[:2]})
    with pytest.raises(InputError, match="variations"):
        integrate_many(problem, method, **asked | {"variations": vectors + 1.0}, resume=asked["checkpoint"])


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"variations": "z0"}, "unknown variation 'z0'"),
        ({"variations": np.eye(3)}, "vectors of 2 components"),
        ({"variations": [[np.nan], [0.0]]}, "finite"),
        ({"variations": "y0", "sample": "dense"}, "sample='dense'"),
    ],
)
def test_what_cannot_be_is_said(keywords, words):
    with pytest.raises(InputError, match=words):
        integrate(problems.load("pendulum"), Gauss(s=4, h=0.1), [1.0], **keywords)


def test_line_integrals_have_none():
    with pytest.raises(InputError, match="Runge-Kutta"):
        integrate(problems.load("rigid_body"), HBVM(k=4, s=2, h=0.1), [1.0], variations="y0")


def test_backwards_their_first_values_are_those_of_a_step_backwards():
    problem = problems.load("double_pendulum")
    made = integrate(problem, Gauss(s=8, h=0.05), [-10.0], variations="y0")
    counted = made.stats.extra["variations"]["iterations"]
    assert counted < 1.3 * made.stats.iterations  # measured: 1.09; 2.2 with the tables of a step forwards
