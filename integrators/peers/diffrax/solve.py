"""Calls of `diffrax.diffeqsolve`, compiled once for any times, steps, tolerances and parameters.

Imported only once diffrax is known to be installed.

diffrax is always given time that goes forward, tau = sign t, so that a solver's own
state can be handed from one call to the next. The times of a fixed step are those of
integer multiples (`Multiples`), and an adaptive solve that was shortened to end at a
sample goes on with the step it would have taken (`Resuming`); both are step size
controllers as diffrax invites its users to write.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Any

import diffrax as dx
import jax
import jax.numpy as jnp
import numpy as np

from problems import targets
from problems.errors import InputError
from problems.problem import System

OK, LIMIT, DT_MIN, OTHER = range(4)
"""How a solve ended: at its end, after the number of steps it was given, or why not."""

ULPS = 4.0
"""An adaptive step of fewer ulp of the time than these has underflowed."""


FIRST_STEP = 0.01
"""The first step that `diffeqsolve` takes where it is left to choose: in diffrax 0.7 always this,
because the choice by the field asks for an `ODETerm` and is given a wrapped one."""

MOST_STEPS = 1 << 24
"""Steps after which a plain adaptive solve, some ten seconds old, gives up and is run again under a watch."""

SMALL_FIELD = 20
"""Lines of a field's source up to which `_apart` costs more than it saves: at 8 it costs, at 38 it saves."""

SHORTENED = 1e-6
"""A step shorter than wanted by this part was shortened, and not only rounded."""


class Multiples(dx.AbstractStepSizeController):
    """Steps from ``base + n h`` to ``base + (n + 1) h``, the products formed anew from the integer n."""

    base: Any
    h: Any
    n: Any

    def wrap(self, direction: Any) -> "Multiples":
        """Leave it as it is: time goes forward."""
        return self

    def init(
        self, terms: Any, t0: Any, t1: Any, y0: Any, dt0: Any, args: Any, func: Any, error_order: Any
    ) -> tuple[Any, Any]:
        """Return the end of the first step, and its number."""
        return self.base + (self.n + 1) * self.h, self.n + 1

    def adapt_step_size(
        self,
        t0: Any,
        t1: Any,
        y0: Any,
        y1_candidate: Any,
        args: Any,
        y_error: Any,
        error_order: Any,
        controller_state: Any,
    ) -> tuple[Any, Any, Any, Any, Any, Any]:
        """Keep the step; return the next."""
        n = controller_state + 1
        return True, t1, self.base + n * self.h, False, n, dx.RESULTS.successful


class Resuming(dx.AbstractAdaptiveStepSizeController):
    """A controller that remembers the step it wanted, ends after ``limit`` steps, and sees underflow.

    Its state: the inner controller's state, the next step's length, steps accepted.
    """

    inner: Any
    limit: Any
    rtol: Any  # those of the inner controller, which an implicit solver asks for
    atol: Any
    norm: Any

    def wrap(self, direction: Any) -> "Resuming":
        """Leave it as it is: time goes forward."""
        return self

    def init(
        self, terms: Any, t0: Any, t1: Any, y0: Any, dt0: Any, args: Any, func: Any, error_order: Any
    ) -> tuple[Any, Any]:
        """Return the end of the first step, and the state."""
        end, inner = self.inner.init(terms, t0, t1, y0, dt0, args, func, error_order)
        return end, (inner, end - t0, jnp.asarray(0))

    def adapt_step_size(
        self,
        t0: Any,
        t1: Any,
        y0: Any,
        y1_candidate: Any,
        args: Any,
        y_error: Any,
        error_order: Any,
        controller_state: Any,
    ) -> tuple[Any, Any, Any, Any, Any, Any]:
        """Ask the inner controller; note the length of the next step."""
        inner, wanted, accepted = controller_state
        keep, next_t0, next_t1, jump, inner, result = self.inner.adapt_step_size(
            t0, t1, y0, y1_candidate, args, y_error, error_order, inner
        )
        # diffeqsolve shortened this step to its end; it was as good as the one wanted.
        shortened = keep & (t1 - t0 < (1.0 - SHORTENED) * wanted)
        next_t1 = jnp.where(shortened, jnp.maximum(next_t1, next_t0 + wanted), next_t1)
        dt = next_t1 - next_t0
        accepted = accepted + jnp.where(keep, 1, 0)
        underflow = dt <= ULPS * jnp.finfo(dt.dtype).eps * jnp.abs(next_t0)
        result = dx.RESULTS.where(underflow, dx.RESULTS.dt_min_reached, result)
        # A result of "event occurred" ends the solve without being a failure.
        ended = (accepted >= self.limit) & (result == dx.RESULTS.successful)
        result = dx.RESULTS.where(ended, dx.RESULTS.event_occurred, result)
        return keep, next_t0, next_t1, jump, (inner, dt, accepted), result


@dataclass
class Compiled:
    """A function compiled ahead of time, and the seconds that took."""

    call: Callable[..., Any]
    seconds: float


@dataclass
class Solve:
    """What is compiled for one field and one solver.

    Attributes
    ----------
    begin : Compiled
        Fixed: ``(tau, y, par) -> solver state``. Adaptive: ``(tau, y, par, rtol,
        atol) -> (solver state, controller state, first step)``.
    run : Compiled
        Fixed: ``(base, h, n0, n1, y, state, par) -> (y, state)``. Adaptive: ``(tau,
        end, dt, y, state, controller state, limit, par, rtol, atol) -> (y, tau, state,
        controller state, dt, accepted, rejected, code)``.
    make_plain : callable
        Compiles `plain`.
    many : callable
        `plain` of many starts and parameters at once, by ``jax.vmap`` under ``jax.jit``.
    """

    begin: Compiled
    run: Compiled
    make_plain: Callable[[], Compiled]
    many: Callable[..., Any]
    seconds: float = field(init=False)

    @cached_property
    def plain(self) -> Compiled:
        """``diffeqsolve`` to one end as its documentation writes it, with diffrax's own controller.

        Fixed: ``(tau, end, h, y, par) -> (y, [accepted, rejected, whether it came there])``. Adaptive:
        ``rtol`` and ``atol`` in the place of ``h``, after ``par``. Compiled when it is first asked for.
        """
        solve = self.make_plain()
        self.seconds += solve.seconds
        return solve

    def __post_init__(self) -> None:
        self.seconds = self.begin.seconds + self.run.seconds


def cpu() -> Any:
    """Return JAX's CPU.

    Raises
    ------
    problems.errors.InputError
        If JAX has been told to leave the CPU alone.
    """
    try:
        return jax.devices("cpu")[0]
    except RuntimeError as error:
        raise InputError(
            f"JAX offers no CPU ({error}); add cpu to JAX_PLATFORMS, since these methods run there."
        ) from error


def _compile(function: Callable[..., Any], *arguments: Any) -> Compiled:
    started = perf_counter()
    with jax.default_device(cpu()):
        call = jax.jit(function).lower(*arguments).compile()
    return Compiled(call, perf_counter() - started)


def _compile_plain(function: Callable[..., Any], *arguments: Any) -> Compiled:
    """Compile as ``jax.jit`` does, by a first call, which is to take no steps.

    A call of what was compiled ahead of time takes 0.1 ms longer, as much as 200 steps of Tsit5 on Kepler's
    problem. It accepts other types, which this one would compile again for; the arguments of a plain solve
    are always of the same.
    """
    started = perf_counter()
    call = jax.jit(function, in_shardings=jax.sharding.SingleDeviceSharding(cpu()))
    jax.block_until_ready(call(*arguments))
    return Compiled(call, perf_counter() - started)


def _many(plain: Callable[..., Any], axes: tuple[int | None, ...]) -> Callable[..., Any]:
    """Return a plain solve of many trajectories at once, which compiles for each number of them."""
    return jax.jit(jax.vmap(plain, in_axes=axes), in_shardings=jax.sharding.SingleDeviceSharding(cpu()))


def _apart(f: Callable[..., Any]) -> Callable[..., Any]:
    """Return the vector field ``f`` behind a condition that always holds.

    XLA would otherwise put the sums of a Runge-Kutta stage into the expression of
    each of the field's components, to be calculated again in each: with the
    condition three bodies take .86 of the time. Small fields (`SMALL_FIELD`) do without: Kepler's took 1.10
    times as long with it.
    """

    def field(tau: Any, y: Any, par: Any) -> Any:
        finite = jnp.isfinite(y[0])
        return jax.lax.cond(finite, lambda y: f(tau, y, par), lambda y: jnp.full_like(y, jnp.nan), y)

    return field


def terms(system: System, sign: int, solver: str) -> Any:
    """Return a system as diffrax's terms in tau = sign t, for `SemiImplicitEuler` q' from p and p' from q."""
    if solver == "SemiImplicitEuler":
        scale, force = targets.jax(system, "velocity_scale"), targets.jax(system, "force")
        return (
            dx.ODETerm(lambda tau, p, par: sign * (scale(sign * tau, p, par) * p)),
            dx.ODETerm(lambda tau, q, par: sign * force(sign * tau, q, par)),
        )
    f = targets.jax(system, "field")
    if solver == "Dopri8" and targets.source(system, "field", "jax").text.count("\n") > SMALL_FIELD:
        f = _apart(f)
    return dx.ODETerm(lambda tau, y, par: sign * f(sign * tau, y, par))


_solves: dict[tuple[Any, ...], Solve] = {}


def solve_for(system: System, solver: str, sign: int, adaptive: bool) -> tuple[Solve, bool]:
    """Return the compiled solve for a system, and whether this process had it already."""
    split = solver == "SemiImplicitEuler"
    whats = ("velocity_scale", "force") if split else ("field",)
    emitted = tuple(targets.source(system, name, "jax").sha256 for name in whats)
    key = (emitted, system.dim, system.n_par, solver, sign, adaptive)
    if known := _solves.get(key):
        return known, True
    make = _adaptive if adaptive else _fixed
    _solves[key] = make(terms(system, sign, solver), getattr(dx, solver)(), system.dim, system.n_par, split)
    return _solves[key], False


def _fixed(terms: Any, solver: Any, dim: int, n_par: int, split: bool) -> Solve:
    def parts(y: Any) -> Any:
        return (y[: dim // 2], y[dim // 2 :]) if split else y

    def whole(y: Any) -> Any:
        return jnp.concatenate(y) if split else y

    def begin(tau: Any, y: Any, par: Any) -> Any:
        return solver.init(terms, tau, tau, parts(y), par)

    def run(base: Any, h: Any, n0: Any, n1: Any, y: Any, state: Any, par: Any) -> Any:
        solution = _solved(
            terms, solver, base + n0 * h, base + n1 * h, h, parts(y), par, Multiples(base, h, n0),
            saveat=dx.SaveAt(t1=True, solver_state=True), solver_state=state,
        )  # fmt: skip
        return whole(jax.tree.map(lambda x: x[-1], solution.ys)), solution.solver_state

    def plain(tau: Any, end: Any, h: Any, y: Any, par: Any) -> Any:
        return _plainly(whole, terms, solver, tau, end, h, parts(y), par, dx.ConstantStepSize())

    tau, y, par, n = np.float64(0.0), np.zeros(dim), np.zeros(n_par), np.int64(0)
    unity = np.float64(1.0)
    first = _compile(begin, tau, y, par)
    last = _compile(run, tau, unity, n, n, y, first.call(tau, y, par), par)
    many = _many(plain, (None, None, None, 0, 0))
    return Solve(first, last, lambda: _compile_plain(plain, tau, tau, unity, y, par), many)


def _solved(
    terms: Any, solver: Any, tau: Any, end: Any, dt: Any, y: Any, par: Any, controller: Any,
    most: int | None = None, **more: Any,
) -> Any:  # fmt: skip
    """Return the solution of a solve that is not differentiated, and raises nothing."""
    return dx.diffeqsolve(
        terms, solver, tau, end, dt, y, args=par, stepsize_controller=controller,
        max_steps=most, adjoint=dx.ForwardMode(), throw=False, **more,
    )  # fmt: skip


def _plainly(whole: Any, *solve: Any) -> Any:
    """Return where a solve ended, and its counts; ``solve`` are the arguments of `_solved`."""
    solution = _solved(*solve)
    stats = solution.stats
    return (
        whole(jax.tree.map(lambda x: x[-1], solution.ys)),
        # one array, for each that is read takes some 10 microseconds
        jnp.stack(
            [
                stats["num_accepted_steps"],
                stats["num_rejected_steps"],
                solution.result == dx.RESULTS.successful,
            ]
        ),
    )


def _adaptive(terms: Any, solver: Any, dim: int, n_par: int, split: bool) -> Solve:
    def controller(limit: Any, rtol: Any, atol: Any) -> Any:
        inner = dx.PIDController(rtol=rtol, atol=atol)
        return Resuming(inner, limit, rtol, atol, inner.norm)

    def begin(tau: Any, y: Any, par: Any, rtol: Any, atol: Any) -> Any:
        control = controller(1, rtol, atol)
        order = solver.error_order(terms)
        end, state = control.init(terms, tau, tau + 1.0, y, FIRST_STEP, par, solver.func, order)
        return solver.init(terms, tau, end, y, par), jax.tree.map(jnp.asarray, state), jnp.asarray(FIRST_STEP)

    def run(tau: Any, end: Any, dt: Any, y: Any, state: Any, control: Any, limit: Any, *rest: Any) -> Any:
        par, rtol, atol = rest
        inner, _, _ = control
        solution = _solved(
            terms, solver, tau, end, dt, y, par, controller(limit, rtol, atol),
            saveat=dx.SaveAt(t1=True, solver_state=True, controller_state=True),
            solver_state=state, controller_state=(inner, dt, jnp.asarray(0)),
        )  # fmt: skip
        after = solution.controller_state
        code = jnp.asarray(OTHER)
        for result, value in (
            (dx.RESULTS.successful, OK),
            (dx.RESULTS.event_occurred, LIMIT),
            (dx.RESULTS.dt_min_reached, DT_MIN),
        ):
            code = jnp.where(solution.result == result, value, code)
        return (
            solution.ys[-1],
            solution.ts[-1],
            solution.solver_state,
            after,
            after[1],
            solution.stats["num_accepted_steps"],
            solution.stats["num_rejected_steps"],
            code,
        )

    def plain(tau: Any, end: Any, y: Any, par: Any, rtol: Any, atol: Any) -> Any:
        control = dx.PIDController(rtol=rtol, atol=atol)
        return _plainly(lambda y: y, terms, solver, tau, end, FIRST_STEP, y, par, control, MOST_STEPS)

    unity, y, par = np.float64(1.0), np.zeros(dim), np.zeros(n_par)
    first = _compile(begin, unity, y, par, unity, unity)
    state, control, dt = first.call(unity, y, par, unity, unity)
    last = _compile(run, unity, unity, dt, y, state, control, np.int64(1), par, unity, unity)
    many = _many(plain, (None, None, 0, 0, None, None))
    return Solve(first, last, lambda: _compile_plain(plain, unity, unity, y, par, unity, unity), many)
