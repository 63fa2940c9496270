"""REBOUND's methods of fixed step size: what they share, and the leapfrogs."""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from integrators.options import Step
from integrators.peers.rebound.program import Layout, ReboundMethod, ReboundProgram, calls, choose
from integrators.protocol import Array, cite
from integrators.stepping import FixedStepper

EVALUATIONS = {2: 1, 4: 3, 6: 9, 8: 17}
"""Force evaluations in a step of the leapfrog of each order."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FixedMethod(ReboundMethod):
    """What REBOUND's methods of fixed step share."""

    h: Step

    unsynchronized: ClassVar[bool] = False  # whether a sample is a synchronised copy

    def stepper(self, program: ReboundProgram, layout: Layout, y: Array, t: float) -> "ReboundStepper":
        """Return a trajectory."""
        return ReboundStepper(program, layout, y, t)


@dataclass(frozen=True, kw_only=True, repr=False)
class Leapfrog(FixedMethod):
    """REBOUND's leapfrog, drift-kick-drift, and its compositions of order 4, 6 and 8; symplectic.

    Parameters
    ----------
    h : float
        Length of a step, > 0.
    order : {2, 4, 6, 8}
        Order of convergence; a step takes 1, 3, 9 or 17 force evaluations.

    Examples
    --------
    >>> import problems
    >>> from integrators import Leapfrog, integrate
    >>> solution = integrate(problems.load("henon_heiles"), Leapfrog(h=0.05, order=8), [0.0, 50.0])
    >>> bool(solution.errors()["energy"].max() < 1e-12)
    True
    """

    order: Literal[2, 4, 6, 8] = 2

    citation = cite("ReinLiu2012", "BlanesCasas2016")
    family = "splitting"
    to_end = "stop"

    def set_up(self, simulation: Any) -> None:
        """Choose the leapfrog and its order."""
        choose(simulation, "leapfrog").order = self.order


class ReboundStepper(FixedStepper):
    """A trajectory with fixed steps; see `integrators.stepping.FixedStepper` for the sampling."""

    marks = False

    def __init__(self, program: ReboundProgram, layout: Layout, y: Array, t: float):
        super().__init__(program, y, layout.par, t)
        self._layout = layout
        self._block, self._spare = (program.hooks.Block(layout.numbers) for _ in range(2))
        self._restart(t, y, self._h)

    def _restart(self, t: float, y: Array, h: float) -> None:
        simulation = self._program.simulation(self._layout, t, y)
        simulation.dt = h
        self._use(simulation)

    def _use(self, simulation: Any) -> None:
        self._program.hooks.attach(simulation, self._block, force=self._program.force)
        self._simulation = simulation

    def _march(self, count: int) -> None:
        with calls(self._stats):
            self._simulation.t = self._time()
            self._simulation.steps(count)
        self._count()

    def _count(self) -> None:
        if self._program.method.counted:
            self._stats.evaluations = int(self._block.values[self._program.hooks.EVALUATIONS])

    def _state(self) -> Array:
        return self._program.state(self._layout, self._simulation)

    def _aside(self, part: float) -> Array:
        program = self._program
        with program.hooks.detached(self._simulation):
            aside = self._simulation.copy()
        program.hooks.attach(aside, self._spare, force=program.force)
        self._part(aside, part)
        return program.state(self._layout, aside)

    def _shorten(self, part: float) -> None:
        simulation = self._simulation
        self._part(simulation, part)
        simulation.dt = self._h
        if self._program.method.unsynchronized:
            simulation.integrator.keep_unsynchronized = 1
        self._count()

    def _part(self, simulation: Any, part: float) -> None:
        """Synchronise a simulation and take one step of length ``part``."""
        with calls(self._stats):
            if self._program.method.unsynchronized:
                simulation.integrator.keep_unsynchronized = 0
                simulation.synchronize()
            simulation.t, simulation.dt = self._time(), part
            simulation.steps(1)

    def _save_steps(self) -> bytes:
        return self._program.archive(self._simulation)

    def _load_steps(self, steps: bytes) -> None:
        self._use(self._program.rebound.Simulation(steps))
