"""Many trajectories with tangent vectors in lanes: a batch of trajectories of a larger system."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from integrators.kernel.batch import Batch, BatchProgram, Fixed, Work, nothing_yet
from integrators.kernel.stepper import HBVMStepper
from integrators.kernel.tangent.lanes import VectorLanes
from integrators.options import Count
from integrators.protocol import Array, Samples
from integrators.refusals import check_batch, check_times
from problems.checks import checked

Directions = tuple[Array, Array]
"""Parts of tangent vectors in the states, shape (n, dim, k), and in the parameters, (n, n_par, k)."""


def batch_along(
    program: BatchProgram, lanes: VectorLanes, Y0: ArrayLike, par: ArrayLike | None, times: ArrayLike,
    t0: float, directions: Directions, threads: int,
) -> Batch:  # fmt: skip
    """Integrate every start, and the vectors along it, to all times. See `HBVMProgram.batch_along`."""
    threads = checked("a batch", "threads", threads, Count)
    grid = check_times(times, t0)
    starts, parameters = check_batch(Y0, par, grid, program.system)
    larger = nothing_yet(grid, len(starts), lanes.dim)
    joined = lanes.join(starts, directions[0]), lanes.join_parameters(parameters, directions[1])
    work = _WorkAlong(
        program, larger, *joined, t0, "partial", threads, larger=lanes, single=(starts, parameters),
        directions=directions,
    )  # fmt: skip
    work.run(Fixed.planned(lanes, work))
    y, vectors = lanes.split(larger.y)
    return replace(larger, y=y, variations=vectors)


@dataclass(frozen=True, eq=False, kw_only=True)
class _WorkAlong(Work):
    """A batch of the larger system; what leaves its lane is integrated by a stepper with tangent vectors."""

    larger: VectorLanes
    single: tuple[Array, Array]
    directions: Directions

    def started(self, i: int) -> HBVMStepper:
        """Return a stepper at the start of a trajectory, with its vectors."""
        starts, parameters = self.single
        stepper = self.program.start(starts[i], parameters[i], self.t0)
        stepper.follow(*(part[i] for part in self.directions))
        return stepper

    def states(self, stepper: HBVMStepper, samples: Samples) -> Array:
        """Return samples and the vectors there as states of the larger system."""
        assert stepper.variations is not None
        return self.larger.join(np.asarray(samples.y), stepper.variations)
