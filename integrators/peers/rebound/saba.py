"""REBOUND's SABA: splittings of high order for planets."""

from dataclasses import dataclass
from typing import Any, Literal

from integrators.peers.rebound.program import Layout, choose
from integrators.peers.rebound.whfast import CentralMethod
from integrators.protocol import Array, cite

Type = Literal[
    "1", "2", "3", "4", "CM_1", "CM_2", "CM_3", "CM_4", "CL_1", "CL_2", "CL_3", "CL_4",
    "10_4", "8_6_4", "10_6_4", "H_8_4_4", "H_8_6_4", "H_10_6_4",
]  # fmt: skip


@dataclass(frozen=True, kw_only=True, repr=False)
class SABA(CentralMethod):
    """REBOUND's SABA: symplectic splittings of high generalized order, in Jacobi coordinates.

    With a perturbation of relative size e, SABA(10,6,4) has an energy error of
    e h^10 + e^2 h^6 + e^3 h^4. Made for planets about one dominant body; `caveat` says where a problem is not
    that.

    Parameters
    ----------
    h : float
        Length of a step, > 0.
    type : {"1", ..., "4", "CM_1", ..., "CL_4", "10_4", "8_6_4", "10_6_4", "H_8_4_4", "H_8_6_4", "H_10_6_4"}
        Which splitting, in REBOUND's names: 1 to 4 are those of Laskar and Robutel, CM and CL add a corrector
        by the modified kick or the lazy implementer's; the others have the generalized order in the name.

    Notes
    -----
    As of `WHFast`, REBOUND's safe mode is off, and samples are synchronised copies.

    Examples
    --------
    >>> import problems
    >>> from integrators import SABA, integrate
    >>> planets = problems.load("outer_solar_system", t_end=100.0)
    >>> bool(integrate(planets, SABA(h=0.5), [0.0, 100.0]).errors()["energy"].max() < 1e-9)
    True
    """

    type: Type = "10_6_4"

    citation = cite("ReinLiu2012", "LaskarRobutel2001", "BlanesCasasFarresLaskarMakazagaMurua2013")
    family = "wisdom-holman"
    to_end = "stop"
    unsynchronized = True

    @property
    def order(self) -> int:
        """In h, at a fixed perturbation."""
        return 2 if len(self.type) == 1 or self.type.endswith("_1") else 4

    def doubts(self, layout: Layout, y0: Array) -> list[str]:
        """Return what speaks against the method, of masses and of the start."""
        return super().doubts(layout, y0) + self.radial(layout, y0)

    def set_up(self, simulation: Any) -> None:
        """Choose SABA and its type."""
        chosen = choose(simulation, "saba")
        chosen.type = self.type
        chosen.safe_mode, chosen.keep_unsynchronized = 0, 1
