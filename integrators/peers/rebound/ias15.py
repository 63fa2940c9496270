"""REBOUND's IAS15."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from integrators.options import NotNegative, Step
from integrators.peers.rebound.program import REBOUND, Layout, ReboundMethod, ReboundProgram, calls, choose
from integrators.protocol import Array, Status
from integrators.running.watchdog import CRAWL_STEPS
from integrators.stepping import RestorableStepper
from problems.errors import InputError
from problems.problem import Problem

Mode = Literal["prs23", "global", "individual", "aarseth85"]

CITATION = """\
@article{ReinSpiegel2015,
  author = {Rein, Hanno and Spiegel, David S.},
  title = {{IAS15}: a fast, adaptive, high-order integrator for gravitational dynamics, accurate to machine
           precision over a billion orbits},
  journal = {Monthly Notices of the Royal Astronomical Society},
  volume = {446},
  number = {2},
  pages = {1424--1437},
  year = {2015},
  doi = {10.1093/mnras/stu2164}
}
@article{PhamReinSpiegel2024,
  author = {Pham, Dang and Rein, Hanno and Spiegel, David},
  title = {A new timestep criterion for {N}-body simulations},
  journal = {The Open Journal of Astrophysics},
  volume = {7},
  year = {2024}
}
"""


@dataclass(frozen=True, kw_only=True, repr=False)
class IAS15(ReboundMethod):
    """REBOUND's IAS15: Gauss-Radau of order 15, adaptive, with compensated summation.

    Parameters
    ----------
    epsilon : float
        Control of precision, >= 0; 0 keeps the step at ``h``.
    mode : {"prs23", "global", "individual", "aarseth85"}
        How the step is chosen. ``"prs23"`` is REBOUND's default since 2024; it takes
        the time scale of each particle's acceleration by itself, and collapses where
        one passes through a zero of its acceleration on a straight line.
        ``"global"`` was the default before.
    min_dt : float
        Least step, >= 0.
    h : float, optional
        First step; REBOUND's own is 0.001.

    Notes
    -----
    By default the last step before each sample is shortened onto it, which costs
    this method no quality; REBOUND goes on with the step it had before
    (``sample="land"``). ``"steps"`` gives its steps. A watchdog, compiled and
    called after each step, ends a simulation that no longer gets anywhere: status
    ``STALLED``, with ``stats.extra["dt_history"]``, the (t, dt) of the last 2048 steps.

    On a problem without bodies, three coordinates at a time are one particle; with
    more than three the criteria that go by particle depend on this grouping.

    Examples
    --------
    >>> import problems
    >>> from integrators import IAS15, integrate
    >>> solution = integrate(problems.load("kepler", e=0.6), IAS15(mode="global"), [0.0, 100.0])
    >>> bool(solution.errors()["energy"].max() < 1e-14)
    True
    """

    epsilon: NotNegative = 1e-9
    mode: Mode = "prs23"
    min_dt: NotNegative = 0.0
    h: Step | None = None

    order = 15  # at a fixed step
    citation = REBOUND + CITATION
    family = "gauss-radau"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.h is None and self.epsilon == 0.0:
            raise InputError("IAS15 with epsilon=0 takes fixed steps; give their length, h=...")

    def caveat(self, problem: Problem) -> str | None:
        """Say where the step criterion goes by particles that the problem does not have."""
        dof = problem.system.dim // 2
        if problem.system.bodies is not None or self.mode == "global":
            return None
        if self.mode == "prs23" and dof % 3 == 1:
            return (
                "the last coordinate is a particle on a straight line, and the step criterion 'prs23' "
                "collapses where its acceleration passes through zero."
            )
        if dof > 3:
            return (
                f"the {dof} coordinates are grouped by three into particles, and the step criterion "
                f"{self.mode!r} depends on that grouping."
            )
        return None

    def set_up(self, simulation: Any) -> None:
        """Choose IAS15 and its options."""
        chosen = choose(simulation, "ias15")
        chosen.epsilon, chosen.min_dt, chosen.adaptive_mode = self.epsilon, self.min_dt, self.mode
        if self.h is not None:
            simulation.dt = self.h

    def stepper(self, program: ReboundProgram, layout: Layout, y: Array, t: float) -> "IAS15Stepper":
        """Return a trajectory."""
        return IAS15Stepper(program, layout, self, y, t)


class IAS15Stepper(RestorableStepper):
    """A trajectory of IAS15: ``"land"`` (default) or ``"steps"``."""

    samplings = ("land", "steps")

    def __init__(self, program: ReboundProgram, layout: Layout, method: IAS15, y: Array, t: float):
        super().__init__(y, t)
        self._program, self._layout, self._method = program, layout, method
        self._block = program.hooks.Block(layout.numbers)
        self._use(program.simulation(layout, t, y))

    def _use(self, simulation: Any) -> None:
        program = self._program
        program.hooks.attach(simulation, self._block, heartbeat=program.watch, force=program.force)
        self._simulation = simulation

    def _run(self, call: Any, argument: float, end: float) -> bool:
        """Let REBOUND integrate or step; return whether all is well, else note the failure."""
        simulation, before = self._simulation, int(self._simulation.steps_done)
        try:
            call(argument)
        except (RuntimeError, self._program.rebound.GenericError) as error:
            self._fail(Status.NOT_FINITE, float(simulation.t), f"REBOUND gave up: {error}")
        self._stats.steps += int(simulation.steps_done) - before
        self._stats.evaluations = int(self._block.values[self._program.hooks.EVALUATIONS])
        self._stats.extra["iterations_max_exceeded"] = int(simulation.integrator.iterations_max_exceeded)
        if self._block.values[self._program.hooks.REASON]:
            self._stalled(float(simulation.t), end)
        return not self._status.failed

    def _stalled(self, t: float, end: float) -> None:
        """Say why the watchdog stopped the simulation."""
        hooks, values = self._program.hooks, self._block.values
        history = self._block.history(int(self._simulation.steps_done))
        self._stats.extra["dt_history"] = history
        fell = f"IAS15's step fell to {float(history[-1, 1]):.1e} and"
        stopped = "stopped by the watchdog"
        if self._method.mode != "global":
            stopped += '; try mode="global", or a min_dt'
        if values[hooks.REASON] == hooks.NAN:
            t = t if math.isfinite(t) else self._t
            self._fail(Status.NOT_FINITE, t, f"IAS15's time or step was no longer finite after t = {t!r}.")
        elif values[hooks.REASON] == hooks.STANDS:
            still = f"time stood still at t = {t!r} for {hooks.FROZEN} steps"
            self._fail(Status.STALLED, t, f"{fell} {still}; {stopped}.")
        else:
            still = f"{CRAWL_STEPS} steps came no nearer to t = {end!r} than t = {t!r}"
            self._fail(Status.STALLED, t, f"{fell} {still}; {stopped}.")

    def _towards(self, end: float) -> float:
        simulation = self._simulation
        self._block.aim(float(simulation.t), end, int(simulation.steps_done))
        sign = 1.0 if end > self._t else -1.0
        simulation.dt = math.copysign(simulation.dt, sign)
        return sign

    def _serve(self, grid: Array, how: str) -> tuple[Array, Array]:
        states = np.empty((grid.size, self._y.size))
        self._towards(float(grid[-1]))
        with calls(self._stats):
            for i, t in enumerate(grid.tolist()):
                if not self._run(self._simulation.integrate, t, float(grid[-1])):
                    return grid[:i], states[:i]
                states[i] = self._program.state(self._layout, self._simulation)
                if not np.isfinite(states[i]).all():
                    return grid[: i + 1], states[: i + 1]
        return grid, states

    def _own_steps(self, end: float) -> tuple[Array, Array]:
        simulation, times, states = self._simulation, [self._t], [self._y]
        sign = self._towards(end)
        with calls(self._stats):
            while sign * (simulation.t + simulation.dt - end) <= 0.0 and self._run(simulation.steps, 1, end):
                times.append(float(simulation.t))
                states.append(self._program.state(self._layout, simulation))
        return np.array(times[1:]), np.array(states)[1:]

    def _one(self) -> tuple[float, Array] | None:
        simulation = self._simulation
        self._towards(math.copysign(math.inf, simulation.dt))
        with calls(self._stats):
            if not self._run(simulation.steps, 1, math.inf):
                return None
        return float(simulation.t), self._program.state(self._layout, simulation)

    def _save(self) -> bytes:
        return self._program.archive(self._simulation)

    def _load(self, inner: bytes) -> None:
        self._use(self._program.rebound.Simulation(inner))
