"""REBOUND's methods of fixed step: WHFast and the leapfrogs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from integrators.options import Step
from integrators.peers.rebound.program import REBOUND, Layout, ReboundMethod, ReboundProgram, calls, choose
from integrators.protocol import Array
from integrators.stepping import FixedStepper
from problems.checks import refusal, whole
from problems.errors import InputError
from problems.problem import Problem, System

Coordinates = Literal["jacobi", "democraticheliocentric", "whds", "barycentric"]
Kernel = Literal["default", "modifiedkick", "composition", "lazy"]
Corrector = Literal[0, 3, 5, 7, 11, 17]
EVALUATIONS = {2: 1, 4: 3, 6: 9, 8: 17}
"""Force evaluations in a step of the leapfrog of each order."""

DOMINANCE = 10.0
"""A body dominates if it has this many times the mass of all others together."""

RADIAL = 1e-6
"""Sine of the angle between position and velocity below which an orbit counts as radial."""

WHFAST = """\
@article{ReinTamayo2015,
  author = {Rein, Hanno and Tamayo, Daniel},
  title = {{WHFAST}: a fast and unbiased implementation of a symplectic {Wisdom-Holman} integrator for
           long-term gravitational simulations},
  journal = {Monthly Notices of the Royal Astronomical Society},
  volume = {452},
  number = {1},
  pages = {376--388},
  year = {2015},
  doi = {10.1093/mnras/stv1257}
}
@article{ReinTamayoBrown2019,
  author = {Rein, Hanno and Tamayo, Daniel and Brown, Garett},
  title = {High-order symplectic integrators for planetary dynamics and their implementation in {REBOUND}},
  journal = {Monthly Notices of the Royal Astronomical Society},
  volume = {489},
  number = {4},
  pages = {4632--4640},
  year = {2019},
  doi = {10.1093/mnras/stz2503}
}
@article{WisdomHolman1991,
  author = {Wisdom, Jack and Holman, Matthew},
  title = {Symplectic maps for the {N}-body problem},
  journal = {The Astronomical Journal},
  volume = {102},
  pages = {1528--1538},
  year = {1991},
  doi = {10.1086/115978}
}
"""

LEAPFROG = """\
@book{BlanesCasas2016,
  author = {Blanes, Sergio and Casas, Fernando},
  title = {A Concise Introduction to Geometric Numerical Integration},
  publisher = {Chapman and Hall/CRC},
  year = {2016}
}
"""


class _Permutation:
    def checked(self, owner: str, name: str, value: Any) -> tuple[int, ...]:
        places = [whole(i) for i in value] if isinstance(value, Sequence | np.ndarray) else []
        found = tuple(i for i in places if i is not None)
        if not found or sorted(found) != list(range(len(places))):
            raise refusal(owner, name, value, "a list that names each body from 0 once, as in (2, 0, 1)")
        return found


@dataclass(frozen=True, kw_only=True, repr=False)
class FixedMethod(ReboundMethod):
    """What REBOUND's methods of fixed step share."""

    h: Step

    def stepper(self, program: ReboundProgram, layout: Layout, y: Array, t: float) -> "ReboundStepper":
        """Return a trajectory."""
        return ReboundStepper(program, layout, y, t)


@dataclass(frozen=True, kw_only=True, repr=False)
class WHFast(FixedMethod):
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
    citation = REBOUND + WHFAST
    family = "wisdom-holman"
    to_end = "land"

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

    def refuses(self, system: System, par: Array) -> str | None:
        """Return why not: it needs gravitating bodies, as many as ``body_order`` has."""
        if system.bodies is None:
            return "it needs gravitating bodies, and the system declares none."
        n = system.dim // 2 // system.bodies.dimension
        if n < 2:
            return "it needs at least two bodies."
        if self.body_order is not None and len(self.body_order) != n:
            return f"body_order has {len(self.body_order)} bodies, the problem {n}."
        return super().refuses(system, par)

    def order_of_bodies(self, n: int) -> list[int]:
        """Return which body is REBOUND's first, second, ..."""
        return list(range(n)) if self.body_order is None else list(self.body_order)

    def caveat(self, problem: Problem) -> str | None:
        """Say why a problem is outside what WHFast was made for, although it runs."""
        system = problem.system
        if system.bodies is None or self.accepts(problem) is not None:
            return None
        layout = Layout(system, problem.par, self)
        m = layout.masses
        said = []
        if np.max(m) < DOMINANCE * (np.sum(m) - np.max(m)):
            said.append(
                f"no body dominates (the largest has {np.max(m) / np.sum(m):.2g} of the mass), "
                "so the perturbation of the Kepler orbits is as large as they are"
            )
        elif int(np.argmax(m)) != 0:
            said.append("the dominant body is not the first, about which the orbits are")
        radial = _radial(layout, problem.y0) if self.coordinates == "jacobi" else []
        if radial:
            said.append(
                f"the Jacobi orbit of body {radial[0]} is radial: it goes through the barycentre of those "
                "before it, where the Kepler orbit is singular"
            )
        return "; ".join(said) + "." if said else None

    def set_up(self, simulation: Any) -> None:
        """Choose WHFast and its options."""
        chosen = choose(simulation, "whfast")
        chosen.coordinates, chosen.kernel = self.coordinates, self.kernel
        chosen.corrector, chosen.corrector2 = self.corrector, int(self.corrector2)
        chosen.safe_mode, chosen.keep_unsynchronized = 0, 1


@dataclass(frozen=True, kw_only=True, repr=False)
class Leapfrog(FixedMethod):
    """REBOUND's leapfrog, drift-kick-drift, and its compositions of order 4, 6 and 8; symplectic.

    Parameters
    ----------
    h : float
        Length of a step, > 0.
    order : {2, 4, 6, 8}
        Order of convergence; a step takes 1, 3, 9 or 17 force evaluations.

    Examples
    --------
    >>> import problems
    >>> from integrators import Leapfrog, integrate
    >>> solution = integrate(problems.load("henon_heiles"), Leapfrog(h=0.05, order=8), [0.0, 50.0])
    >>> bool(solution.errors()["energy"].max() < 1e-12)
    True
    """

    order: Literal[2, 4, 6, 8] = 2

    citation = REBOUND + LEAPFROG
    family = "splitting"
    to_end = "land"

    def set_up(self, simulation: Any) -> None:
        """Choose the leapfrog and its order."""
        choose(simulation, "leapfrog").order = self.order


class ReboundStepper(FixedStepper):
    """A trajectory with fixed steps; see `integrators.stepping.FixedStepper` for the sampling."""

    def __init__(self, program: ReboundProgram, layout: Layout, y: Array, t: float):
        super().__init__(program, y, layout.par, t)
        self._layout = layout
        self._block, self._spare = (program.hooks.Block(layout.numbers) for _ in range(2))
        self._restart(t, y, self._h)

    def _restart(self, t: float, y: Array, h: float) -> None:
        simulation = self._program.simulation(self._layout, t, y)
        simulation.dt = h
        self._use(simulation)

    def _use(self, simulation: Any) -> None:
        self._program.hooks.attach(simulation, self._block, force=self._program.force)
        self._simulation = simulation

    def _march(self, count: int) -> None:
        with calls(self._stats):
            self._simulation.t = self._time()
            self._simulation.steps(count)
        self._stats.evaluations = int(self._block.values[self._program.hooks.EVALUATIONS])

    def _state(self) -> Array:
        return self._program.state(self._layout, self._simulation)

    def _aside(self, part: float) -> Array:
        program = self._program
        with program.hooks.detached(self._simulation):
            aside = self._simulation.copy()
        program.hooks.attach(aside, self._spare, force=program.force)
        self._part(aside, part)
        return program.state(self._layout, aside)

    def _shorten(self, part: float) -> None:
        simulation = self._simulation
        self._part(simulation, part)
        simulation.dt = self._h
        if isinstance(self._program.method, WHFast):
            simulation.integrator.keep_unsynchronized = 1
        self._stats.evaluations = int(self._block.values[self._program.hooks.EVALUATIONS])

    def _part(self, simulation: Any, part: float) -> None:
        """Synchronise a simulation and take one step of length ``part``."""
        with calls(self._stats):
            if isinstance(self._program.method, WHFast):
                simulation.integrator.keep_unsynchronized = 0
                simulation.synchronize()
            simulation.t, simulation.dt = self._time(), part
            simulation.steps(1)

    def _save_steps(self) -> bytes:
        return self._program.archive(self._simulation)

    def _load_steps(self, steps: bytes) -> None:
        self._use(self._program.rebound.Simulation(steps))


def _radial(layout: Layout, y: Array) -> list[int]:
    """Return the bodies, in the problem's order, whose Jacobi orbits are radial."""
    x, v = layout.vectors(y)
    m, found = layout.masses, []
    for i in range(1, layout.n):
        share = m[:i, None] / np.sum(m[:i])
        r, u = x[i] - np.sum(share * x[:i], axis=0), v[i] - np.sum(share * v[:i], axis=0)
        if np.linalg.norm(np.cross(r, u)) <= RADIAL * np.linalg.norm(r) * np.linalg.norm(u):
            found.append(int(np.flatnonzero(layout.place == i)[0]))
    return found
