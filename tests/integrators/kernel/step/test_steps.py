"""Steps of the kernel against the method's equations, solved in extended precision."""

import numpy as np
import pytest
from numba import TypingError

import problems
from integrators.coefficients import legendre
from integrators.kernel import tables
from integrators.kernel.native import binary, stages
from integrators.kernel.plan import Plan
from integrators.kernel.program import HBVMProgram
from integrators.protocol import Status
from problems import Hamiltonian, Problem, VectorField, targets

wide = np.longdouble
METHODS = [
    (1, 1), (2, 2), (5, 1), (4, 2), (7, 7), (8, 3), (8, 8), (9, 4), (13, 13), (16, 2), (16, 16),
    (17, 17), (18, 2), (24, 8), (33, 5), (40, 1), (64, 4), (64, 32),
]  # fmt: skip


@pytest.fixture(scope="module")
def chain():
    """Four unequal masses between springs with a cubic force: separable, with factors."""

    def H(q, p, par, m):
        kinetic = sum(p[i] * p[i] / (2 * par.mass[i]) for i in range(4))
        ends = [q[0], *(q[i + 1] - q[i] for i in range(3)), q[3]]
        return kinetic + sum(x * x / 2 + x * x * x * x / 4 for x in ends)

    return Problem(
        Hamiltonian(H, dof=4, parameters={"mass": (1.0, 2.5, 0.3, 1.0)}, name="masses"),
        q0=[0.3, -0.2, 0.5, 0.1], p0=[0.1, 0.4, -0.3, 0.2], t_end=10.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def equal():
    """The same with masses 1, whose factors are in the matrix."""

    def H(q, p, m):
        ends = [q[0], *(q[i + 1] - q[i] for i in range(3)), q[3]]
        return sum(x * x for x in p) / 2 + sum(x * x / 2 + x * x * x * x / 4 for x in ends)

    return Problem(
        Hamiltonian(H, dof=4, name="unit_masses"),
        q0=[0.3, -0.2, 0.5, 0.1], p0=[0.1, 0.4, -0.3, 0.2], t_end=10.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def driven():
    """Three equations that depend on time."""

    def f(t, y):
        return [y[1] * t - y[2], y[2] * y[0] - y[1], 1 / (1 + t * t) - y[0] * y[2]]

    return Problem(VectorField(f, dim=3, name="driven"), y0=[0.4, -0.3, 0.6], t_end=5.0)


def reference(problem, k, s, h, steps, t0=0.0):
    """The states after each step: HBVM(k, s) in extended precision, iterated to its rounding."""
    t = legendre.tables(k, s)
    integrals = t.integrals.hi.astype(wide) + t.integrals.lo
    projection = t.projection.hi.astype(wide) + t.projection.lo
    nodes = t.nodes.hi.astype(wide) + t.nodes.lo
    source = targets.source(problem.system, "field", "numpy")

    def f(times, y):
        namespace = {"np": np}
        exec(source.text, namespace)  # noqa: S102 -- the emitted text, on extended precision
        out = np.empty_like(y)
        par = problem.par.astype(wide)[:, None]
        namespace[source.name](times, y, par, out)
        return out

    y, states = problem.y0.astype(wide), []
    for n in range(steps):
        times = wide(t0) + (n + nodes) * wide(h)
        stages = np.repeat(y[:, None], k, axis=1)
        moved = 1.0
        while moved > 1e-19:
            gamma = projection @ f(times, stages).T
            before, stages = stages, y[:, None] + wide(h) * (integrals @ gamma).T
            moved = np.abs(stages - before).max()
        y = y + wide(h) * (projection @ f(times, stages).T)[0]
        states.append(y)
    return np.array(states)


def steps_of(problem, k, s, h, steps, form=None, t0=0.0):
    program = HBVMProgram(problem.system, Plan(k=k, s=s, h=h, form=form))
    stepper = program.start(problem.y0, problem.par, t0)
    states = []
    for _ in range(steps):
        assert stepper.step() is Status.RUNNING
        states.append(stepper.y)
    return np.array(states), stepper


@pytest.mark.parametrize("form", ["first", "second"])
@pytest.mark.parametrize(("k", "s"), METHODS)
def test_steps_are_the_methods_own_to_rounding(chain, k, s, form):
    expected = reference(chain, k, s, 0.25, 3)
    found, stepper = steps_of(chain, k, s, 0.25, 3, form)
    # States are of size 0.5; measured 1.3e-16.
    assert np.abs(found - expected).max() < 3e-16
    assert stepper.stats.extra["form"] == form


@pytest.mark.parametrize(("k", "s", "h"), [(8, 8, -0.3), (16, 5, 0.5), (3, 3, 1e-6), (18, 2, 0.1)])
def test_factors_in_the_matrix_change_nothing(equal, k, s, h):
    expected = reference(equal, k, s, h, 4)
    stepper = HBVMProgram(equal.system, Plan(k=k, s=s, h=abs(h))).start(equal.y0)
    found = stepper.advance(np.arange(1, 5) * h).y
    assert np.abs(found - expected).max() < 3e-16  # measured 1.2e-16


@pytest.mark.parametrize(("k", "s"), [(4, 4), (11, 3), (20, 2)])
def test_stages_know_their_times(driven, k, s):
    t0 = 0.7
    expected = reference(driven, k, s, 0.125, 4, t0)
    found, _ = steps_of(driven, k, s, 0.125, 4, t0=t0)
    assert np.abs(found - expected).max() < 3e-16  # measured 1.1e-16


@pytest.mark.parametrize("form", ["first", "second"])
@pytest.mark.parametrize(("k", "s"), [(5, 2), (8, 8), (16, 7), (24, 2)])
def test_idle_lanes_and_routes_change_only_rounding(chain, monkeypatch, k, s, form):
    expected, _ = steps_of(chain, k, s, 0.25, 3, form)
    tables.constants.cache_clear()
    for lanes in (8, 16):
        for route in (tables.WIDE, tables.THROUGH):
            monkeypatch.setattr(tables, "lanes_for", lambda k, lanes=lanes: lanes)
            monkeypatch.setattr(tables, "route_for", lambda k, s, lanes, route=route: route)
            tables.constants.cache_clear()
            found, stepper = steps_of(chain, k, s, 0.25, 3, form)
            assert stepper._context.route == route
            assert np.abs(found - expected).max() < 4e-16, (lanes, route)  # measured 1.7e-16
    tables.constants.cache_clear()


def test_the_state_carries_what_it_lacks(equal):
    expected = reference(equal, 4, 4, 0.03125, 300)[-1]
    found, _ = steps_of(equal, 4, 4, 0.03125, 300)
    # Measured 3e-16: rounding errors of 300 single steps have not piled up.
    assert np.abs(found[-1] - expected).max() < 1.5e-15


@pytest.mark.parametrize("h", [1.0, 1.25, 0.1, 0.3])
@pytest.mark.parametrize(
    ("k", "s", "second", "gain"),
    # Measured for the worst row: 0.05, 0.02, 0.1, 0.25, 0.06.
    [(8, 8, True, 0.1), (16, 16, True, 0.05), (24, 24, False, 0.2), (8, 8, False, 0.4), (16, 4, False, 0.15)],
)
def test_rows_of_the_matrix_keep_their_moments(k, s, second, gain, h):
    constants = tables.constants(k, s, second, tables.lanes_for(k))
    arrays = constants.arrays
    high, low = tables.times(arrays["matrix"], arrays["matrix_low"], h)
    rounded = tables.keep_moments(high, low, arrays["basis"])
    lost = ((high - rounded) + low) @ arrays["basis"]
    assert np.abs(lost).max() < gain * 3e-17 * h  # 3e-17: what plain rounding may lose
    assert np.abs(rounded - high).max() <= 10 * np.spacing(np.abs(high).max())


@pytest.mark.parametrize("k", [1, 2, 5, 8])
def test_two_steps_are_extrapolated_exactly_as_far_as_their_values_tell(k):
    nodes = legendre.tables(k, k).nodes.hi
    known, wanted = np.concatenate([nodes, 1 + nodes]), 2 + nodes
    table = legendre.two_step_extrapolation(k, tables.MODES)
    for degree in range(min(2 * k, tables.MODES)):
        expected = (wanted / 3) ** degree
        # Measured 3e-10, for k = 8: rounding, a million times.
        assert np.abs(table @ (known / 3) ** degree - expected).max() < 1e-9


def test_two_steps_give_eight_stages_a_better_start():
    problem = problems.load("outer_solar_system")
    stepper = HBVMProgram(problem.system, Plan(k=8, s=8, h=1.0)).start(problem.y0)
    stepper.advance([1000.0])
    iterations, steps = stepper._context.counters.iterations, stepper._context.counters.steps
    assert iterations < 6.3 * steps  # measured 5.9, from one step 6.7


def test_divergence_and_nan_are_outcomes_with_a_time(chain):
    def f(t, y, m):
        return [m.sqrt(1.0 - t) * y[0]]

    stepper = HBVMProgram(
        VectorField(f, dim=1, name="until_one"), Plan(k=4, s=4, h=0.3, solver="fixed_point")
    ).start([1.0])
    samples = stepper.advance(np.arange(0.0, 3.0, 0.3))
    assert samples.status is stepper.status is Status.NOT_FINITE
    assert samples.t.size == 4  # 0 .. 0.9
    assert np.isfinite(samples.y).all()
    assert np.isfinite(stepper.y).all()
    assert stepper.t == pytest.approx(0.9)

    def overflow(y, m):
        return [m.exp(y[0])]

    stepper = HBVMProgram(
        VectorField(overflow, dim=1, name="blow_up"), Plan(k=4, s=4, h=0.5, solver="fixed_point")
    ).start([3.0])
    assert stepper.step() in (Status.NONLINEAR_DIVERGENCE, Status.NOT_FINITE)
    assert stepper.y == [3.0]
    assert "t = 0.0" in stepper.reason


def test_a_field_that_cannot_run_on_lanes_runs_stage_by_stage(chain, driven, monkeypatch, tmp_path):
    problems = (chain, driven)
    expected = [steps_of(problem, 6, 3, 0.2, 5) for problem in problems]

    def refuse(function, lanes, stride):
        raise TypingError("not on lanes")

    kernel = {name: code for name, code in binary._loaded.items() if code.note == " "}
    monkeypatch.setattr(binary, "_loaded", kernel)
    monkeypatch.setattr(stages, "build_on_lanes", refuse)
    monkeypatch.setenv("HBVM_BENCH_CACHE", str(tmp_path))
    for problem, (states, stepper) in zip(problems, expected, strict=True):
        found, alone = steps_of(problem, 6, 3, 0.2, 5)
        assert stepper.stats.extra["lanes"] is True
        assert alone.stats.extra["lanes"] is False
        assert alone.stats.evaluations == stepper.stats.evaluations
        assert np.array_equal(found, states)


@pytest.mark.parametrize("q", [5e-324, 2.2e-309, 1e-201])
def test_a_start_too_small_to_divide_by_is_as_good_as_zero(q):
    problem = problems.load("pendulum")
    program = HBVMProgram(problem.system, Plan(k=8, s=4, h=0.1))
    tiny, zero = (program.start([start, 0.375], problem.par).advance([10.0]) for start in (q, 0.0))
    assert tiny.status is Status.FINISHED
    assert np.abs(tiny.y - zero.y).max() < 1e-14  # measured 0
