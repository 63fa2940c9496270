"""REBOUND's WHFast512: WHFast for up to nine bodies, written for AVX-512 registers."""

import ctypes
import ctypes.util
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from integrators.peers import load
from integrators.peers.rebound.fixed import FixedMethod, ReboundStepper
from integrators.peers.rebound.program import Layout, ReboundProgram, calls, choose
from integrators.peers.rebound.whfast import WHFast
from integrators.protocol import Array, cite
from problems.problem import Problem, System

MOST_BODIES = 9
NO_AVX512 = "this processor has no AVX-512."
ROOM = 64
"""Bytes for the processor's modes; C's ``fenv_t`` has 32 on x86-64."""


@dataclass(frozen=True, kw_only=True, repr=False)
class WHFast512(FixedMethod):
    """REBOUND's WHFast512: the Wisdom-Holman splitting in Jacobi coordinates, on AVX-512 registers.

    Parameters
    ----------
    h : float
        Length of a step, > 0.
    corrector : {0, 17}
        Order of the symplectic corrector.

    Notes
    -----
    It needs a processor with AVX-512, two to nine gravitating bodies, the dominant one
    first, and units in which G = 1: time is scaled by sqrt(G), with the rounding of the
    velocities that this takes. Steps between two samples are taken in one go, as its
    authors advise (``concatenate_steps``); at a sample it is synchronised. The relativistic
    correction is off. `WHFast.caveat` says where a problem is outside its domain.

    Examples
    --------
    >>> import problems
    >>> from integrators import WHFast512
    >>> WHFast512(h=0.3).accepts(problems.load("henon_heiles")) is None  # a reason where it does not apply
    False
    """

    corrector: Literal[0, 17] = 0

    order = 2  # in h, at a fixed perturbation
    citation = cite("ReinLiu2012", "ReinTamayo2015", "ReinTamayoBrown2019", "WisdomHolman1991")
    family = "wisdom-holman"

    def refuses(self, system: System, par: Array | None = None) -> str | None:
        """Return why not: too many bodies, none, or a processor without AVX-512."""
        if system.bodies is None:
            return "it needs gravitating bodies, and the system declares none."
        n = system.dim // 2 // system.bodies.dimension
        if not 2 <= n <= MOST_BODIES:
            return f"it takes 2 to {MOST_BODIES} bodies, the problem has {n}."
        if not load("rebound").avx512_available:
            return NO_AVX512
        return super().refuses(system, par)

    def caveat(self, problem: Problem) -> str | None:
        """Say why a problem is outside what the splitting was made for, although it runs."""
        return None if self.accepts(problem) is not None else WHFast(h=self.h).caveat(problem)

    def compile(self, system: System) -> "ScaledProgram":
        """Prepare for ``system``; nothing of REBOUND's is compiled."""
        return ScaledProgram(system, self)

    def set_up(self, simulation: Any) -> None:
        """Choose WHFast512 and its options."""
        choose(simulation, "whfast512").corrector = self.corrector

    def stepper(self, program: ReboundProgram, layout: Layout, y: Array, t: float) -> "Stepper512":
        """Return a trajectory."""
        return Stepper512(program, layout, y, t)


class ScaledProgram(ReboundProgram):
    """Simulations in units of time in which G = 1."""

    def simulation(self, layout: Layout, t: float, y: Array) -> Any:
        """Return a simulation at ``t`` in the state ``y``; its clock runs in scaled time."""
        simulation = self._bodies(layout, t, y)
        unit = math.sqrt(layout.G)
        simulation.G, simulation.t = 1.0, unit * t
        self.hooks.particles(simulation)[:, 3:6] /= unit
        self.method.set_up(simulation)
        return simulation

    def state(self, layout: Layout, simulation: Any) -> Array:
        """Return the state of a synchronised simulation in the system's coordinates and time."""
        view = self.hooks.particles(simulation)
        return layout.state(view[:, :3], view[:, 3:6] * math.sqrt(layout.G))


class Stepper512(ReboundStepper):
    """A trajectory; the steps between two samples are taken in one go.

    REBOUND has it end with a whole step only, so there is no ``"stop"``.
    """

    samplings = ("partial", "steps")
    at_once = 1_000_000  # REBOUND's own default

    def _restart(self, t: float, y: Array, h: float) -> None:
        super()._restart(t, y, h)
        self._simulation.dt = h * math.sqrt(self._layout.G)

    def _march(self, count: int) -> None:
        with calls(self._stats):
            self._leap(self._simulation, self._time(), count)

    def _aside(self, part: float) -> Array:
        program = self._program
        aside = program.simulation(self._layout, self._time(), self._state())
        aside.dt = part * math.sqrt(self._layout.G)
        with calls(self._stats):
            self._leap(aside, self._time(), 1)
        return program.state(self._layout, aside)

    def _leap(self, simulation: Any, t: float, count: int) -> None:
        """Take ``count`` steps from ``t``, as one of REBOUND's."""
        simulation.t = t * math.sqrt(self._layout.G)
        simulation.integrator.concatenate_steps = count
        with same_arithmetic():
            simulation.integrate(simulation.t + (count - 0.5) * simulation.dt, exact_finish_time=0)


@contextmanager
def same_arithmetic() -> Iterator[None]:
    """Restore the processor's modes: WHFast512 leaves it flushing subnormal numbers to zero."""
    library, kept = _mathematics(), ctypes.create_string_buffer(ROOM)
    library.fegetenv(kept)
    try:
        yield
    finally:
        library.fesetenv(kept)


@cache
def _mathematics() -> ctypes.CDLL:
    return ctypes.CDLL(ctypes.util.find_library("m"))
