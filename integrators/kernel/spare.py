"""The memory of trajectories that are over, for the next ones of the same program."""

from dataclasses import dataclass
from typing import Any

from integrators.kernel.context import Context
from integrators.kernel.native.memory import Content
from integrators.kernel.tangent.group import Directions
from integrators.kernel.tangent.vectors import Vectors
from problems.problem import System

PAIRS = 4
"""That are spare at most: more trajectories at a time have memory of their own."""

BYTES = 1 << 18
"""In a context that is spare, at most: beside the steps of such a system a fresh one costs little."""

BYTES_OF_VECTORS = 1 << 20
"""In the tangent vectors of a pair that is spare, at most."""


@dataclass(frozen=True, eq=False)
class Searched:
    """The memory of a search for events in a trajectory that is over, and the functions that it is for."""

    functions: Any
    memory: Any


class Pair:
    """The memory of a trajectory, and of its partial steps.

    Parameters
    ----------
    own, partial : Context
        Fresh ones.
    """

    par: bytes | None = None
    """The parameters of what is kept."""
    searched: Searched | None = None
    _content: tuple[Content, Content] | None = None

    def __init__(self, own: Context, partial: Context):
        self.own, self.partial = own, partial
        self.small = own.nbytes <= BYTES
        self._vectors: dict[tuple[Any, ...], Vectors] = {}

    def follow(
        self, system: System, directions: Directions, fresh: dict[tuple[int, bool], Context]
    ) -> Vectors:
        """Return vectors that follow the trajectory from here on, in memory that is kept, or fresh.

        Parameters
        ----------
        system : System
            The trajectory's.
        directions : Directions
            The vectors.
        fresh : dict
            As for `Vectors`.
        """
        key = *directions.state.shape, bool(directions.parameters.any())
        if (vectors := self._vectors.get(key)) is not None:
            vectors.begin(directions)
            return vectors
        vectors = Vectors(system, (self.own, self.partial), directions, fresh)
        kept = {key: vectors} | self._vectors  # the last one first
        self._vectors = {}
        room = BYTES_OF_VECTORS
        for each, member in kept.items():
            room -= member.nbytes
            if room >= 0:
                self._vectors[each] = member
        return vectors

    def leave_solvers(self) -> None:
        """Forget vectors that have implicit solvers, which take more memory than they."""
        if self._vectors:
            self._vectors = {key: vectors for key, vectors in self._vectors.items() if not vectors.solvers}

    def keep(self, par: bytes) -> None:
        """Take what both hold for what a trajectory with these parameters begins with."""
        self.par, self._content = par, (self.own.content(), self.partial.content())

    def renew(self) -> bool:
        """Let both hold what a trajectory with ``par`` begins with; False if nothing is kept."""
        if self._content is None:
            return False
        self.own.renew(self._content[0])
        if self.partial.repointed:  # otherwise nothing depends on what the last partial step left there
            self.partial.renew(self._content[1])
        return True


class Spare:
    """Pairs that no trajectory has; threads may share it."""

    def __init__(self) -> None:
        self._pairs: list[Pair] = []
        self._most = PAIRS  # which is there still when Python ends and forgets a module's names

    def take(self) -> Pair | None:
        """Return a pair that is nobody else's."""
        try:
            return self._pairs.pop()
        except IndexError:
            return None

    def give(self, pair: Pair) -> None:
        """Take the pair of a trajectory that is over."""
        if pair.small and len(self._pairs) < self._most:
            pair.leave_solvers()
            self._pairs.append(pair)
