"""Every peer alone, as its own documentation writes it: what the campaign `peers` compares the bench with.

``peers.alone:Taylor(tol=1e-15)`` is `integrators.Taylor` with the options that it has, and none of its
adapter: setting up and compiling are the library's own calls, and the clock runs for one call of the library
and for reading the state at the end, as it does through the adapter. The vector field is emitted from the
same definition. Two small helpers of the adapters take part, in neither of which anything is integrated:
`same_arithmetic`, which restores the processor's modes after WHFast512, and `_pointer`, which makes an
address of REBOUND's a pointer in compiled code.
"""

from collections.abc import Callable
from functools import cached_property
from time import perf_counter
from typing import Any, NamedTuple, cast

import numpy as np

from integrators import registry
from integrators.peers import load
from integrators.peers.gravity import masses_and_constant
from integrators.protocol import Array, Compiled, MethodBase, Samples, Stats, Status, Trajectories
from problems import targets
from problems.problem import System


class Call(NamedTuple):
    """One run of a library, which is set up.

    Attributes
    ----------
    go : callable
        ``go(t_end)`` integrates to the end; timed.
    end : callable
        ``end(what go returned) -> (steps, y)``: how many steps it took, and the state at the end.
    """

    go: Callable[[float], Any]
    end: Callable[[Any], tuple[int, Array]]


Begin = Callable[[Array, Array, float], Call]
"""``begin(y0, par, t0)`` sets up a run; not timed."""
Script = Callable[[System, Any], Begin]
"""What compiles a method for a system."""


class Program(Compiled):
    """A library's own calls for one system; satisfies `integrators.protocol.Program`."""

    from_cache: bool | None = None

    def __init__(self, system: System, method: Any, script: Script):
        started = perf_counter()
        self.system, self.method = system, method
        self._begin = script(system, method)
        self.compile_seconds = perf_counter() - started

    def start(self, y0: Array, par: Array | None = None, t0: float = 0.0) -> "Stepper":
        """Return a run that is set up."""
        return Stepper(self._begin(y0, self.system.pack({}) if par is None else par, t0), y0, t0)


class Stepper:
    """A run of a library; satisfies `integrators.protocol.Stepper`, but that it takes no single steps."""

    def __init__(self, call: Call, y0: Array, t0: float):
        self._call, self.t, self.y = call, t0, y0
        self.status, self.reason, self.stats = Status.RUNNING, "", Stats()

    def step(self) -> Status:
        """Refuse."""
        raise NotImplementedError("a library alone is asked for whole integrations")

    def advance(self, times: Array, *, sample: str | None = None) -> Samples:
        """Integrate from one of the times to the next, each as the library itself goes to an end."""
        del sample
        states = np.empty((times.size, self.y.size))
        for i, t in enumerate(times.tolist()):
            if t != self.t:
                steps, self.y = self._call.end(self._call.go(t))
                self.t, self.stats.steps = t, steps
            states[i] = self.y
        return Samples(times, states, Status.FINISHED)


class BatchProgram(Program):
    """The same with heyoka's batches: ``taylor_adaptive_batch(...).propagate_until([t_end] * lanes)``."""

    def prepare_batch(
        self, Y0: Array, par: Array | None = None, *, times: Array, t0: float = 0.0
    ) -> Callable[[], Trajectories]:
        """Set up as many trajectories at a time as there are SIMD lanes; all have the system's parameters."""
        n, lanes = len(Y0), self._batch.batch_size
        filled = Y0[np.minimum(np.arange(-(-n // lanes) * lanes), n - 1)]
        parameters = self.system.pack({}) if par is None else np.atleast_2d(par)[0]
        self._batch.pars[:] = parameters[:, None]
        end, y = np.full(lanes, times[-1]), np.zeros(filled.shape)

        def go() -> Trajectories:
            ended = []
            for i in range(0, len(filled), lanes):
                self._batch.set_time(t0)
                self._batch.state[:] = filled[i : i + lanes].T
                self._batch.propagate_until(end)
                y[i : i + lanes] = self._batch.state.T
                ended += self._batch.propagate_res
            return Trajectories(
                t=times[-1:],
                y=y[:n, None],
                status=[Status.FINISHED] * n,
                reason=[""] * n,
                t_stop=np.full(n, times[-1]),
                steps=np.array([outcome[3] for outcome in ended[:n]]),
            )

        return go

    @cached_property
    def _batch(self) -> Any:
        hy = load("heyoka")
        lanes = hy.recommended_simd_size()
        return hy.taylor_adaptive_batch(
            targets.heyoka(self.system),
            np.zeros((self.system.dim, lanes)),
            pars=np.zeros((self.system.n_par, lanes)),
            **_options(self.method)[1],
        )


def _options(method: MethodBase) -> tuple[bool, dict[str, Any]]:
    """Return whether bodies are heyoka's own model, and the options of heyoka's integrator."""
    options = method.options(defaults=True)
    return options.pop("nbody"), options


def _heyoka(system: System, method: MethodBase) -> Begin:
    """``taylor_adaptive(...).propagate_until(t_end)``."""
    hy = load("heyoka")
    nbody, options = _options(method)
    if nbody:
        return _bodies_of_heyoka(system, options)
    integrator = hy.taylor_adaptive(
        targets.heyoka(system), [0.0] * system.dim, pars=[0.0] * system.n_par, **options
    )

    def begin(y0: Array, par: Array, t0: float) -> Call:
        integrator.time, integrator.state[:], integrator.pars[:] = t0, y0, par
        return Call(integrator.propagate_until, lambda ended: (ended[3], integrator.state.copy()))

    return begin


def _bodies_of_heyoka(system: System, options: dict[str, Any]) -> Begin:
    """Do the same with ``model.nbody``, whose state is position and velocity of one body after the other."""
    hy = load("heyoka")
    masses, G = masses_and_constant(system, system.pack({}))
    model = hy.model.nbody(len(masses), masses=masses.tolist(), Gconst=G)
    integrator = hy.taylor_adaptive(model, [0.0] * system.dim, **options)
    scale = np.stack([np.ones_like(masses), masses])[:, :, None]

    def begin(y0: Array, par: Array, t0: float) -> Call:
        by_body = (y0.reshape(2, -1, 3) / scale).transpose(1, 0, 2)
        integrator.time, integrator.state[:] = t0, by_body.ravel()

        def end(ended: Any) -> tuple[int, Array]:
            return ended[3], (integrator.state.reshape(-1, 2, 3).transpose(1, 0, 2) * scale).ravel()

        return Call(integrator.propagate_until, end)

    return begin


def _rebound(system: System, method: Any) -> Begin:
    """``sim.integrate(t_end)``: bodies under REBOUND's own gravity, or a particle under a compiled force."""
    library = load("rebound")
    from integrators.peers.rebound.whfast512 import same_arithmetic

    bodies, dof = system.bodies, system.dim // 2
    name, options = type(method).__name__.lower(), method.options()
    h, mode = options.pop("h", None), options.pop("mode", None)
    forces: dict[bytes, Any] = {}  # by the parameters, which are written into them; addresses are kept

    def begin(y0: Array, par: Array, t0: float) -> Call:
        sim: Any = library.Simulation()
        if bodies:
            masses, sim.G = masses_and_constant(system, par)
            x, p = y0.reshape(2, -1, 3)
            for m, (px, py, pz), (vx, vy, vz) in zip(masses, x, p / masses[:, None], strict=True):
                sim.add(m=m, x=px, y=py, z=pz, vx=vx, vy=vy, vz=vz)
        else:
            (x, y), (vx, vy) = y0.reshape(2, dof)
            sim.add(m=1.0, x=x, y=y, vx=vx, vy=vy)
            sim.gravity = "none"
            key = par.tobytes()
            forces[key] = forces.get(key) or _force(system, par)
            sim._additional_forces = type(sim._additional_forces)(forces[key].address)
        sim.t = t0
        sim.integrator = name
        chosen: Any = sim.integrator  # not the name, but what holds its options
        for option, value in options.items():
            setattr(chosen, option, value)
        if mode:
            chosen.adaptive_mode = mode
        if h:
            sim.dt = h
        if name in ("whfast", "saba"):
            chosen.safe_mode = 0
        if name == "whfast512":  # made for G = 1, and for many steps at a time
            unit, sim.G = sim.G**0.5, 1.0
            sim.dt *= unit
            for particle in sim.particles:
                particle.vx, particle.vy, particle.vz = (v / unit for v in particle.vxyz)
            return _in_one_go(sim, chosen, h, t0)

        def end(nothing: None) -> tuple[int, Array]:
            q = np.array([particle.xyz for particle in sim.particles])
            v = np.array([particle.vxyz for particle in sim.particles])
            if not bodies:
                return sim.steps_done, np.concatenate([q.ravel()[:dof], v.ravel()[:dof]])
            p = v * np.array([[particle.m] for particle in sim.particles])
            return sim.steps_done, np.concatenate([q.ravel(), p.ravel()])

        return Call(sim.integrate, end)

    def _in_one_go(sim: Any, chosen: Any, h: float, t0: float) -> Call:
        def go(t_end: float) -> int:
            chosen.concatenate_steps = round((t_end - t0) / h)
            if chosen.concatenate_steps:
                with same_arithmetic():
                    sim.integrate((t_end - t0 - h / 2) * sim.dt / h, exact_finish_time=0)
            return chosen.concatenate_steps

        def end(steps: int) -> tuple[int, Array]:
            q = np.array([particle.xyz for particle in sim.particles])
            p = np.array([particle.vxyz for particle in sim.particles]) * np.array(
                [[particle.m] for particle in sim.particles]
            )
            return steps, np.concatenate([q.ravel(), p.ravel() * sim.dt / h])

        return Call(go, end)

    return begin


def _force(system: System, par: Array) -> Any:
    """Return the system's forces as a C function for ``sim.additional_forces``."""
    import numba
    from numba import carray, types  # pyright: ignore[reportPrivateImportUsage]

    from integrators.peers.rebound.hooks import _pointer

    kernel, dof = targets.numba(system, "force"), system.dim // 2
    particles = load("rebound").Simulation._particles.offset // 8

    @numba.cfunc(types.void(types.voidptr))
    def force(simulation: Any) -> None:
        particle = carray(_pointer(carray(simulation, (128,), np.int64)[particles]), (9,), np.float64)
        kernel(0.0, particle[:dof], par, particle[6 : 6 + dof])  # x y z vx vy vz ax ay az

    return force


def _diffrax(system: System, method: Any) -> Begin:
    """``jax.jit`` of ``diffeqsolve(ODETerm(f), solver, t0, t_end, dt0, y0)``."""
    dx = load("diffrax", "diffrax", "jax")
    import jax

    jax.config.update("jax_enable_x64", True)
    name, dof = type(method).__name__, system.dim // 2
    halves = name == "SemiImplicitEuler"
    if halves:
        scale, push = targets.jax(system, "velocity_scale"), targets.jax(system, "force")
        terms: Any = (
            dx.ODETerm(lambda t, p, par: scale(t, p, par) * p),
            dx.ODETerm(lambda t, q, par: push(t, q, par)),
        )
    else:
        terms = dx.ODETerm(targets.jax(system, "field"))
    h = getattr(method, "h", None)
    controller = dx.ConstantStepSize() if h else dx.PIDController(rtol=method.rtol, atol=method.atol)

    @jax.jit
    def solve(t0: float, t_end: float, y0: Any, par: Any) -> Any:
        return dx.diffeqsolve(
            terms, getattr(dx, name)(), t0, t_end, h or 0.01, y0, args=par,
            stepsize_controller=controller, max_steps=None, adjoint=dx.ForwardMode(),
        )  # fmt: skip

    def end(solution: Any) -> tuple[int, Array]:
        return int(solution.stats["num_accepted_steps"]), np.concatenate(
            [np.asarray(part)[-1] for part in jax.tree.leaves(solution.ys)]
        )

    def begin(y0: Array, par: Array, t0: float) -> Call:
        start: Any = (y0[:dof], y0[dof:]) if halves else y0
        return Call(lambda t_end: jax.block_until_ready(solve(t0, t_end, start, par)), end)

    return begin


def _scipy(system: System, method: Any) -> Begin:
    """``solve_ivp(f, (t0, t_end), y0, method=..., rtol=..., atol=...)`` with a compiled f."""
    solve_ivp = load("scipy", "scipy.integrate").solve_ivp
    field = targets.numba(system, "field")
    known = system.jacobian()
    pattern: Any = cast(Any, known)
    entries: Any = None if known is None else targets.numba(system, known)

    def begin(y0: Array, par: Array, t0: float) -> Call:
        def f(t: float, y: Array) -> Array:
            out = np.empty(y.size)
            field(t, y, par, out)
            return out

        def jac(t: float, y: Array) -> Array:
            matrix, values = np.zeros((y.size, y.size)), np.empty(pattern.rows.size)
            entries(t, y, par, values)
            matrix[pattern.rows, pattern.columns] = values
            return matrix

        name = type(method).__name__
        options = {"jac": jac} if method.implicit and entries is not None else {}

        def go(t_end: float) -> Any:
            return solve_ivp(f, (t0, t_end), y0, method=name, rtol=method.rtol, atol=method.atol, **options)

        return Call(go, lambda solution: (solution.t.size - 1, solution.y[:, -1]))

    return begin


def _sundae(system: System, method: Any) -> Begin:
    """``CVODE(f, jacfn=..., rtol=..., atol=...).solve([t0, t_end], y0)`` with compiled functions."""
    solver = load("scikit-sundae", "sksundae.cvode").CVODE
    field, known = targets.numba(system, "field"), system.jacobian()
    pattern: Any = cast(Any, known)
    entries: Any = None if known is None else targets.numba(system, known)

    def begin(y0: Array, par: Array, t0: float) -> Call:
        def f(t: float, y: Array, out: Array) -> None:
            field(t, y, par, out)

        def jac(t: float, y: Array, slope: Array, matrix: Array) -> None:
            del slope
            values = np.empty(pattern.rows.size)
            entries(t, y, par, values)
            matrix[pattern.rows, pattern.columns] = values

        options = {} if entries is None else {"jacfn": jac}
        integrator = solver(
            f, rtol=method.rtol, atol=method.atol, method=method.method, max_num_steps=2**31 - 1, **options
        )
        return Call(
            lambda t_end: integrator.solve([t0, t_end], y0),
            lambda solution: (solution.t.size - 1, solution.y[-1]),
        )

    return begin


def _pyhamsys(system: System, method: Any) -> Begin:
    """``solve_ivp_symp(chi, chi_star, (t0, t_end), y0, t_eval=[t0, t_end], params=...)``, maps compiled."""
    library = load("pyhamsys")
    from integrators.peers.pyhamsys import maps

    chi, adjoint = maps(system, method.type)

    def begin(y0: Array, par: Array, t0: float) -> Call:
        def go(t_end: float) -> Any:
            count = max(2, round((t_end - t0) / method.h))
            step = (1.0 + 1e-9) * (t_end - t0) / (count - 1)  # pyhamsys takes a step more than fits
            return library.solve_ivp_symp(
                lambda h, t, y: chi(h, t, y, par),
                lambda h, t, y: adjoint(h, t, y, par),
                (t0, t_end),
                y0,
                t_eval=[t0, t_end],
                params=library.Parameters(step=step, solver=method.type),
            )

        return Call(go, lambda solution: (round((solution.t[-1] - t0) / solution.step), solution.y[:, -1]))

    return begin


def _pynamicalsys(system: System, method: Any) -> Begin:
    """``HamiltonianSystem(...).trajectory(q, p, total_time)``, functions compiled; it keeps all states."""
    library = load("pynamicalsys")
    from integrators.peers.pynamicalsys import ImplicitMidpoint, equations, gradients

    midpoint, dof = isinstance(method, ImplicitMidpoint), system.dof or 0
    names = ("eom", "hess_H") if midpoint else ("grad_T", "grad_V")
    functions = dict(zip(names, (equations if midpoint else gradients)(system), strict=True))

    def begin(y0: Array, par: Array, t0: float) -> Call:
        own = library.HamiltonianSystem(**functions, degrees_of_freedom=dof, number_of_parameters=par.size)

        def steps(y: Array, step: float, length: float) -> Array:
            if midpoint:
                own.integrator("imp", time_step=step, tol=method.tol, max_iter=method.max_iter)
            else:
                own.integrator("svy4", time_step=step)
            return own.trajectory(y[:dof], y[dof:], length, parameters=par)[:, 1:]

        def go(t_end: float) -> tuple[int, Array]:
            count = int((t_end - t0) / method.h + 1e-9)
            y, rest = steps(y0, method.h, count * method.h)[-1], t_end - t0 - count * method.h
            if rest > 1e-9 * method.h:  # it takes whole steps only, and this one is shorter
                y = steps(y, rest, rest)[-1]
            return count, y

        return Call(go, lambda end: end)

    return begin


def _alone(method: type[MethodBase]) -> type[MethodBase]:
    """Return a method of a library with the library's own calls in place of the adapter."""
    script, program = SCRIPTS[method.library]

    def compile(self: MethodBase, system: System) -> Program:  # noqa: A001 -- the protocol's name
        return program(system, self, script)

    return type(
        method.__name__, (method,), {"compile": compile, "__module__": __name__, "__doc__": script.__doc__}
    )


SCRIPTS: dict[str, tuple[Script, type[Program]]] = {
    "heyoka": (_heyoka, BatchProgram),
    "rebound": (_rebound, Program),
    "diffrax": (_diffrax, Program),
    "scipy": (_scipy, Program),
    "scikit-sundae": (_sundae, Program),
    "pyhamsys": (_pyhamsys, Program),
    "pynamicalsys": (_pynamicalsys, Program),
}
METHODS = {
    method.__name__: _alone(method)
    for method in map(registry.get, registry.names())
    if method.library in SCRIPTS
}
"""By the names of the methods; ``peers.alone:NAME`` in a campaign."""
