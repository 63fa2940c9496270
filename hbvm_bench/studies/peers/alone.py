"""Every peer alone, as its own documentation writes it: what `check` compares the bench with.

Each function takes a problem and the method whose options to use, prepares and compiles, and returns a
`Script`. The vector field is emitted from the same traced definition. Two small helpers of our adapters
take part, in neither of which anything is integrated: `same_arithmetic`, which restores the processor's modes
after WHFast512, and `_pointer`, which makes an address of REBOUND's a pointer in compiled code.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from integrators.peers import load
from integrators.protocol import Array, MethodBase
from problems import emit
from problems.problem import Problem


class Script(NamedTuple):
    """A library's run in three parts.

    Attributes
    ----------
    begin : callable
        ``begin() -> run`` sets up one run; not timed.
    go : callable
        ``go(run) -> result`` integrates to the end; timed.
    end : callable
        ``end(run, result) -> (steps, y)``: how many steps it took, and the state at the end.
    """

    begin: Callable[[], Any]
    go: Callable[[Any], Any]
    end: Callable[[Any, Any], tuple[int, Array]]


def heyoka(problem: Problem, method: MethodBase) -> Script:
    """``taylor_adaptive(...).propagate_until(t_end)``."""
    hy = load("heyoka")
    ta = hy.taylor_adaptive(
        emit.heyoka(problem.system),
        problem.y0.tolist(),
        pars=problem.par.tolist(),
        **method.options(defaults=True),
    )

    def begin() -> Any:
        ta.time = problem.t0
        ta.state[:] = problem.y0
        return ta

    return Script(begin, lambda ta: ta.propagate_until(problem.t_end), lambda ta, made: (made[3], ta.state))


def heyoka_batch(problem: Problem, method: MethodBase, starts: Array) -> Script:
    """``taylor_adaptive_batch(...).propagate_until([t_end] * lanes)``, as many starts at a time as lanes."""
    hy = load("heyoka")
    lanes, n = hy.recommended_simd_size(), len(starts)
    ta = hy.taylor_adaptive_batch(
        emit.heyoka(problem.system),
        np.zeros((problem.system.dim, lanes)),
        pars=np.tile(problem.par[:, None], (1, lanes)),
        **method.options(defaults=True),
    )
    filled = starts[np.minimum(np.arange(-(-n // lanes) * lanes), n - 1)]

    def go(y: Array) -> list[Any]:
        end, ended = np.full(lanes, problem.t_end), []
        for i in range(0, len(filled), lanes):
            ta.set_time(problem.t0)
            ta.state[:] = filled[i : i + lanes].T
            ta.propagate_until(end)
            y[i : i + lanes] = ta.state.T
            ended += ta.propagate_res
        return ended

    return Script(
        lambda: np.zeros(filled.shape), go, lambda y, ended: (sum(one[3] for one in ended[:n]), y[:n])
    )


def rebound(problem: Problem, method: Any) -> Script:
    """``sim.integrate(t_end)``: bodies under REBOUND's own gravity, or a particle under a compiled force."""
    library = load("rebound")
    from integrators.peers.rebound.whfast512 import same_arithmetic

    bodies, dof = problem.system.bodies, problem.system.dim // 2
    force: Any = None if bodies else _force(problem)
    name, options = type(method).__name__.lower(), method.options()
    h, mode = options.pop("h", None), options.pop("mode", None)

    def begin() -> Any:
        sim = library.Simulation()
        if bodies:
            parameters = problem.system.unpack(problem.par)
            masses = np.atleast_1d(parameters[bodies.masses])
            sim.G = parameters[bodies.G] if isinstance(bodies.G, str) else bodies.G
            x, p = problem.y0.reshape(2, -1, 3)
            for m, (px, py, pz), (vx, vy, vz) in zip(masses, x, p / masses[:, None], strict=True):
                sim.add(m=m, x=px, y=py, z=pz, vx=vx, vy=vy, vz=vz)
        else:
            (x, y), (vx, vy) = problem.y0.reshape(2, dof)
            sim.add(m=1.0, x=x, y=y, vx=vx, vy=vy)
            sim.gravity = "none"
            sim._additional_forces = type(sim._additional_forces)(force.address)
        sim.t = problem.t0
        sim.integrator = name
        chosen: Any = sim.integrator  # not the name, but what holds its options
        for option, value in options.items():
            setattr(chosen, option, value)
        if mode:
            chosen.adaptive_mode = mode
        if h:
            sim.dt = h
        if name == "whfast":
            chosen.safe_mode = 0
        if name == "whfast512":  # made for G = 1, and for many steps at a time
            unit, sim.G = sim.G**0.5, 1.0
            sim.dt *= unit
            for particle in sim.particles:
                particle.vx, particle.vy, particle.vz = (v / unit for v in particle.vxyz)
            chosen.concatenate_steps = round((problem.t_end - problem.t0) / h)
        return sim

    def go(sim: Any) -> None:
        if name == "whfast512":
            with same_arithmetic():
                sim.integrate((problem.t_end - h / 2) * sim.dt / h, exact_finish_time=0)
        else:
            sim.integrate(problem.t_end)

    def end(sim: Any, made: None) -> tuple[int, Array]:
        x = np.array([particle.xyz for particle in sim.particles])
        v = np.array([particle.vxyz for particle in sim.particles])
        if not bodies:
            return sim.steps_done, np.concatenate([x.ravel()[:dof], v.ravel()[:dof]])
        p = v * np.array([[particle.m] for particle in sim.particles])
        if name == "whfast512":
            return sim.integrator.concatenate_steps, np.concatenate([x.ravel(), p.ravel() * sim.dt / h])
        return sim.steps_done, np.concatenate([x.ravel(), p.ravel()])

    return Script(begin, go, end)


def _force(problem: Problem) -> Any:
    """Return the problem's forces as a C function for ``sim.additional_forces``."""
    import numba
    from numba import carray, types  # pyright: ignore[reportPrivateImportUsage]

    from integrators.peers.rebound.hooks import _pointer

    kernel, par, dof = emit.numba(problem.system, "force"), problem.par, problem.system.dim // 2
    particles = load("rebound").Simulation._particles.offset // 8

    @numba.cfunc(types.void(types.voidptr))
    def force(simulation: Any) -> None:
        particle = carray(_pointer(carray(simulation, (128,), np.int64)[particles]), (9,), np.float64)
        kernel(0.0, particle[:dof], par, particle[6 : 6 + dof])  # x y z vx vy vz ax ay az

    return force


def diffrax(problem: Problem, method: Any) -> Script:
    """``jax.jit`` of ``diffeqsolve(ODETerm(f), solver, t0, t_end, dt0, y0)``."""
    dx = load("diffrax", "diffrax", "jax")
    import jax

    jax.config.update("jax_enable_x64", True)
    name, dof = type(method).__name__, problem.system.dim // 2
    if name == "SemiImplicitEuler":
        scale, push = emit.jax(problem.system, "velocity_scale"), emit.jax(problem.system, "force")
        terms: Any = (
            dx.ODETerm(lambda t, p, par: scale(t, p, par) * p),
            dx.ODETerm(lambda t, q, par: push(t, q, par)),
        )
        y0: Any = (problem.y0[:dof], problem.y0[dof:])
    else:
        terms, y0 = dx.ODETerm(emit.jax(problem.system, "field")), problem.y0
    h = getattr(method, "h", None)
    controller = dx.ConstantStepSize() if h else dx.PIDController(rtol=method.rtol, atol=method.atol)

    @jax.jit
    def solve(y0: Any, par: Any) -> Any:
        return dx.diffeqsolve(
            terms, getattr(dx, name)(), problem.t0, problem.t_end, h or 0.01, y0, args=par,
            stepsize_controller=controller, max_steps=None, adjoint=dx.ForwardMode(),
        )  # fmt: skip

    def end(run: None, solution: Any) -> tuple[int, Array]:
        return int(solution.stats["num_accepted_steps"]), np.concatenate(
            [np.asarray(part)[-1] for part in jax.tree.leaves(solution.ys)]
        )

    return Script(lambda: None, lambda run: jax.block_until_ready(solve(y0, problem.par)), end)


def scipy(problem: Problem, method: Any) -> Script:
    """``solve_ivp(f, (t0, t_end), y0, method=..., rtol=..., atol=...)`` with a compiled f."""
    solve_ivp = load("scipy", "scipy.integrate").solve_ivp
    field, par = emit.numba(problem.system, "field"), problem.par

    def f(t: float, y: Array) -> Array:
        out = np.empty(y.size)
        field(t, y, par, out)
        return out

    known = {}
    if type(method).__name__ == "Radau" and (pattern := problem.system.jacobian()) is not None:
        entries = emit.numba(problem.system, pattern)

        def jac(t: float, y: Array) -> Array:
            matrix, values = np.zeros((y.size, y.size)), np.empty(pattern.rows.size)
            entries(t, y, par, values)
            matrix[pattern.rows, pattern.columns] = values
            return matrix

        known["jac"] = jac

    def go(run: None) -> Any:
        return solve_ivp(
            f, (problem.t0, problem.t_end), problem.y0, method=type(method).__name__,
            rtol=method.rtol, atol=method.atol, **known,
        )  # fmt: skip

    return Script(lambda: None, go, lambda run, solution: (solution.t.size - 1, solution.y[:, -1]))
