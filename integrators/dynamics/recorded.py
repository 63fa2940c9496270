"""The steps of a trajectory, kept for their adjoint or made again from checkpoints."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.protocol import Array, Checkpoints, Destination, Gradients, Program, Samples, Status, offers
from integrators.refusals import check_times
from problems.errors import InputError
from problems.problem import Problem

MEMORY = 2**28  # bytes for recorded stages, about
FIRST, SEGMENT = 64, 4096  # steps that are recorded at a time, at first and at most


@dataclass
class _Segment:
    """Some steps towards a time, from a checkpoint on; their records, unless these were given up."""

    start: Any
    end: float
    steps: int
    records: Any


@dataclass
class _Sample:
    """The partial step from the last step to a sample; the steps go on beside it."""

    number: int
    records: Any


def start_of_recorded(program: Program, y0: Array, par: Array, t0: float, end: float) -> Any:
    """Return a stepper whose steps have adjoints and are those on the way to ``end``.

    Raises
    ------
    problems.errors.InputError
        If the method has no adjoint.
    """
    stepper: Any = program.start(y0, par, t0)
    if not (offers(stepper, Gradients) and offers(stepper, Checkpoints)):
        raise InputError("a method whose steps have no adjoint has no gradients; use Gauss or HBVM.")
    if offers(stepper, Destination):
        stepper.destination = end
    return stepper


def finished(samples: Samples) -> Samples:
    """Return samples that are all there.

    Raises
    ------
    problems.errors.InputError
        If the last time was not reached.
    """
    if samples.status is not Status.FINISHED:
        raise InputError(f"there is no gradient of what is not reached: {samples.reason}")
    return samples


class Recorded:
    """A trajectory whose steps are kept, or can be made again, for adjoints.

    Parameters
    ----------
    program : Program
        Of `integrators.HBVM` or `integrators.Gauss`, on a traced system.
    problem : Problem
        Where it begins.
    times : array_like, shape (m,)
        Times of samples, strictly monotone from the start on.
    y0 : ndarray, shape (dim,), optional
        Another start than the problem's,
    par : ndarray, shape (n_par,), optional
        and other parameters.
    memory : float
        Bytes for the stages, about. Where these do not suffice, checkpoints are kept instead of the oldest
        ones, and the steps from each are made again.

    Attributes
    ----------
    y : ndarray, shape (m, dim)
        The samples.
    steps : int
        Steps to the last of them.
    kept : int
        Bytes of the records that were kept.
    solver : str
        What solved the steps.

    Raises
    ------
    problems.errors.InputError
        For times that cannot be, if the method has no adjoint, or the trajectory does not reach the end.
    """

    def __init__(
        self,
        program: Program,
        problem: Problem,
        times: ArrayLike,
        *,
        y0: Array | None = None,
        par: Array | None = None,
        memory: float = MEMORY,
    ):
        start, values = problem.y0 if y0 is None else y0, problem.par if par is None else par
        grid = check_times(times, problem.t0)
        stepper = start_of_recorded(program, start, values, problem.t0, float(grid[-1]))
        self._stepper, self._parts = stepper, list[_Segment | _Sample]()
        self._memory, self._held, self._oldest = memory, 0.0, 0
        size = stepper.recorder(1).bytes
        self._longest = int(max(1, min(memory // (2 * size), SEGMENT)))
        self.y = np.empty((grid.size, problem.system.dim))
        self._here = stepper.checkpoint()
        for i, time in enumerate(grid.tolist()):
            self._go(time)
            last = stepper.recorder(1)
            stepper.record(last)
            self.y[i] = finished(stepper.advance(np.array([time]))).y[0]
            self._parts.append(_Sample(i, last))
            stepper.restore(self._here)  # the steps go on as if there were no sample
        segments = [part for part in self._parts if isinstance(part, _Segment)]
        self.steps = sum(segment.steps for segment in segments) + len(self._parts[-1].records)
        self.solver = stepper.stats.solver
        self.kept = size * sum(segment.steps for segment in segments if segment.records)

    def _go(self, time: float) -> None:
        """Take the steps that end before a time, or at it."""
        capacity = min(FIRST, self._longest)
        while True:
            records = self._record(capacity, time)
            if len(records):
                self._parts.append(_Segment(self._here, time, len(records), records))
                self._held += records.bytes
                self._forget()
                self._here = self._stepper.checkpoint()
            if len(records) < capacity:
                return
            capacity = min(2 * capacity, self._longest)

    def _forget(self) -> None:
        """Give up the oldest records, as long as all of them take too much memory."""
        while self._held > self._memory and self._oldest < len(self._parts) - 1:
            part = self._parts[self._oldest]
            if isinstance(part, _Segment):
                self._held -= part.records.bytes
                part.records = None
            self._oldest += 1

    def _record(self, most: int, time: float) -> Any:
        records = self._stepper.recorder(most)
        self._stepper.record(records)
        finished(self._stepper.march(time, most))
        return records

    def pulled_back(self, gradients: Array, *, parameters: bool) -> tuple[Array, Array]:
        """Return derivatives with respect to the start and the parameters of what has them at the samples.

        Parameters
        ----------
        gradients : ndarray, shape (m, dim)
            Derivatives with respect to the samples.
        parameters : bool
            Whether those with respect to the parameters are wanted; else there are none, shape (0,).
        """
        adjoint = self._stepper.adjoint(parameters=parameters)
        along = np.zeros(gradients.shape[1])
        for part in reversed(self._parts):
            if isinstance(part, _Sample):
                adjoint.begin(gradients[part.number])
                adjoint.follow(part.records)
                along = along + adjoint.gradient[0]
                adjoint.begin(along)
                continue
            records = part.records
            if records is None:
                self._stepper.restore(part.start)
                records = self._record(part.steps, part.end)
            adjoint.follow(records)
            along = adjoint.gradient[0]
        return adjoint.gradient
