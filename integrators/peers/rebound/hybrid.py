"""REBOUND's hybrid methods for close encounters: MERCURIUS and TRACE."""

from dataclasses import dataclass
from typing import Any, Literal

from integrators.options import NotNegative
from integrators.peers.rebound.program import choose
from integrators.peers.rebound.whfast import CentralMethod
from integrators.protocol import cite


@dataclass(frozen=True, kw_only=True, repr=False)
class MERCURIUS(CentralMethod):
    """REBOUND's MERCURIUS: WHFast in democratic heliocentric coordinates, IAS15 in close encounters.

    It changes over smoothly between the two. Made for planets about one dominant body; encounters with that
    body itself are not resolved. `caveat` says where a problem is outside its domain.

    Parameters
    ----------
    h : float
        Length of a step, > 0.
    r_crit_hill : float
        Radius of an encounter in Hill radii, >= 0.

    Notes
    -----
    REBOUND's safe mode is on, its default: without it each sample would change the trajectory.

    Examples
    --------
    >>> import problems
    >>> from integrators import MERCURIUS, integrate
    >>> planets = problems.load("outer_solar_system", t_end=100.0)
    >>> bool(integrate(planets, MERCURIUS(h=0.3), [0.0, 100.0]).errors()["energy"].max() < 1e-6)
    True
    """

    r_crit_hill: NotNegative = 3.0

    order = 2  # at a fixed perturbation, without encounters
    citation = cite("ReinLiu2012", "ReinEtAl2019")
    family = "hybrid"
    to_end = "stop"
    counted = False

    def set_up(self, simulation: Any) -> None:
        """Choose MERCURIUS and its radius."""
        choose(simulation, "mercurius").r_crit_hill = self.r_crit_hill


@dataclass(frozen=True, kw_only=True, repr=False)
class TRACE(CentralMethod):
    """REBOUND's TRACE: WHFast, and BS or IAS15 in steps with a close encounter, almost time-reversible.

    Made for planets about one dominant body, encounters with that body included; `caveat` says where a
    problem is outside its domain.

    Parameters
    ----------
    h : float
        Length of a step, > 0.
    r_crit_hill : float
        Radius of an encounter between planets in modified Hill radii, >= 0.
    peri_crit_eta : float
        A pericentre is passed closely where the step is longer than this part of its time scale, >= 0.
    peri_mode : {"FULL_BS", "PARTIAL_BS", "FULL_IAS15"}
        How pericentres are integrated: all bodies by Bulirsch-Stoer, those that come close, or all by IAS15.

    Examples
    --------
    >>> import problems
    >>> from integrators import TRACE, integrate
    >>> planets = problems.load("outer_solar_system", t_end=100.0)
    >>> bool(integrate(planets, TRACE(h=0.3), [0.0, 100.0]).errors()["energy"].max() < 1e-6)
    True
    """

    r_crit_hill: NotNegative = 3.0
    peri_crit_eta: NotNegative = 1.0
    peri_mode: Literal["FULL_BS", "PARTIAL_BS", "FULL_IAS15"] = "FULL_BS"

    order = 2  # at a fixed perturbation, without encounters
    citation = cite("ReinLiu2012", "LuHernandezRein2024")
    family = "hybrid"
    to_end = "stop"
    counted = False

    def set_up(self, simulation: Any) -> None:
        """Choose TRACE and its criteria."""
        chosen = choose(simulation, "trace")
        chosen.r_crit_hill, chosen.peri_crit_eta = self.r_crit_hill, self.peri_crit_eta
        chosen.peri_mode = self.peri_mode
