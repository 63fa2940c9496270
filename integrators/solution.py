"""A trajectory, what it cost, and what to know about it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from integrators.caveats import unseen
from integrators.protocol import Array, MethodBase, Stats, Status
from problems.problem import Problem


@dataclass(frozen=True, eq=False)
class Occurrences:
    """Where one event happened.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times, in the order of integration.
    y : ndarray, shape (n, dim)
        States there: ends of steps of solved length.
    direction : ndarray of int, shape (n,)
        1 where g rises, -1 where it falls, 0 where it touches zero and turns back.
    """

    t: Array
    y: Array
    direction: NDArray[np.int64]

    def __len__(self) -> int:
        return self.t.size


@dataclass(frozen=True, eq=False)
class Solution:
    """A trajectory and what it cost.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times reached; all that were asked for if ``status`` is ``FINISHED``.
    y : ndarray, shape (n, dim)
        States: q then p for Hamiltonian problems.
    status : Status
        How the integration ended; a failure is a value, not an exception.
    reason : str
        One sentence on a failure; empty otherwise.
    t_stop : float
        Where the method stopped: the last time asked for, or the time of the failure.
    stats : Stats
        Counters of the work done.
    compile_seconds : float
        Seconds spent compiling, before the first step.
    from_cache : bool or None
        Whether the compiled code came from a cache; ``None`` where nothing is compiled.
    problem, method
        What was integrated, and how.
    events : dict of str to Occurrences
        Times, states and directions of the events that were asked for, by name.
    error : Exception or None
        What a function of the user raised, where ``status`` is ``USER_ERROR``.
    """

    t: Array
    y: Array
    status: Status
    reason: str
    t_stop: float
    stats: Stats
    compile_seconds: float
    from_cache: bool | None
    problem: Problem
    method: MethodBase
    events: Mapping[str, Occurrences] = field(default_factory=dict)
    error: Exception | None = None

    @property
    def v(self) -> Array | None:
        """Velocities (n, dof) of a Hamiltonian problem with constant masses, else ``None``."""
        return self.problem.velocity(self.y)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on what a user should know about a solution although it did not fail."""
        caveat = self.method.caveat(self.problem)
        kinks, implicit = (self.stats.extra.get(name) for name in ("kinks", "implicit"))
        if caveat is None and not kinks and implicit and implicit["steps"]:
            caveat = unseen(self.problem, f"kinks are not looked for in its {implicit['steps']} Newton steps")
        said = () if caveat is None else (caveat,)
        if not kinks:
            return said
        t, h = kinks[0]
        return (
            *said,
            f"the field jumps or has a kink (places kept: {len(kinks)}, the first between t = {t!r} "
            f"and {t + h!r}): steps were cut there, and what lies between two nodes may have been missed; "
            "give breakpoints where the times are known.",
        )

    def invariants(self) -> dict[str, Array]:
        """Return the problem's invariants along the trajectory, by name."""
        return self.problem.invariants(self.y, self.t)

    def errors(self) -> dict[str, Array]:
        """Return the errors of the invariants along the trajectory, relative where that has a meaning."""
        return self.problem.errors(self.y, self.t)

    def guards(self) -> dict[str, Array]:
        """Return the quantities that a symmetry keeps at exactly zero, by name."""
        return self.problem.guards(self.y, self.t)
