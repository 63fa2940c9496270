"""Many trajectories with events: in lanes where steps are adaptive, with what happens in each.

A trajectory that leaves its lane is searched by itself, from its start.
"""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.events.finder import Ending, ended_by
from integrators.events.members import ending_of
from integrators.kernel.batch import Adaptive, Batch, Work, nothing_yet
from integrators.kernel.context import Context
from integrators.kernel.engines import look
from integrators.kernel.ensemble.group import ACCUMULATES, BY_EVENT
from integrators.kernel.ensemble.prepared import Lanes
from integrators.kernel.inside.search import Log, Sought, room_for
from integrators.kernel.pace import FEWEST, Pace
from integrators.kernel.stepper import CHUNK_WITH_EVENTS, HBVMStepper, Program, accumulated
from integrators.protocol import Samples, Status
from integrators.refusals import check_batch, check_times
from integrators.solution.occurrences import Occurrences

HITS = 128  # of a step of a lane, at most; a trajectory with more leaves it


@dataclass(frozen=True, eq=False)
class WithEvents:
    """The events of the trajectories of a program: starts them one by one, or many in lanes.

    Attributes
    ----------
    program : Program
        Of the trajectories.
    sought : Sought
        The events.
    """

    program: Program
    sought: Sought

    def __call__(self, y0: ArrayLike, par: ArrayLike | None, t0: float, end: float) -> HBVMStepper:
        """Return a stepper that looks for the events up to a time."""
        stepper = self.program.start(y0, par, t0)
        stepper.look_for(self.sought, end)
        return stepper

    def raise_what_is_no_failure(self) -> None:
        """Raise Ctrl-C and the like if they were raised in a function of the user in this thread."""
        for function in (*self.sought.functions, *self.sought.actions.values()):
            if function.error is not None and not isinstance(function.error, Exception):
                raise function.error

    def goes_in_batches(self) -> bool:
        """Whether trajectories go in lanes; see `integrators.protocol.BatchesEvents`."""
        return self.program.varying and self.program.program_of_lanes().in_lanes() is not None

    def find_in_batch(
        self, Y0: ArrayLike, par: ArrayLike | None, times: ArrayLike, t0: float, threads: int
    ) -> tuple[Batch, list[dict[str, Occurrences]]]:
        """Integrate every start to all times; return the trajectories, and what has happened in each."""
        program = self.program.program_of_lanes()
        lanes = program.in_lanes()
        assert lanes is not None
        grid = check_times(times, t0)
        starts, parameters = check_batch(Y0, par, grid, program.system)
        work = _Work(
            result=nothing_yet(grid, *starts.shape), starts=starts, parameters=parameters, t0=t0,
            sample="partial", threads=threads, program=program,
            search=WithEvents(program, replace(self.sought, shape=program.shape)),
            happened=[{} for _ in starts],
        )  # fmt: skip
        in_lanes = _Watched.planned(lanes, work)
        work.run(in_lanes)
        work.tell(in_lanes)
        return work.result, work.happened


@dataclass(frozen=True, eq=False, kw_only=True)
class _Work(Work):
    """A batch whose events are looked for."""

    program: Program
    search: WithEvents
    happened: list[dict[str, Occurrences]]

    def started(self, i: int) -> HBVMStepper:
        """Return a stepper at the start of a trajectory."""
        return self.search(self.starts[i], self.parameters[i], self.t0, float(self.result.t[-1]))

    def ending(self, i: int, stepper: HBVMStepper, samples: Samples) -> tuple[Ending, int]:
        """Return how a trajectory ended, and how many of the samples it reached; note what has happened."""
        ending = ending_of(stepper, samples, self.t0, float(self.result.t[-1]))
        search: Any = stepper.search
        self.happened[i] = search.hits.occurrences()
        return ending, ending.count(samples.t, search)

    def tell(self, lanes: "_Watched") -> None:
        """Say how the trajectories that stayed in lanes ended, and what has happened in them."""
        result, names = self.result, list(self.search.sought.events)
        stops, arrived = lanes.arrays["stops"].tolist(), lanes.arrived
        for i in np.flatnonzero(arrived >= ACCUMULATES).tolist():
            result.t_stop[i] = stops[i]
            if arrived[i] == ACCUMULATES:
                result.status[i], result.reason[i] = accumulated(stops[i])
            else:
                result.status[i] = Status.EVENT
                result.reason[i] = ended_by(names[arrived[i] - BY_EVENT], stops[i])
        found = lanes.occurrences()
        for i in np.flatnonzero(arrived).tolist():
            self.happened[i] = {name: each[i] for name, each in found.items()}
        for i in np.flatnonzero(arrived >= BY_EVENT).tolist():  # a sample at its time is the state after it
            last = self.happened[i][names[arrived[i] - BY_EVENT]]
            if last.after is not None:
                result.y[i, result.t == stops[i]] = last.after[-1]


@dataclass(frozen=True, eq=False)
class _Watched(Adaptive):
    """Adaptive steps that are searched for events: in each lane one trajectory after the other."""

    work: _Work
    logs: list[Log] = field(default_factory=list)

    @classmethod
    def plan(cls, lanes: Lanes, work: Work) -> tuple[float, dict[str, int], dict[str, Any]]:
        assert isinstance(work, _Work)
        h, counts, arrays = super().plan(lanes, work)
        events = {"events": len(work.search.sought.events)}
        return h, counts | events, arrays | {"stops": np.full(len(work.starts), np.nan)}

    def contexts(self) -> list[tuple[Context, ...]]:
        par = self.work.parameters[0]
        return [self.work.program.contexts(par) for _ in range(self.lanes.width)]

    def memory(self) -> Any:
        search, width, dim = self.work.search, self.lanes.width, self.lanes.dim
        end, parameters = float(self.work.result.t[-1]), self.lanes.parameters
        sign = 1.0 if end >= self.work.t0 else -1.0
        group, pairs = super().memory()
        events = search.sought.memory(pairs[0])
        events.last, events.sign = end, sign
        group.room = 2 * width * min(HITS, room_for(max(dim, parameters)))
        log = Log.of(events, group.room)
        group.partials, group.search = [partial for _, partial in pairs], events
        group.renews = int(self.work.program.renews)
        for context, _ in pairs:
            context.events.code, context.events.memory = look.code(), events
            context.events.act = int(bool(search.sought.actions))
        return group, pairs, events, log

    def advance(self, memory: Any, budget: int) -> int:
        _, _, events, log = memory
        outcome = super().advance(memory, budget)
        self.logs.append(log.chosen(slice(events.hits)))
        events.hits = 0
        self.work.search.raise_what_is_no_failure()
        return outcome

    def pace(self) -> Pace:
        pace = Pace(CHUNK_WITH_EVENTS, self.lanes.dim)
        pace.steps = FEWEST
        return pace

    def occurrences(self) -> dict[str, list[Occurrences]]:
        """Return what has happened in every trajectory, by the events' names, in the order of integration."""
        events, actions = self.work.search.sought.events, self.work.search.sought.actions
        n, ahead = len(self.arrived), self.work.result.t[-1] >= self.work.t0
        log = Log.joined(self.logs)
        log = log.chosen(np.lexsort((log.times if ahead else -log.times, log.members)))
        result = {}
        for i, name in enumerate(events):
            own = log.chosen(log.events == i)
            bounds = np.searchsorted(own.members, np.arange(n + 1)).tolist()
            columns = [own.times, own.states, own.directions]
            columns += [own.after, own.par] if name in actions else []
            result[name] = [
                Occurrences(*(column[start:end] for column in columns)) for start, end in pairwise(bounds)
            ]
        return result
