"""REBOUND's WHFast, and what its methods for bodies about a dominant one share."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from integrators.peers.rebound.fixed import FixedMethod
from integrators.peers.rebound.program import Layout, choose
from integrators.protocol import Array, cite
from problems.checks import refusal, whole
from problems.errors import InputError
from problems.problem import Problem, System

Coordinates = Literal["jacobi", "democraticheliocentric", "whds", "barycentric"]
Kernel = Literal["default", "modifiedkick", "composition", "lazy"]
Corrector = Literal[0, 3, 5, 7, 11, 17]

DOMINANCE = 10.0
"""A body dominates if it has this many times the mass of all others together."""

RADIAL = 1e-6
"""Sine of the angle between position and velocity below which an orbit counts as radial."""


class _Permutation:
    def checked(self, owner: str, name: str, value: Any) -> tuple[int, ...]:
        places = [whole(i) for i in value] if isinstance(value, Sequence | np.ndarray) else []
        order = tuple(i for i in places if i is not None)
        if not order or sorted(order) != list(range(len(places))):
            raise refusal(owner, name, value, "a list that names each body from 0 once, as in (2, 0, 1)")
        return order


@dataclass(frozen=True, kw_only=True, repr=False)
class CentralMethod(FixedMethod):
    """What REBOUND's methods for bodies about a dominant one share."""

    def refuses(self, system: System, par: Array | None = None) -> str | None:
        """Return why not: it needs at least two gravitating bodies."""
        if system.bodies is None:
            return "it needs gravitating bodies, and the system declares none."
        if system.dim // 2 // system.bodies.dimension < 2:
            return "it needs at least two bodies."
        return super().refuses(system, par)

    def caveat(self, problem: Problem) -> str | None:
        """Say why a problem is outside what the method was made for, although it runs."""
        if self.accepts(problem) is not None:
            return None
        said = self.doubts(Layout(problem.system, problem.par, self), problem.y0)
        return "; ".join(said) + "." if said else None

    def doubts(self, layout: Layout, y0: Array) -> list[str]:
        """Return what speaks against the method, of masses and of the start."""
        m = layout.masses
        if np.max(m) < DOMINANCE * (np.sum(m) - np.max(m)):
            return [
                f"no body dominates (the largest has {np.max(m) / np.sum(m):.2g} of the mass), "
                "so the perturbation of the Kepler orbits is as large as they are"
            ]
        return ["the dominant body is not the first, about which the orbits are"] if np.argmax(m) else []

    def radial(self, layout: Layout, y0: Array) -> list[str]:
        """Return what is wrong with a Jacobi orbit that is radial."""
        bodies = _radial(layout, y0)
        return [
            f"the Jacobi orbit of body {i} is radial: it goes through the barycentre of those "
            "before it, where the Kepler orbit is singular"
            for i in bodies[:1]
        ]


@dataclass(frozen=True, kw_only=True, repr=False)
class WHFast(CentralMethod):
    """REBOUND's WHFast: the symplectic Wisdom-Holman splitting into Kepler orbits and a perturbation.

    Made for planets about one dominant body; `caveat` says where a problem is not that.

    Parameters
    ----------
    h : float
        Length of a step, > 0.
    coordinates : {"jacobi", "democraticheliocentric", "whds", "barycentric"}
        In which the Hamiltonian is split.
    corrector : {0, 3, 5, 7, 11, 17}
        Order of the first symplectic corrector; Jacobi or barycentric coordinates only.
    corrector2 : bool
        The second symplectic corrector; Jacobi coordinates only.
    kernel : {"default", "modifiedkick", "composition", "lazy"}
        The kick; other than the default in Jacobi coordinates only.
    body_order : tuple of int, optional
        Which body comes first, second, ...: the first is the centre. The problem's
        own order by default; states are always in that.

    Notes
    -----
    REBOUND's safe mode is off, as its authors advise: half steps are joined, and a
    sample is a synchronised copy from which the integration does not go on
    (``keep_unsynchronized``), so that samples do not change the trajectory.

    Examples
    --------
    >>> import problems
    >>> from integrators import WHFast, integrate
    >>> planets = problems.load("outer_solar_system", t_end=100.0)
    >>> bool(integrate(planets, WHFast(h=0.3, corrector=17), [0.0, 100.0]).errors()["energy"].max() < 1e-8)
    True
    """

    coordinates: Coordinates = "jacobi"
    corrector: Corrector = 0
    corrector2: bool = False
    kernel: Kernel = "default"
    body_order: Annotated[tuple[int, ...], _Permutation()] | None = None

    order = 2  # in h, at a fixed perturbation
    citation = cite("ReinLiu2012", "ReinTamayo2015", "ReinTamayoBrown2019", "WisdomHolman1991")
    family = "wisdom-holman"
    to_end = "stop"
    unsynchronized = True

    def __post_init__(self) -> None:
        super().__post_init__()
        jacobi = self.coordinates == "jacobi"
        if self.kernel != "default" and not jacobi:
            raise InputError(f'WHFast has kernel={self.kernel!r} in coordinates="jacobi" only.')
        if self.corrector and self.coordinates not in ("jacobi", "barycentric"):
            raise InputError(
                f'WHFast has corrector={self.corrector} in coordinates="jacobi" or "barycentric" only.'
            )
        if self.corrector2 and not jacobi:
            raise InputError('WHFast has corrector2=True in coordinates="jacobi" only.')

    def refuses(self, system: System, par: Array | None = None) -> str | None:
        """Return why not: it needs gravitating bodies, as many as ``body_order`` has."""
        if reason := super().refuses(system, par):
            return reason
        n = system.dim // 2 // system.bodies.dimension if system.bodies else 0
        if self.body_order is not None and len(self.body_order) != n:
            return f"body_order has {len(self.body_order)} bodies, the problem {n}."
        return None

    def order_of_bodies(self, n: int) -> list[int]:
        """Return which body is REBOUND's first, second, ..."""
        return list(range(n)) if self.body_order is None else list(self.body_order)

    def doubts(self, layout: Layout, y0: Array) -> list[str]:
        """Return what speaks against the method, of masses and of the start."""
        said = super().doubts(layout, y0)
        return said + self.radial(layout, y0) if self.coordinates == "jacobi" else said

    def set_up(self, simulation: Any) -> None:
        """Choose WHFast and its options."""
        chosen = choose(simulation, "whfast")
        chosen.coordinates, chosen.kernel = self.coordinates, self.kernel
        chosen.corrector, chosen.corrector2 = self.corrector, int(self.corrector2)
        chosen.safe_mode, chosen.keep_unsynchronized = 0, 1


def _radial(layout: Layout, y: Array) -> list[int]:
    """Return the bodies, in the problem's order, whose Jacobi orbits are radial."""
    x, v = layout.vectors(y)
    m, bodies = layout.masses, []
    for i in range(1, layout.n):
        share = m[:i, None] / np.sum(m[:i])
        r, u = x[i] - np.sum(share * x[:i], axis=0), v[i] - np.sum(share * v[:i], axis=0)
        if np.linalg.norm(np.cross(r, u)) <= RADIAL * np.linalg.norm(r) * np.linalg.norm(u):
            bodies.append(int(np.flatnonzero(layout.place == i)[0]))
    return bodies
