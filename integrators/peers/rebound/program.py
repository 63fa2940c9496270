"""REBOUND simulations of our problems: gravitating bodies, or any q'' = c force(t, q)."""

import signal
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from integrators.peers import load
from integrators.peers.gravity import check_gravity, masses_and_constant
from integrators.protocol import Array, MethodBase, Stats
from integrators.stepping import ProgramBase, StepperBase
from problems.errors import InputError
from problems.problem import Problem, System


@dataclass(frozen=True, kw_only=True, repr=False)
class ReboundMethod(MethodBase):
    """What REBOUND's methods share."""

    library = "rebound"
    built = "generic wheel"
    counted: ClassVar[bool] = True  # whether REBOUND tells of each evaluation of the forces

    def accepts(self, problem: Problem) -> str | None:
        """Return None for gravitating bodies and for q'' = c force(t, q), else the reason."""
        return self.refuses(problem.system, problem.par)

    def refuses(self, system: System, par: Array | None = None) -> str | None:
        """Return why the method cannot integrate ``system`` with parameters ``par``, or None."""
        if system.bodies is not None:
            masses, _ = masses_and_constant(system, system.pack() if par is None else par)
            if not np.all(masses > 0.0):
                return "it needs positive masses, since the momentum of a massless body is 0."
        elif not system.separable:
            return (
                "REBOUND moves bodies with positions and velocities, so it needs a separable Hamiltonian: "
                "sum of c p^2/2 + V(q, t)."
            )
        return None

    def compile(self, system: System) -> "ReboundProgram":
        """Compile the callbacks, and the forces of ``system`` unless REBOUND has them."""
        return ReboundProgram(system, self)

    def set_up(self, simulation: Any) -> None:
        """Choose REBOUND's integrator and its options; the name first, which resets the options."""
        raise NotImplementedError

    def order_of_bodies(self, n: int) -> list[int]:
        """Return which body is REBOUND's first, second, ..."""
        return list(range(n))

    def stepper(self, program: "ReboundProgram", layout: "Layout", y: Array, t: float) -> StepperBase:
        """Return a trajectory."""
        raise NotImplementedError


class ReboundProgram(ProgramBase):
    """How one system becomes a REBOUND simulation.

    Gravitating bodies are left to REBOUND's own direct summation; each start checks
    that it is the system's vector field. Any other separable system becomes forces
    on particles of mass 1 that carry three coordinates each, compiled from the
    system's own definition, with gravity off. Momenta become velocities v = c p (for
    bodies p/m) and back, with the rounding that this takes.
    """

    def __init__(self, system: System, method: ReboundMethod):
        super().__init__(system, method)
        self.rebound = load("rebound")
        from integrators.peers.rebound import hooks
        from problems import targets

        started = perf_counter()
        self.method, self.hooks = method, hooks
        self.watch, self.force = hooks.watchdog(), hooks.counter() if method.counted else None
        if system.bodies is None:
            known = hooks.forces.cache_info().hits
            self.force = hooks.forces(targets.numba(system, "force"), system.dim // 2, system.n_par)
            self.from_cache = hooks.forces.cache_info().hits > known
        self.compile_seconds = perf_counter() - started

    def stepper(self, y: Array, par: Array, t: float) -> StepperBase:
        """Return a trajectory.

        Raises
        ------
        problems.errors.InputError
            If the system declares bodies whose gravity its forces are not.
        """
        reason = self.method.refuses(self.system, par)
        if reason is not None:
            raise InputError(f"{self.method!r} cannot integrate {self.system.name}: {reason}")
        layout = Layout(self.system, par, self.method)
        if layout.bodies is not None:
            check_gravity(self.system, par, t, y)
        return self.method.stepper(self, layout, y, t)

    def simulation(self, layout: "Layout", t: float, y: Array) -> Any:
        """Return a simulation at ``t`` in the state ``y``, without callbacks."""
        simulation = self._bodies(layout, t, y)
        self.method.set_up(simulation)
        return simulation

    def _bodies(self, layout: "Layout", t: float, y: Array) -> Any:
        simulation = self.rebound.Simulation()
        simulation.G, simulation.t = layout.G, t
        x, v = layout.vectors(y)
        for m, (px, py, pz), (vx, vy, vz) in zip(layout.masses.tolist(), x.tolist(), v.tolist(), strict=True):
            simulation.add(m=m, x=px, y=py, z=pz, vx=vx, vy=vy, vz=vz)
        if layout.bodies is None:
            simulation.gravity = "none"
        return simulation

    def state(self, layout: "Layout", simulation: Any) -> Array:
        """Return the state of a synchronised simulation in the system's coordinates."""
        view = self.hooks.particles(simulation)
        return layout.state(view[:, :3], view[:, 3:6])

    def archive(self, simulation: Any) -> bytes:
        """Return a simulation as REBOUND writes it to a file, leaving it as it is."""
        with self.hooks.detached(simulation):
            return simulation.__reduce__()[1][0]


class Layout:
    """Where the state of a system lies among REBOUND's particles, for one set of parameters.

    Attributes
    ----------
    n : int
        Number of particles.
    masses : ndarray, shape (n,)
        Masses in REBOUND's order.
    place : ndarray of int, shape (n,)
        Which particle a body is.
    mass : ndarray, shape (dof,)
        Momentum over velocity, for each coordinate.
    """

    def __init__(self, system: System, par: Array, method: ReboundMethod) -> None:
        from problems import targets

        dof = system.dim // 2
        self.bodies, self.par = system.bodies, par
        if self.bodies is not None:
            self.width = self.bodies.dimension
            self.n = dof // self.width
            masses, self.G = masses_and_constant(system, par)
            order = method.order_of_bodies(self.n)
            self.masses = masses[order]
            self.place = np.argsort(order)
            self.mass = np.repeat(masses, self.width)
            self.numbers = np.zeros(1)
        else:
            self.width, self.n = 3, -(-dof // 3)
            self.G, self.masses, self.place = 0.0, np.ones(self.n), np.arange(self.n)
            scale = targets.numpy(system, "velocity_scale")(0.0, np.zeros(system.dim), par)
            self.mass = 1.0 / scale
            self.numbers = np.concatenate([par, scale, np.zeros(2 * dof)])

    def vectors(self, y: Array) -> tuple[Array, Array]:
        """Return positions and velocities (n, 3) in REBOUND's order."""
        dof = self.mass.size
        x, v = np.zeros((self.n, 3)), np.zeros((self.n, 3))
        x.flat[self._where(dof)] = y[:dof]
        v.flat[self._where(dof)] = y[dof:] / self.mass
        return x, v

    def state(self, x: Array, v: Array) -> Array:
        """Return the state of positions and velocities (n, 3) in REBOUND's order."""
        where = self._where(self.mass.size)
        return np.concatenate([x.ravel()[where], self.mass * v.ravel()[where]])

    def _where(self, dof: int) -> NDArray[np.int64]:
        """Return where coordinate i lies among the 3 n components of all particles."""
        i = np.arange(dof)
        return 3 * self.place[i // self.width] + i % self.width


def choose(simulation: Any, integrator: str) -> Any:
    """Choose REBOUND's integrator and return its options, which are REBOUND's defaults then."""
    simulation.integrator = integrator
    return simulation.integrator


@contextmanager
def calls(stats: Stats) -> Iterator[None]:
    """Call REBOUND: keep its warnings with the statistics, and give Python its Ctrl-C back.

    REBOUND's `integrate` installs a handler of SIGINT of its own and leaves it there.
    """
    main = threading.current_thread() is threading.main_thread()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield
        finally:
            handler = signal.getsignal(signal.SIGINT)
            if main and handler is not None:
                signal.signal(signal.SIGINT, handler)
    for warning in caught:
        messages = stats.extra.setdefault("messages", [])
        if str(warning.message) not in messages:
            messages.append(str(warning.message))
