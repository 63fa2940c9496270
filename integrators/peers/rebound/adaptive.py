"""REBOUND's methods of adaptive step size: what they share."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from integrators.peers.rebound.program import Layout, ReboundMethod, ReboundProgram, calls
from integrators.protocol import Array, Status
from integrators.running.watchdog import STALL_STEPS
from integrators.stepping import StepperBase


@dataclass(frozen=True, kw_only=True, repr=False)
class AdaptiveMethod(ReboundMethod):
    """What REBOUND's methods of adaptive step size share."""

    @property
    def remedy(self) -> str:
        """What to try where steps collapse."""
        return ""

    def counts(self, simulation: Any) -> dict[str, int]:
        """Return what a simulation counts besides steps and evaluations, for ``stats.extra``."""
        return {}

    def stepper(self, program: ReboundProgram, layout: Layout, y: Array, t: float) -> "AdaptiveStepper":
        """Return a trajectory."""
        return AdaptiveStepper(program, layout, self, y, t)


class AdaptiveStepper(StepperBase):
    """A trajectory with adaptive steps: ``"stop"`` (default) or ``"steps"``."""

    samplings = ("stop", "steps")

    def __init__(self, program: ReboundProgram, layout: Layout, method: AdaptiveMethod, y: Array, t: float):
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
            self._ended(Status.NOT_FINITE, f"REBOUND gave up: {error}")
        self._stats.steps += int(simulation.steps_done) - before
        self._stats.evaluations = int(self._block.values[self._program.hooks.EVALUATIONS])
        self._stats.extra.update(self._method.counts(simulation))
        if self._block.values[self._program.hooks.REASON]:
            self._stalled(float(simulation.t), end)
        return not self._status.failed

    def _stalled(self, t: float, end: float) -> None:
        """Say why the watchdog stopped the simulation."""
        hooks, values = self._program.hooks, self._block.values
        history = self._block.history(int(self._simulation.steps_done))
        self._stats.extra["dt_history"] = history
        name = type(self._method).__name__
        fell = f"{name}'s step fell to {float(history[-1, 1]):.1e} and"
        stopped = "; ".join(filter(None, ("stopped by the watchdog", self._method.remedy)))
        if values[hooks.REASON] == hooks.NAN:
            t = t if math.isfinite(t) else self._t
            self._ended(Status.NOT_FINITE, f"{name}'s time or step was no longer finite after t = {t!r}.")
        elif values[hooks.REASON] == hooks.STANDS:
            still = f"time stood still at t = {t!r} for {hooks.FROZEN} steps"
            self._ended(Status.STALLED, f"{fell} {still}; {stopped}.")
        else:
            still = f"{STALL_STEPS} steps came no nearer to t = {end!r} than t = {t!r}"
            self._ended(Status.STALLED, f"{fell} {still}; {stopped}.")

    def _ended(self, status: Status, reason: str) -> None:
        simulation = self._simulation
        self._fail(status, float(simulation.t), self._program.state(self._layout, simulation), reason)

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

    def _step_states(self, end: float) -> tuple[Array, Array]:
        simulation, times, states = self._simulation, [self._t], [self._y]
        sign = self._towards(end)
        with calls(self._stats):
            while sign * (simulation.t + simulation.dt - end) <= 0.0 and self._run(simulation.steps, 1, end):
                if simulation.t != times[-1]:  # else the step was rejected
                    times.append(float(simulation.t))
                    states.append(self._program.state(self._layout, simulation))
        return np.array(times[1:]), np.array(states)[1:]

    def _one_step(self) -> tuple[float, Array] | None:
        simulation = self._simulation
        self._towards(math.copysign(math.inf, simulation.dt))
        with calls(self._stats):
            while simulation.t == self._t:  # a rejected step leaves the time
                if not self._run(simulation.steps, 1, math.inf):
                    return None
        return float(simulation.t), self._program.state(self._layout, simulation)
