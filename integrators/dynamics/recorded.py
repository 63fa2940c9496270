"""The steps of a trajectory, kept for their adjoint or made again from checkpoints."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from integrators.protocol import Array, Checkpoints, Gradients, Program, Samples, Status, offers
from problems.errors import InputError
from problems.problem import Problem

MEMORY = 2**28  # bytes for recorded stages, about
SEGMENT = 4096  # steps that are recorded at a time, at most


@dataclass
class _Segment:
    """Some steps, from a checkpoint on; their records, unless these were given up."""

    start: Any
    steps: int
    records: Any


class Recorded:
    """A trajectory whose steps are kept, or can be made again, for adjoints.

    Parameters
    ----------
    program : Program
        Of `integrators.HBVM` or `integrators.Gauss`, on a traced system.
    problem : Problem
        Where it begins.
    end : float
        Time of the end.
    y0 : ndarray, shape (dim,), optional
        Another start than the problem's,
    par : ndarray, shape (n_par,), optional
        and other parameters.
    memory : float
        Bytes for the stages, about. Where these do not suffice, checkpoints are kept instead of the oldest
        ones, and the steps from each are made again.

    Attributes
    ----------
    y : ndarray, shape (dim,)
        The end.
    steps : int
        Steps to it.
    kept : int
        Bytes of the records that were kept.
    solver : str
        What solved the steps.

    Raises
    ------
    problems.errors.InputError
        If the method has no adjoint, or the trajectory does not reach the end.
    """

    def __init__(
        self,
        program: Program,
        problem: Problem,
        end: float,
        *,
        y0: Array | None = None,
        par: Array | None = None,
        memory: float = MEMORY,
    ):
        start, values = problem.y0 if y0 is None else y0, problem.par if par is None else par
        stepper: Any = program.start(start, values, problem.t0)
        if not (offers(stepper, Gradients) and offers(stepper, Checkpoints)):
            raise InputError("a method whose steps have no adjoint has no gradients; use Gauss or HBVM.")
        self._stepper, self._end, self._segments = stepper, end, list[_Segment]()
        size = stepper.recorder(1).bytes
        self._length = int(max(1, min(memory // (2 * size), SEGMENT)))
        room = max(1, int(memory // (size * self._length)))
        while True:
            start = stepper.checkpoint()
            records = self._record(self._length)
            self._segments.append(_Segment(start, len(records), records))
            if len(self._segments) > room:
                self._segments[-1 - room].records = None
            if len(records) < self._length:
                break
        last = stepper.recorder(1)
        stepper.record(last)
        self.y = self._made(stepper.advance(np.array([end]))).y[0]
        self._segments.append(_Segment(None, len(last), last))
        self.steps = sum(segment.steps for segment in self._segments)
        self.solver = stepper.stats.solver
        self.kept = size * sum(segment.steps for segment in self._segments if segment.records)

    def _record(self, most: int) -> Any:
        records = self._stepper.recorder(most)
        self._stepper.record(records)
        self._made(self._stepper.march(self._end, most))
        return records

    def _made(self, samples: Samples) -> Samples:
        if samples.status is not Status.FINISHED:
            raise InputError(f"there is no gradient of what is not reached: {samples.reason}")
        return samples

    def pulled_back(self, gradient: Array, *, parameters: bool) -> tuple[Array, Array]:
        """Return derivatives with respect to the start and the parameters of what has them at the end.

        Parameters
        ----------
        gradient : ndarray, shape (dim,)
            Derivatives with respect to the end.
        parameters : bool
            Whether those with respect to the parameters are wanted; else there are none, shape (0,).
        """
        adjoint = self._stepper.adjoint(parameters=parameters)
        adjoint.begin(gradient)
        for segment in reversed(self._segments):
            records = segment.records
            if records is None:
                self._stepper.restore(segment.start)
                records = self._record(segment.steps)
            adjoint.follow(records)
        return adjoint.gradient
