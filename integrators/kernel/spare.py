"""The memory of trajectories that are over, for the next ones of the same program."""

from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from integrators.kernel.context import Context
from integrators.kernel.native.memory import Content
from integrators.kernel.tangent.group import Directions
from integrators.kernel.tangent.vectors import Vectors

PAIRS = 4
"""That are spare at most: more trajectories at a time have memory of their own."""

BYTES = 1 << 18
"""In a context that is spare, at most: beside the steps of such a system a fresh one costs little."""

BYTES_OF_VECTORS = 1 << 20
"""In the tangent vectors of a pair that is spare, at most."""

_SOLVERS = attrgetter("solvers")


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
        self._vectors: dict[tuple[int, int, bool], Vectors] = {}

    def kept_vectors(self, directions: Directions) -> Vectors | None:
        """Return the memory of as many vectors as these, that followed a trajectory here; else ``None``."""
        return self._vectors.get((*directions.state.shape, directions.move_parameters))

    def keep_vectors(self, vectors: Vectors) -> None:
        """Keep their memory for others, before that of the ones kept already."""
        kept, self._vectors, room = {vectors.kind: vectors} | self._vectors, {}, BYTES_OF_VECTORS
        for kind, member in kept.items():
            room -= member.nbytes
            if room >= 0:
                self._vectors[kind] = member

    def leave_solvers(self) -> None:
        """Forget vectors that have implicit solvers, whose memory is larger than theirs."""
        if any(map(_SOLVERS, self._vectors.values())):
            self._vectors = {}

    def keep(self, par: bytes) -> None:
        """Take what both hold for what a trajectory with these parameters begins with."""
        self.par, self._content = par, (self.own.content(), self.partial.content())

    def forget(self) -> None:
        """Keep nothing: the parameters in the memory are no longer those of the trajectory's start."""
        self.par = self._content = None

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
