"""What an integration has made so far, piece by piece: its samples, and how it stands."""

from typing import Any

import numpy as np

from integrators.caveats import Losses
from integrators.protocol import Array, Samples, Stats, Status
from integrators.running.watch import both


class Course:
    """Samples in pieces, what goes with each of them, and how the integration stands.

    Parameters
    ----------
    t0 : float
        Where it begins.
    dim : int
        Length of a state.
    directions : tuple of ndarray or None
        Those of tangent vectors, if there are any.
    low : bool
        Whether samples have low parts.

    Attributes
    ----------
    parts : dict of str to list of ndarray
        ``"t"`` and ``"y"``, with ``"variations"`` and ``"low"`` where these are asked for: pieces that follow
        one another.
    start, here : float
        Where it begins, and how far it has come.
    made : int
        Output times that are served.
    status, reason
        As of `integrators.protocol.Stepper`; ``FINISHED`` as long as nothing ends it.
    losses : Losses
        What is conserved, and has been lost.
    earlier : Stats or None
        Of what was made before it was resumed.
    """

    def __init__(self, t0: float, dim: int, directions: tuple[Array, Array] | None, low: bool):
        self.start = self.here = t0
        self.parts: dict[str, list[Array]] = {"t": [], "y": []}
        self._nothing = {"t": np.empty(0), "y": np.empty((0, dim))}
        if directions is not None:
            self.parts["variations"], self._nothing["variations"] = [], np.empty((0, *directions[0].shape))
        if low:
            self.parts["low"], self._nothing["low"] = [], self._nothing["y"]
        self.made, self.status, self.reason = 0, Status.FINISHED, ""
        self.losses: Losses = {}
        self.earlier: Stats | None = None

    def add(self, samples: Samples, stepper: Any) -> None:
        """Add the samples of a stepper's last ``advance``."""
        made = {"t": samples.t, "y": samples.y}
        if "variations" in self.parts:
            made["variations"] = stepper.variations
        if "low" in self.parts:
            made["low"] = stepper.low
        for name, pieces in self.parts.items():
            pieces.append(made[name])

    def arrays(self) -> dict[str, Array]:
        """Return each of the parts in one piece, an array of its own."""
        whole = {}
        for name, pieces in self.parts.items():
            one = pieces[0].copy() if len(pieces) == 1 else np.concatenate([self._nothing[name], *pieces])
            whole[name], self.parts[name] = one, [one]
        return whole

    def replace(self, t: float, y: Array) -> None:
        """Let a state be the only sample."""
        single = {"t": np.array([t]), "y": y[np.newaxis], "low": np.zeros((1, y.size))}
        self.parts = {name: [single[name]] for name in self.parts}

    @property
    def empty(self) -> bool:
        """Whether there is no sample."""
        return not any(piece.size for piece in self.parts["t"])

    def stats(self, stepper: Any) -> Stats:
        """Return what all of it took."""
        return stepper.stats if self.earlier is None else both(self.earlier, stepper.stats)

    def kept(self, stepper: Any) -> dict[str, Any]:
        """Return all that `resume` asks for, and the stepper's continuation."""
        return {
            "stepper": stepper.checkpoint(), **self.arrays(), "made": self.made, "here": self.here,
            "status": self.status, "reason": self.reason, "stats": self.stats(stepper).copy(),
            "losses": self.losses,
        }  # fmt: skip

    def resume(self, kept: dict[str, Any], stepper: Any) -> None:
        """Go on where another one was kept."""
        stepper.restore(kept["stepper"])
        self.parts = {name: [kept[name]] for name in self.parts}
        self.made, self.here = kept["made"], kept["here"]
        self.status, self.reason, self.earlier = kept["status"], kept["reason"], kept["stats"]
        self.losses = kept.get("losses", self.losses)
