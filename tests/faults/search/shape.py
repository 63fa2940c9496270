"""What the search draws from: formulas with parameters, starts and spans that a seed decides."""

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from problems import Problem
from problems.systems.base import System

Array = NDArray[np.float64]
Reference = Callable[[Array], Array]

MEMBERS = 3  # trajectories of each case: the first for `integrate`, all for `integrate_many`
SAMPLES = 6  # random output times before the end
GRID = 41  # times that the size of a component is taken from


@dataclass(frozen=True)
class Trajectory:
    """One start with parameters over a span."""

    system: System
    t0: float
    t_end: float
    y0: Array
    parameters: dict[str, Any]

    @cached_property
    def par(self) -> SimpleNamespace:
        return SimpleNamespace(**self.parameters)

    @cached_property
    def problem(self) -> Problem:
        return Problem(self.system, y0=self.y0, parameters=self.parameters, t0=self.t0, t_end=self.t_end)


@dataclass(frozen=True)
class Shape:
    """One formula and how its numbers are drawn.

    Attributes
    ----------
    group : str
        The class of systems it belongs to.
    name : str
        Names it in the table, and seeds its draws.
    system : System
        The formula; its parameters are run-time arguments.
    span : callable
        Draws (t0, t_end), which the trajectories of a case share.
    member : callable
        Draws (y0, parameters) of one trajectory, given the generator, t0 and t_end.
    reference : callable
        Makes of a `Trajectory` a function from times to states.
    draws : int
        Cases of it.
    """

    group: str
    name: str
    system: System
    span: Callable[[np.random.Generator], tuple[float, float]]
    member: Callable[[np.random.Generator, float, float], tuple[Any, dict[str, Any]]]
    reference: Callable[[Trajectory], Reference]
    draws: int = 8

    def cases(self) -> Iterator["Case"]:
        return (self.case(index) for index in range(self.draws))

    def case(self, index: int) -> "Case":
        rng = np.random.default_rng([zlib.crc32(self.name.encode()), index])
        t0, t_end = self.span(rng)
        members = []
        for _ in range(MEMBERS):
            y0, parameters = self.member(rng, t0, t_end)
            members.append(Trajectory(self.system, t0, t_end, np.array(y0, dtype=float), parameters))
        parts = np.sort(rng.uniform(0.02, 0.98, SAMPLES))
        times = t0 + (t_end - t0) * parts
        return Case(self, index, members, np.append(times, t_end), t0 + (t_end - t0) * rng.uniform(size=4))


@dataclass(frozen=True)
class Case:
    """A drawn system: trajectories over one span, output times, and times for ``sol(t)``."""

    shape: Shape
    index: int
    members: list[Trajectory]
    times: Array
    asked: Array
    _known: dict[int, tuple[Reference, Array]] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.shape.name} {self.index}"

    def error(self, member: int, times: Array, states: Array) -> float:
        """Return the largest error, relative to the size of the component over the span."""
        trajectory = self.members[member]
        if member not in self._known:
            reference = self.shape.reference(trajectory)
            grid = np.append(np.linspace(trajectory.t0, trajectory.t_end, GRID), self.times)
            self._known[member] = reference, np.abs(reference(np.sort(grid))).max(axis=0)
        reference, sizes = self._known[member]
        if not len(times):
            return np.inf
        # A component that is 0 throughout has no size but that of the others.
        sizes = np.where(sizes > 0.0, sizes, max(float(sizes.max()), np.finfo(float).tiny))
        errors = np.abs(states - reference(np.asarray(times))) / sizes
        return float(errors.max()) if np.isfinite(errors).all() else np.inf
