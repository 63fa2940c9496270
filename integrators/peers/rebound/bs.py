"""REBOUND's BS: extrapolation by Gragg, Bulirsch and Stoer."""

from dataclasses import dataclass
from typing import Any

from integrators.options import NotNegative, Step
from integrators.peers.rebound.adaptive import AdaptiveMethod
from integrators.peers.rebound.program import choose
from integrators.protocol import cite


@dataclass(frozen=True, kw_only=True, repr=False)
class BS(AdaptiveMethod):
    """REBOUND's Gragg-Bulirsch-Stoer method: extrapolation, adaptive in step size and order.

    Parameters
    ----------
    eps_rel, eps_abs : float
        Relative and absolute tolerance of each coordinate and velocity, >= 0, in the problem's units.
    min_dt, max_dt : float
        Least and largest step, >= 0; 0: none.
    h : float, optional
        First step; REBOUND's own is 0.001.

    Notes
    -----
    The last step before each sample is shortened onto it (``"stop"``); ``"steps"`` gives those that it takes.
    There are no checkpoints: from one of REBOUND's files it does not go on bit for bit (9e-14 on a pendulum).

    Examples
    --------
    >>> import problems
    >>> from integrators import BS, integrate
    >>> solution = integrate(problems.load("kepler", e=0.6), BS(eps_rel=1e-13, eps_abs=1e-13), [0.0, 10.0])
    >>> bool(solution.errors()["energy"].max() < 1e-10)
    True
    """

    eps_rel: NotNegative = 1e-8
    eps_abs: NotNegative = 1e-8
    min_dt: NotNegative = 0.0
    max_dt: NotNegative = 0.0
    h: Step | None = None

    citation = cite("ReinLiu2012", "HairerNorsettWanner1993")
    family = "extrapolation"

    def set_up(self, simulation: Any) -> None:
        """Choose BS and its tolerances."""
        chosen = choose(simulation, "bs")
        chosen.eps_rel, chosen.eps_abs = self.eps_rel, self.eps_abs
        chosen.min_dt, chosen.max_dt = self.min_dt, self.max_dt
        if self.h is not None:
            simulation.dt = self.h
