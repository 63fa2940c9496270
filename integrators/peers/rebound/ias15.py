"""REBOUND's IAS15."""

from dataclasses import dataclass
from typing import Any, Literal

from integrators.options import NotNegative, Step
from integrators.peers.rebound.adaptive import AdaptiveMethod, AdaptiveStepper
from integrators.peers.rebound.program import Layout, ReboundProgram, choose
from integrators.protocol import Array, cite
from integrators.stepping import RestorableStepper
from problems.errors import InputError
from problems.problem import Problem

Mode = Literal["prs23", "global", "individual", "aarseth85"]


@dataclass(frozen=True, kw_only=True, repr=False)
class IAS15(AdaptiveMethod):
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
    (``sample="stop"``). ``"steps"`` gives its steps. A watchdog, compiled and
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
    citation = cite("ReinLiu2012", "ReinSpiegel2015", "PhamReinSpiegel2024")
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

    @property
    def remedy(self) -> str:
        """What to try where steps collapse."""
        return "" if self.mode == "global" else 'try mode="global", or a min_dt'

    def counts(self, simulation: Any) -> dict[str, int]:
        """Return how often the iteration of a step did not converge."""
        return {"iterations_max_exceeded": int(simulation.integrator.iterations_max_exceeded)}

    def stepper(self, program: ReboundProgram, layout: Layout, y: Array, t: float) -> "IAS15Stepper":
        """Return a trajectory."""
        return IAS15Stepper(program, layout, self, y, t)


class IAS15Stepper(AdaptiveStepper, RestorableStepper):
    """A trajectory that REBOUND's files continue bit for bit."""

    def _save(self) -> bytes:
        return self._program.archive(self._simulation)

    def _load(self, inner: bytes) -> None:
        self._use(self._program.rebound.Simulation(inner))
