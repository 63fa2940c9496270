import diffrax as dx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import integrators.testing as testing
from integrators import Status, integrate
from integrators.peers.diffrax import solve
from integrators.peers.diffrax.methods import Dopri8, LeapfrogMidpoint, ReversibleHeun, SemiImplicitEuler
from integrators.peers.heyoka.taylor import Taylor
from problems import Hamiltonian, Problem, VectorField, targets

FIXED = [SemiImplicitEuler, LeapfrogMidpoint, ReversibleHeun, Dopri8]


def plain(problem, solver, controller, dt0, end):
    """The same integration by diffrax alone, as its documentation shows."""
    field = targets.jax(problem.system, "field")
    solution = dx.diffeqsolve(
        dx.ODETerm(field),
        solver,
        0.0,
        end,
        dt0,
        jnp.asarray(problem.y0),
        args=jnp.asarray(problem.par),
        saveat=dx.SaveAt(t1=True),
        stepsize_controller=controller,
        max_steps=None,
        adjoint=dx.ForwardMode(),
    )
    return np.asarray(solution.ys[-1]), solution.stats


@pytest.mark.parametrize("solver", FIXED[1:])
def test_fixed_steps_are_those_of_diffeqsolve(solver):
    problem = testing.pendulum()
    theirs, stats = plain(problem, getattr(dx, solver.__name__)(), dx.ConstantStepSize(), 0.125, 20.0)
    ours = integrate(problem, solver(h=0.125), [20.0])
    assert ours.stats.steps == int(stats["num_steps"]) == 160
    # Compiled apart, so rounded apart: 3e-15.
    assert np.max(np.abs(ours.y[-1] - theirs)) < 1e-12


def test_adaptive_steps_are_those_of_diffeqsolve():
    problem = testing.pendulum()
    theirs, stats = plain(problem, dx.Dopri8(), dx.PIDController(rtol=1e-9, atol=1e-11), None, 20.0)
    ours = integrate(problem, Dopri8(rtol=1e-9, atol=1e-11), [20.0])
    assert ours.stats.steps == int(stats["num_accepted_steps"])
    assert ours.stats.rejections == int(stats["num_rejected_steps"])
    assert np.max(np.abs(ours.y[-1] - theirs)) < 1e-12  # 0


def test_the_semi_implicit_euler_step_is_the_textbook_s():
    problem = testing.pendulum()
    q, p = problem.y0
    q = q + 0.25 * p
    p = p - 0.25 * np.sin(q)
    assert np.max(np.abs(integrate(problem, SemiImplicitEuler(h=0.25), [0.25]).y[0] - [q, p])) < 1e-15  # 0


@pytest.mark.parametrize("solver", FIXED)
def test_the_orders_are_those_stated(solver):
    problem = testing.pendulum()
    reference = integrate(problem, Taylor(tol=1e-16), [6.0]).y[0]
    steps = 6.0 / (np.array([12, 16, 24]) if solver is Dopri8 else np.array([400, 600, 900]))
    errors = [np.max(np.abs(integrate(problem, solver(h=h), [6.0]).y[0] - reference)) for h in steps]
    measured = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    # 1.00, 2.00, 2.00, 8.2
    assert measured == pytest.approx(solver(h=1.0).order, abs=0.6)


@pytest.mark.parametrize("solver", FIXED)
def test_samples_leave_fixed_steps_alone_and_are_as_good(solver):
    problem = testing.pendulum()
    h = 0.25 if solver is Dopri8 else 0.01
    few = integrate(problem, solver(h=h), [20.0])
    times = np.sort(np.append(np.linspace(0.123, 19.0, 30), 20.0))
    many = integrate(problem, solver(h=h), times)
    assert np.array_equal(few.y[-1], many.y[-1])
    errors = np.max(np.abs(many.y - integrate(problem, Taylor(), times).y), axis=1)
    assert errors[:-1].max() < 10 * h ** solver(h=h).order  # 1.3e-2, 1.7e-4, 1.2e-4, 4e-8


def test_the_samples_of_an_adaptive_solve_cost_steps_but_not_its_own_length_of_step():
    problem = testing.pendulum()
    grid = np.linspace(0.0, 20.0, 41)
    few, many = (integrate(problem, Dopri8(rtol=1e-9, atol=1e-11), times) for times in ([20.0], grid))
    # One more for each sample at most; were each sample followed by a short step, it would be two.
    assert few.stats.steps < many.stats.steps <= few.stats.steps + 41
    assert np.max(np.abs(few.y[-1] - many.y[-1])) < 1e-8  # 2e-10


@pytest.mark.parametrize(
    "method", [ReversibleHeun(h=0.3), Dopri8(h=0.3), Dopri8(rtol=1e-8, atol=1e-8)], ids=repr
)
def test_a_field_that_is_not_defined_beyond_the_end_is_integrated(method):
    # Kvaerno5 has a node at 1.23 of its steps.
    root = VectorField(lambda t, y, m: [m.sqrt(10.0 - t) ** 5], dim=1)
    made = integrate(Problem(root, y0=[0.0], t_end=10.0), method, [3.3, 7.0, 10.0])
    assert made.status is Status.FINISHED
    error = np.abs(made.y[:, 0] - 2.0 / 7.0 * (10.0**3.5 - (10.0 - made.t) ** 3.5)).max()
    assert error < (10.0 if isinstance(method, ReversibleHeun) else 1e-5)  # measured 0.6, 1e-9, 2.5e-7


@pytest.mark.parametrize("solver", FIXED)
def test_evaluations_are_what_is_evaluated(solver):
    calls = []

    def counted(f):
        def field(t, y, par):
            jax.debug.callback(lambda: calls.append(1))
            return f(t, y, par)

        return dx.ODETerm(field)

    jax.config.update("jax_enable_x64", True)
    split = solver is SemiImplicitEuler
    oscillator = counted(lambda t, y, par: jnp.stack([y[1], -y[0]]))
    halves = dx.ODETerm(lambda t, p, par: p), counted(lambda t, q, par: -q)
    made = solve._fixed(halves if split else oscillator, getattr(dx, solver.__name__)(), 2, 0, split)
    y, par, tau = np.array([1.0, 0.0]), np.zeros(0), np.float64(0.0)
    state = made.begin.call(tau, y, par)
    counts = []
    for steps in (10, 20):
        jax.effects_barrier()
        calls.clear()
        jax.block_until_ready(
            made.run.call(tau, np.float64(0.1), np.int64(0), np.int64(steps), y, state, par)[0]
        )
        jax.effects_barrier()
        counts.append(len(calls))
    assert counts[1] - counts[0] == 10 * solver.evaluations


def test_a_pole_ends_in_underflow_of_the_step_and_not_in_an_endless_loop():
    solution = integrate(testing.blow_up(), Dopri8(rtol=1e-9, atol=1e-11), np.linspace(0.0, 2.0, 41))
    assert solution.status is Status.STEP_UNDERFLOW
    assert solution.t_stop == pytest.approx(1.0, abs=1e-6)
    assert "ulp" in solution.reason


def test_a_field_that_is_not_a_number_ends_in_underflow_too():
    def H(q, p, m):
        return p[0] * p[0] / 2 + m.sqrt(q[0]) * q[0]

    problem = Problem(Hamiltonian(H, dof=1), q0=[1.0], p0=[-3.0], t_end=5.0)
    solution = integrate(problem, Dopri8(rtol=1e-9, atol=1e-11), [0.1, 5.0])
    assert solution.status is Status.STEP_UNDERFLOW
    assert solution.t.size == 1
    assert np.isfinite(solution.y).all()
    solution = integrate(problem, Dopri8(h=0.05), [0.1, 5.0])
    assert solution.status is Status.NOT_FINITE


@pytest.mark.parametrize(
    "method",
    [pytest.param(ReversibleHeun(h=0.01), marks=pytest.mark.slow), Dopri8(rtol=1e-9, atol=1e-11)],
    ids=repr,
)
def test_time_runs_backwards_and_what_that_compiles_is_said(method):
    def H(t, q, p, m):
        return p[0] * p[0] / 2 - m.cos(q[0]) - q[0] * m.sin(t) / 3

    problem = Problem(Hamiltonian(H, dof=1), q0=[0.1], p0=[0.5], t0=1.0, t_end=5.0)
    stepper = method.compile(problem.system).start(problem.y0, problem.par, problem.t0)
    stepper.advance([4.1])
    assert "compile_seconds" not in stepper.stats.extra
    back = stepper.advance([3.0, 1.0])
    assert stepper.stats.extra["compile_seconds"] > 0.0
    assert np.max(np.abs(back.y[-1] - problem.y0)) < 1e-4  # 4e-6, 1e-9


def test_a_second_program_compiles_nothing():
    system = testing.pendulum().system
    Dopri8(h=0.1).compile(system)
    again = Dopri8(h=0.2).compile(system)
    assert again.from_cache is True
    assert again.compile_seconds == 0.0


@pytest.mark.parametrize(
    "method",
    [
        Dopri8(rtol=1e-9, atol=1e-9),
        FIXED[1](h=0.3),
        *(pytest.param(solver(h=0.3), marks=pytest.mark.slow) for solver in FIXED[2:]),
    ],
)
def test_an_end_is_met_by_diffeqsolve_alone(method):
    problem = testing.pendulum()
    fixed = getattr(method, "h", None)
    controller = dx.ConstantStepSize() if fixed else dx.PIDController(rtol=1e-9, atol=1e-9)
    solver = getattr(dx, type(method).__name__)()
    theirs, stats = plain(problem, solver, controller, fixed or 0.01, 20.0)
    stepper = method.compile(problem.system).start(problem.y0, problem.par)
    made = stepper.advance(np.array([20.0]), sample=method.to_end)
    assert made.status is Status.FINISHED
    assert stepper.stats.steps == int(stats["num_accepted_steps"])
    # 0 but for Dopri8, whose stages we keep apart for XLA: 1e-15
    assert np.abs(made.y[0] - theirs).max() < 1e-13
    back = stepper.advance(np.array([0.0]), sample=method.to_end)  # it begins anew there, either way
    assert (back.status, back.t.tolist(), stepper.t) == (Status.FINISHED, [0.0], 0.0)


def test_a_plain_solve_that_does_not_arrive_is_run_again_under_a_watch(monkeypatch):
    monkeypatch.setattr(solve, "MOST_STEPS", 5)
    system = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 - 1.5 * m.cos(q[0]), dof=1, name="watched")
    problem = Problem(system, q0=[1.0], p0=[0.0], t_end=9.0)
    program, end = Dopri8(rtol=1e-9, atol=1e-9).compile(system), np.array([9.0])
    plainly, watched = (program.start(problem.y0) for _ in range(2))
    made = plainly.advance(end, sample="end")
    assert made.status is Status.FINISHED
    assert np.array_equal(made.y, watched.advance(end, sample="stop").y)
    assert plainly.stats.steps == watched.stats.steps > 5


@pytest.mark.parametrize("method", [Dopri8(rtol=1e-9, atol=1e-11), ReversibleHeun(h=0.01)])
def test_many_at_once_are_those_of_one_after_the_other(method):
    problem = testing.pendulum()
    program = method.compile(problem.system)
    starts = np.outer([1.0, 1.01, 0.98], problem.y0)
    made = program.batch(starts, times=[5.0, 10.0])
    alone = [program.start(y0, problem.par).advance(np.array([5.0, 10.0]), sample="end").y for y0 in starts]
    assert (
        np.abs(made.y - alone).max() < 1e-9
    )  # measured 3.5e-11: step sizes chosen from estimates rounded apart
    assert made.steps.min() > 20


def test_one_of_many_that_does_not_arrive_leaves_the_others_alone():
    problem = Problem(VectorField(lambda y: [y[0] ** 2], dim=1), y0=[1.0], t_end=2.0)
    made = Dopri8(h=0.1).compile(problem.system).batch([[0.1], [1.0]], times=[2.0])
    assert made.status == [Status.FINISHED, Status.NOT_FINITE]
    assert made.y[0, -1, 0] == pytest.approx(0.125, rel=1e-12)  # 1 / (10 - 2); measured 0
    assert np.isnan(made.y[1, -1, 0])
