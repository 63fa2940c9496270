"""REBOUND's JANUS: reversible to the last bit, by integers."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from integrators.peers.rebound.fixed import FixedMethod
from integrators.peers.rebound.program import choose
from integrators.protocol import cite
from problems.checks import Must

Scale = Annotated[float, Must("a finite number above 0", lambda x: x > 0)]


@dataclass(frozen=True, kw_only=True, repr=False)
class JANUS(FixedMethod):
    """REBOUND's JANUS: symplectic compositions whose steps add integers, so that they can be undone exactly.

    Parameters
    ----------
    h : float
        Length of a step, > 0.
    order : {2, 4, 6, 8, 10}
        Order of convergence.
    scale_pos, scale_vel : float
        The resolution of positions and velocities, > 0: what the integers count. Sizes up to 9e18 of them can
        be told, which is not checked by REBOUND.

    Examples
    --------
    >>> import problems
    >>> from integrators import JANUS, integrate
    >>> solution = integrate(problems.load("kepler", e=0.3), JANUS(h=0.01, order=10), [0.0, 10.0])
    >>> bool(solution.errors()["energy"].max() < 1e-12)
    True
    """

    order: Literal[2, 4, 6, 8, 10] = 6
    scale_pos: Scale = 1e-16
    scale_vel: Scale = 1e-16

    citation = cite("ReinLiu2012", "ReinTamayo2018")
    family = "splitting"
    to_end = "stop"

    def set_up(self, simulation: Any) -> None:
        """Choose JANUS and its options."""
        chosen = choose(simulation, "janus")
        chosen.order, chosen.scale_pos, chosen.scale_vel = self.order, self.scale_pos, self.scale_vel
