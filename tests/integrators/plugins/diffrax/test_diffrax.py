"""HBVM and Gauss inside diffrax: order, dense output, gradients, batches, PyTrees, precision."""

import functools
from typing import Any

import numpy as np
import pytest

dx: Any = pytest.importorskip("diffrax")

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402

from integrators.plugins.diffrax import HBVM, Gauss  # noqa: E402
from problems.errors import InputError  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore:Complex")


@pytest.fixture(autouse=True)
def _double() -> Any:
    before = jax.config.jax_enable_x64  # pyright: ignore[reportAttributeAccessIssue]
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


def field(t: Any, y: Any, args: Any) -> Any:
    return jnp.stack([y[1], -args * jnp.sin(y[0])])


@functools.partial(jax.jit, static_argnames=("solver", "direct"))
def ends(solver: Any, steps: int, y0: Any, g: Any, span: float = 3.0, direct: bool = False) -> Any:
    """The pendulum at the end of ``steps`` equal steps, at most 100; compiled once for any number of them."""
    adjoint = dx.DirectAdjoint() if direct else dx.RecursiveCheckpointAdjoint()
    solution = dx.diffeqsolve(
        dx.ODETerm(field), solver, 0.0, span, span / steps, y0, args=g, max_steps=100, adjoint=adjoint
    )
    return solution.ys[-1]


def energy(y: np.ndarray) -> np.ndarray:
    return y[..., 1] ** 2 / 2 - np.cos(y[..., 0])


@pytest.mark.parametrize("solver", [HBVM(k=3, s=1), HBVM(k=5, s=2), Gauss(s=2)])
def test_the_order_on_a_nonlinear_problem_is_2s(solver: Any) -> None:
    y0 = jnp.array([0.0, 1.9])
    best = ends(Gauss(s=8), 30, y0, 1.0)
    errors = [float(jnp.abs(ends(solver, n, y0, 1.0) - best).max()) for n in (40, 80)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * solver.s, abs=0.15)


def test_dense_output_is_the_step_at_its_ends_and_of_order_s_plus_1_between() -> None:
    @jax.jit
    def solved(n: Any, t: Any) -> Any:
        solution = dx.diffeqsolve(
            dx.ODETerm(field), HBVM(k=5, s=2), 0.0, 3.0, 3.0 / n, jnp.array([0.0, 1.9]), args=1.0,
            saveat=dx.SaveAt(dense=True, steps=True), max_steps=41,
        )  # fmt: skip
        at_nodes = jax.vmap(solution.evaluate)(jnp.minimum(solution.ts, 3.0))  # inf after the last
        return solution.ys, at_nodes, solution.evaluate(t), solution.derivative(t)

    def between(n: int) -> float:
        t = 3.0 * (n // 2 + 0.3) / n
        states, at_nodes, value, slope = map(np.asarray, solved(n, t))
        assert np.abs(at_nodes[:n] - states[:n]).max() < 1e-14  # measured 4e-16
        assert np.abs(slope - field(0.0, value, 1.0)).max() < 20.0 / n**2
        return float(np.abs(value - ends(Gauss(s=8), 30, jnp.array([0.0, 1.9]), 1.0, t)).max())

    assert np.log2(between(20) / between(40)) == pytest.approx(3.0, abs=0.5)


def loss(solver: Any, y0: Any, g: Any, direct: bool = False) -> Any:
    end = ends(solver, 20, y0, g, direct=True) if direct else ends(solver, 20, y0, g)
    return end[0] * end[1] + end[1] ** 2


slopes = jax.jit(jax.grad(loss, argnums=(1, 2)), static_argnames=("solver", "direct"))


@pytest.mark.parametrize(
    ("solver", "controller"),
    [(HBVM(k=8, s=4), dx.PIDController(rtol=1e-8, atol=1e-8)), (Gauss(s=3), dx.ConstantStepSize())],
    ids=["adaptive", "fixed"],
)
def test_the_field_is_not_evaluated_outside_the_interval(solver: Any, controller: Any) -> None:
    asked: list[float] = []

    def driven(t: Any, y: Any, args: Any) -> Any:
        jax.debug.callback(lambda t: asked.append(float(t)), t)
        return jnp.stack([y[1], -y[0] + jnp.sqrt(args - t)])

    @jax.jit
    def solved(t0: Any, t1: Any) -> Any:
        return dx.diffeqsolve(
            dx.ODETerm(driven), solver, t0, t1, 0.3, jnp.array([1.0, 0.0]), args=t1,
            stepsize_controller=controller, saveat=dx.SaveAt(ts=jnp.linspace(t0, t1, 7)),
        ).ys  # fmt: skip

    for t0, t1 in ((0.0, 10.0), (1.3, 4.7), (1e3, 1e3 + 0.7)):
        assert np.isfinite(solved(t0, t1)).all()
        jax.effects_barrier()
        assert t0 <= min(asked) < max(asked) <= t1
        asked.clear()


def start() -> Any:
    return jnp.array([0.3, 1.5]), jnp.asarray(1.1)


@pytest.mark.parametrize("solver", [HBVM(k=8, s=4), pytest.param(Gauss(s=3), marks=pytest.mark.slow)])
def test_gradients_agree_with_finite_differences(solver: Any) -> None:
    (y0, g), eps = start(), 1e-3
    gradient = np.hstack(slopes(solver, y0, g))
    found = []
    for i in range(3):
        e = eps * np.eye(3)[i]
        f = [float(loss(solver, y0 + m * e[:2], g + m * e[2])) for m in (-2, -1, 1, 2)]
        found.append((f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * eps))
    assert np.abs(gradient - found).max() <= 1e-6 * np.abs(gradient).max()  # measured 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("solver", [HBVM(k=8, s=4), Gauss(s=3)])
def test_gradients_agree_between_the_adjoints(solver: Any) -> None:
    gradient, other = (np.hstack(slopes(solver, *start(), direct=direct)) for direct in (False, True))
    assert np.abs(gradient - other).max() <= 1e-12 * np.abs(gradient).max()  # measured 2e-16


@pytest.mark.slow
def test_gradients_agree_with_the_backsolve_adjoint() -> None:
    def loss(g: Any, adjoint: Any) -> Any:
        solution = dx.diffeqsolve(
            dx.ODETerm(field), HBVM(k=8, s=4), 0.0, 3.0, 0.1, jnp.array([0.3, 1.5]), args=g, adjoint=adjoint
        )
        return solution.ys[-1, 0]

    gradients = [
        float(jax.grad(loss)(jnp.asarray(1.1), adjoint))
        for adjoint in (dx.RecursiveCheckpointAdjoint(), dx.BacksolveAdjoint(solver=HBVM(k=8, s=4)))
    ]
    assert gradients[0] == pytest.approx(gradients[1], rel=1e-6)  # measured 1e-12


def test_a_batch_of_ten_thousand_pendulums_equals_the_loop() -> None:
    solver, n = HBVM(k=8, s=4), 10_000
    y0 = jnp.stack([jnp.linspace(-1.0, 1.0, n), jnp.linspace(0.1, 1.6, n)], axis=1)
    g = jnp.asarray(1.0)
    batch = np.asarray(jax.vmap(lambda y: ends(solver, 10, y, g))(y0))
    assert np.abs(energy(batch) - energy(np.asarray(y0))).max() < 1e-13  # measured 2e-15
    for i in np.linspace(0, n - 1, 25).astype(int):
        alone = np.asarray(ends(solver, 10, y0[i], g))
        assert np.abs(batch[i] - alone).max() < 1e-13  # measured 1e-15: XLA rounds batches otherwise


def test_a_controller_chooses_steps_and_the_energy_is_conserved_with_them() -> None:
    solution = dx.diffeqsolve(
        dx.ODETerm(field), HBVM(k=12, s=4), 0.0, 30.0, None, jnp.array([0.0, 1.9]), args=1.0,
        stepsize_controller=dx.PIDController(rtol=1e-6, atol=1e-6), saveat=dx.SaveAt(steps=True),
    )  # fmt: skip
    used = int(solution.stats["num_accepted_steps"])
    lengths = np.diff(np.asarray(solution.ts)[:used])
    assert lengths.max() > 1.3 * lengths.min()
    y = np.asarray(solution.ys)[:used]
    assert np.abs(energy(y) - energy(np.array([0.0, 1.9]))).max() < 1e-12  # measured 1e-14


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.complex64])
def test_pytrees_in_single_precision_stay_what_they_are(dtype: Any) -> None:
    y0 = {"a": jnp.ones((2, 3), dtype), "b": jnp.ones((), dtype), "c": jnp.ones((0, 2), dtype)}
    with jax.numpy_dtype_promotion("strict"):
        solution = dx.diffeqsolve(
            dx.ODETerm(lambda t, y, args: jax.tree.map(jnp.negative, y)), HBVM(k=4, s=2),
            jnp.float32(0.0), jnp.float32(1.0), jnp.float32(0.1), y0,
            stepsize_controller=dx.PIDController(rtol=1e-6, atol=1e-6),
        )  # fmt: skip
    for key, start in y0.items():
        assert solution.ys[key].dtype == dtype
        assert solution.ys[key].shape == (1, *start.shape)
        assert (
            np.abs(np.asarray(solution.ys[key]) - np.exp(-1.0)).max(initial=0.0) < 1e-5
        )  # measured 1.6e-6 with these tolerances


def test_newton_takes_over_where_the_fixed_point_fails_and_the_failure_is_a_result() -> None:
    import optimistix

    stiff = dx.ODETerm(lambda t, y, args: -1000.0 * (y - jnp.cos(t)))

    def solve(solver: Any) -> Any:
        return dx.diffeqsolve(stiff, solver, 0.0, 1.0, 0.1, jnp.array([1.0]), throw=False)

    failed = solve(Gauss(s=2))
    assert failed.result == dx.RESULTS.nonlinear_divergence
    solved = solve(Gauss(s=2, root_finder=optimistix.Newton(rtol=1e-12, atol=1e-12)))
    assert solved.result == dx.RESULTS.successful
    assert float(jnp.abs(solved.ys[-1, 0] - np.cos(1.0))) < 1e-2  # measured 1e-3


@pytest.mark.parametrize("solver", [Gauss(s=1), HBVM(k=4, s=2)])
def test_a_step_whose_iteration_overflows_is_taken_again_with_a_shorter_one(solver: Any) -> None:
    steep = dx.ODETerm(lambda t, y, args: -10.0 * y**3)
    solution = dx.diffeqsolve(
        steep, solver, 0.0, 1.0, 1.0, 1.0, stepsize_controller=dx.PIDController(rtol=1e-5, atol=1e-5)
    )
    assert int(solution.stats["num_rejected_steps"]) > 0
    assert float(solution.ys[-1]) == pytest.approx(21.0**-0.5, abs=1e-4)  # measured 1e-6


def test_numbers_that_make_no_method_are_refused() -> None:
    with pytest.raises(InputError, match="k=2 is less than s=3"):
        HBVM(k=2, s=3)
    with pytest.raises(InputError, match="s=0 of the solver must be a whole number of at least 1"):
        Gauss(s=0)


@pytest.mark.parametrize("solver", [HBVM(k=8, s=7), Gauss(s=8)], ids=["HBVM", "Gauss"])
def test_the_absolute_tolerance_of_a_controller_is_kept_from_rest(solver: Any) -> None:
    term = dx.ODETerm(lambda t, y, args: -y + jnp.tanh(4 * (t - 5)) + 1)
    controller = dx.PIDController(rtol=1e-8, atol=1e-8)
    found = dx.diffeqsolve(term, solver, 0.0, 10.0, 0.1, jnp.zeros(1), stepsize_controller=controller)
    assert abs(float(found.ys[-1, 0]) - 1.986171412) < 1e-7
