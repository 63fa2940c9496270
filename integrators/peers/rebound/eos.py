"""REBOUND's EOS: embedded operator splitting."""

from dataclasses import dataclass
from typing import Any, Literal

from integrators.options import Count
from integrators.peers.rebound.program import choose
from integrators.peers.rebound.whfast import CentralMethod
from integrators.protocol import cite

Splitting = Literal["LF", "LF4", "LF6", "LF8", "LF4_2", "LF8_6_4", "PLF7_6_4", "PMLF4", "PMLF6"]
ORDERS = {
    "LF": 2, "LF4": 4, "LF6": 6, "LF8": 8, "LF4_2": 2, "LF8_6_4": 4, "PLF7_6_4": 4, "PMLF4": 4, "PMLF6": 6,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, repr=False)
class EOS(CentralMethod):
    """REBOUND's EOS: the motion about the dominant body is itself solved by a splitting, with n substeps.

    It needs no Kepler solver. Made for planets about one dominant body; `caveat` says where a problem is not
    that.

    Parameters
    ----------
    h : float
        Length of a step, > 0.
    phi0, phi1 : {"LF", "LF4", "LF6", "LF8", "LF4_2", "LF8_6_4", "PLF7_6_4", "PMLF4", "PMLF6"}
        The outer and the inner splitting, in REBOUND's names.
    n : int
        Inner steps in a step of the outer splitting, >= 1.

    Notes
    -----
    REBOUND's safe mode is on, its default: without it each sample would change the trajectory.

    Examples
    --------
    >>> import problems
    >>> from integrators import EOS, integrate
    >>> planets = problems.load("outer_solar_system", t_end=100.0)
    >>> method = EOS(h=0.3, phi0="LF8_6_4", phi1="LF8", n=4)
    >>> bool(integrate(planets, method, [0.0, 100.0]).errors()["energy"].max() < 1e-9)
    True
    """

    phi0: Splitting = "LF"
    phi1: Splitting = "LF"
    n: Count = 2

    citation = cite("ReinLiu2012", "Rein2020")
    family = "splitting"
    to_end = "stop"
    counted = False

    @property
    def order(self) -> int:
        """In h, at a fixed perturbation."""
        return min(ORDERS[self.phi0], ORDERS[self.phi1])

    def set_up(self, simulation: Any) -> None:
        """Choose EOS and its splittings."""
        chosen = choose(simulation, "eos")
        chosen.phi0, chosen.phi1, chosen.n = self.phi0, self.phi1, self.n
