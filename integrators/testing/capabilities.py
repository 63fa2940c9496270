"""Checks of what a method offers beyond the protocol: where a capability is offered, it keeps its promise."""

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from integrators.coefficients.order import order_of
from integrators.events.event import Event
from integrators.protocol import (
    SAMPLINGS,
    Actions,
    AsHBVM,
    Batches,
    BatchesAlong,
    BatchesEvents,
    Checkpoints,
    Destination,
    DoubleDouble,
    Events,
    Gradients,
    Interruptible,
    KeptError,
    MethodBase,
    PieceSize,
    PreparedBatches,
    Samplings,
    SharedSteps,
    Status,
    Threads,
    Variations,
    offers,
)
from integrators.running.integrate import integrate
from integrators.testing.checkpoints import checkpoints_continue_bit_for_bit
from integrators.testing.rules import finished, irregular, raises, regular, require, start
from problems import Opaque, Problem
from problems.errors import InputError

BATCH_BOUND = 1e-6
"""Largest difference between a batch and single trajectories, of states of size 1: their steps may differ."""

ACTION_BOUND = 1e-5
"""The same after an event and from a new start there: adaptive steps may begin with another length, so it is
as large as the errors of a loose tolerance (measured: 2.8e-7 with tol=1e-6; fixed steps: 0)."""

ROUNDING = 1e-13
"""Largest change of a sample by events: heyoka compiles other code then (measured: 2.4e-15; ours: 0)."""

DIFFERENCE, DIFFERENCE_BOUND = 1e-5, 1e-4
"""Relative distance of two starts, and largest error of their difference quotient as a derivative."""

RECORDED_STEPS = 64  # steps of a record
ADJOINT_BOUND = 1e-9
"""Largest relative difference between a gradient by tangent vectors and by the adjoint of the same steps
(measured: 1e-15)."""

MOVED = 1e-12
"""Largest change of the end by a quarter of a rounding error at the start, relative to the state."""

EVENT_BOUND = 1e-9
"""Largest value of an event's function where it is said to vanish."""


def samplings_are_as_stated(method: MethodBase, problem: Problem) -> str | None:
    """Check that the stated samplings are taken, the first by default, and that no others are."""
    grid = irregular(problem)
    stepper = start(method, problem)
    if not offers(stepper, Samplings):
        return "all samplings are expected of it"
    stated = stepper.samplings
    for sample in stated:
        finished(start(method, problem).advance(grid[-1:], sample=sample), method)
    for sample in set(SAMPLINGS) - set(stated):
        raises(
            InputError,
            lambda s=sample: start(method, problem).advance(grid, sample=s),
            f"sample={sample!r}, which is not stated, is refused",
        )
    plain = start(method, problem).advance(grid)
    first = start(method, problem).advance(grid, sample=stated[0])
    require(np.array_equal(plain.y, first.y), f"sample={stated[0]!r}, stated first, is the default")
    return None


def a_destination_leaves_the_samples_alone(method: MethodBase, problem: Problem) -> str | None:
    """Check that pieces on the way to a destination are bitwise identical to one call."""
    if not offers(start(method, problem), Destination):
        return "it takes no destination"
    grid = irregular(problem)
    at_once, stepper = start(method, problem), start(method, problem)
    at_once.destination = stepper.destination = float(grid[-1])
    whole = at_once.advance(grid)
    pieces = [stepper.advance(piece) for piece in np.array_split(grid, 3)]
    require(
        np.array_equal(np.concatenate([piece.y for piece in pieces]), whole.y),
        "pieces on the way to a destination do not change the samples",
    )
    return None


def keeps_the_error_of_a_user_s_function(method: MethodBase, problem: Problem) -> str | None:
    """Check that after ``USER_ERROR`` the stepper has the very exception that a function raised."""
    if not offers(start(method, problem), KeptError):
        return "it keeps no errors"
    raised = RuntimeError("no field beyond t = 3")

    def field(t: float, y: Any) -> Any:
        if t > 3.0:
            raise raised
        return [y[1], -y[0]]

    swing = Problem(Opaque(field, dim=2), y0=[1.0, 0.0], t_end=6.0)
    if (refusal := method.accepts(swing)) is not None:
        return refusal
    stepper = start(method, swing)
    samples = stepper.advance(regular(swing, 7))
    require(
        samples.status is Status.USER_ERROR,
        f"a function that raises ends it as user_error, not {samples.status}",
    )
    require(stepper.error is raised, "error is what the function raised")
    require(samples.t.size > 1, "the states before are returned")
    return None


def finds_events_beside_its_steps(method: MethodBase, problem: Problem) -> str | None:
    """Check that events lie where their function vanishes, end what is terminal, and change no sample."""
    program: Any = method.compile(problem.system)
    if not offers(program, Events):
        return "it finds no events"
    grid = irregular(problem)
    plain = integrate(problem, method, grid)
    level = float(plain.y[:, 0].min() + plain.y[:, 0].max()) / 2.0

    def crossing(y: Any, t: Any) -> Any:
        return y[0] - level - 1e-3 * (t - problem.t0)

    begin = program.with_events(problem, {"crossing": Event(crossing)})
    stepper = begin(problem.y0, problem.par, problem.t0, float(grid[-1]))
    require(stepper.search is not None, "what with_events starts has the search")
    solution = integrate(problem, method, grid, events=Event(crossing, name="crossing"))
    change = float(np.max(np.abs(solution.y - plain.y)))
    require(change < ROUNDING, f"events change no sample, but by {change:.1e}")
    crossings = solution.events["crossing"]
    require(crossings.t.size > 0, "an event that happens is found")
    there = [
        abs(float(y[0]) - level - 1e-3 * (t - problem.t0))
        for t, y in zip(crossings.t, crossings.y, strict=True)
    ]
    require(max(there) < EVENT_BOUND, f"the function vanishes at its events, but: {max(there):.1e}")
    ended = integrate(problem, method, grid, events=Event(crossing, name="crossing", terminal=True))
    require(ended.status is Status.EVENT and ended.t_stop == crossings.t[0], "a terminal event ends it")
    return None


def events_may_change_the_state(method: MethodBase, problem: Problem) -> str | None:
    """Check that after an event that leaves the state as it is the method begins anew at that state."""
    program: Any = method.compile(problem.system)
    if not (offers(program, Actions) and program.acts):
        return "its events change no state"
    grid = irregular(problem)
    plain = integrate(problem, method, grid).y[:, 0]
    level = float(plain.min() + plain.max()) / 2.0
    event = Event(lambda y: y[0] - level, then=lambda y: [y[i] for i in range(problem.y0.size)], name="same")
    solution = integrate(problem, method, grid, events=event)
    require(solution.status is Status.FINISHED, f"it goes on after an action, but: {solution.reason}")
    crossings: Any = solution.events["same"]
    require(crossings.t.size > 0, "an event that happens is found")
    require(
        np.array_equal(crossings.after, crossings.y), "the state after an event is what its action returns"
    )
    last = float(crossings.t[-1])
    later = grid > last
    require(bool(later.any()), "times are asked for after an event")
    anew = integrate(problem.replace(y0=crossings.after[-1], t0=last), method, grid[later])
    change = float(np.max(np.abs(solution.y[later] - anew.y)))
    require(
        change < ACTION_BOUND,
        f"after an action the method begins anew at its state, but is off by {change:.1e}",
    )
    return None


def comes_back_when_it_is_stopped(method: MethodBase, problem: Problem) -> str | None:
    """Check that pieces within a time limit have the bits of one call, and that ``stop`` interrupts."""
    stepper: Any = start(method, problem)
    if not offers(stepper, Interruptible):
        return "another thread cannot call it back"
    grid = irregular(problem)
    whole = start(method, problem).advance(grid)
    stepper.time_limit, done = 0.0, 0
    while done < grid.size:
        piece = stepper.advance(grid[done:])
        require(piece.status is Status.FINISHED and piece.t.size > 0, "each piece has a sample")
        require(np.array_equal(piece.y, whole.y[done : done + piece.t.size]), "pieces have the bits of one")
        done += piece.t.size
    stepper = start(method, problem)
    stepper.stop = threading.Event()
    stepper.stop.set()
    try:
        stepper.advance(irregular(problem))
    except KeyboardInterrupt:
        return None
    raise AssertionError("broken: advance comes back when stop is set")


def tangents_follow_and_change_nothing(method: MethodBase, problem: Problem) -> str | None:
    """Check that tangent vectors leave the trajectory's bits alone, and are derivatives of its end."""
    stepper = start(method, problem)
    if not offers(stepper, Variations):
        return "no tangent vectors follow it"
    dim, grid = problem.system.dim, regular(problem, 4)[1:2] * 0.25 + 0.75 * problem.t0
    try:
        stepper.follow(np.eye(dim), np.zeros((problem.par.size, dim)))
    except InputError as refusal:
        return str(refusal)
    followed, plain = stepper.advance(grid), start(method, problem).advance(grid)
    require(np.array_equal(followed.y, plain.y), "the trajectory is bitwise identical with tangent vectors")
    require(stepper.variations is not None, "they are there after a sample")
    shift, size = np.zeros(dim), DIFFERENCE * float(np.max(np.abs(problem.y0)))
    shift[0] = size
    ends = [
        method.compile(problem.system).start(problem.y0 + sign * shift, problem.par, problem.t0).advance(grid)
        for sign in (1.0, -1.0)
    ]
    slope = (ends[0].y[-1] - ends[1].y[-1]) / (2 * size)
    miss = float(np.max(np.abs(np.asarray(stepper.variations)[-1, :, 0] - slope)))
    require(miss < DIFFERENCE_BOUND * max(1.0, float(np.max(np.abs(slope)))), f"off by {miss:.1e}")
    return None


def adjoints_are_what_tangents_say(method: MethodBase, problem: Problem) -> str | None:
    """Check that recording leaves the trajectory's bits alone, and that the adjoint agrees with tangents."""
    stepper, followed = start(method, problem), start(method, problem)
    if not (offers(stepper, Gradients) and offers(followed, Variations)):
        return "its steps have no adjoint"
    dim, end = problem.system.dim, float(regular(problem, 4)[1]) * 0.25 + 0.75 * problem.t0
    try:
        followed.follow(np.eye(dim), np.zeros((problem.par.size, dim)))
    except InputError as refusal:
        return str(refusal)
    tapes: list[Any] = []
    while not tapes or len(tapes[-1]):  # the last one is of the partial step that is left
        tapes.append(stepper.recorder(RECORDED_STEPS))
        stepper.record(tapes[-1])
        stepper.march(end, RECORDED_STEPS)
    samples = stepper.advance([end])
    plain = followed.advance([end])
    require(np.array_equal(samples.y, plain.y), "the trajectory is bitwise identical when it is recorded")
    adjoint = stepper.adjoint(parameters=False)
    adjoint.begin(np.eye(dim)[0])
    for records in reversed(tapes):
        adjoint.follow(records)
    wanted = np.asarray(followed.variations)[-1, 0]
    miss = float(np.max(np.abs(adjoint.gradient[0] - wanted)) / np.max(np.abs(wanted)))
    require(miss < ADJOINT_BOUND, f"off by {miss:.1e}")
    return None


def batches_are_single_trajectories(method: MethodBase, problem: Problem) -> str | None:
    """Check that a batch gives what its trajectories give alone, in any order, prepared, and with threads."""
    program: Any = method.compile(problem.system)
    if not offers(program, Batches):
        return "it has no batches"
    grid = regular(problem, 4)[1:] * 0.25 + 0.75 * problem.t0
    starts, par = np.outer([1.0, 1.001, 0.999], problem.y0), np.tile(problem.par, (3, 1))
    options: dict[str, Any] = {"times": grid, "t0": problem.t0}
    batch = program.batch(starts, par, **options)
    require(
        batch.y.shape == (3, grid.size, problem.system.dim), f"y has shape (n, m, dim), not {batch.y.shape}"
    )
    require(all(status is Status.FINISHED for status in batch.status), f"all finish, but: {batch.reason}")
    for y0, states in zip(starts, batch.y, strict=True):
        alone = program.start(y0, problem.par, problem.t0).advance(grid).y
        miss = float(np.max(np.abs(alone - states)))
        require(miss < BATCH_BOUND, f"a trajectory of a batch is that from its start, but for {miss:.1e}")
    turned = program.batch(starts[::-1], par, **options)
    require(np.array_equal(turned.y[::-1], batch.y), "a trajectory does not depend on its place in the batch")
    return None


def batches_along_are_single_trajectories(method: MethodBase, problem: Problem) -> str | None:
    """Check that tangent vectors of a batch are those that follow its trajectories alone."""
    program: Any = method.compile(problem.system)
    if not offers(program, BatchesAlong):
        return "its batches have no tangent vectors"
    starts, par = np.outer([1.0, 1.001, 0.999], problem.y0), np.tile(problem.par, (3, 1))
    dim, n_par = problem.system.dim, problem.system.n_par
    directions = np.tile(np.eye(dim)[:, :2], (3, 1, 1)), np.zeros((3, n_par, min(dim, 2)))
    if not program.goes_along(directions):
        return "its batches have no such tangent vectors"
    options: dict[str, Any] = {"times": regular(problem, 9)[1:2], "t0": problem.t0}
    batch = program.batch_along(starts, par, **options, directions=directions)
    for y0, vectors, state, parameters in zip(starts, batch.variations, *directions, strict=True):
        stepper = program.start(y0, problem.par, problem.t0)
        stepper.follow(state, parameters)
        stepper.advance(options["times"])
        miss = float(np.max(np.abs(stepper.variations - vectors)))
        require(miss < BATCH_BOUND, f"vectors of a batch are those of its trajectories, but for {miss:.1e}")
    return None


def batches_find_the_events_of_single_trajectories(method: MethodBase, problem: Problem) -> str | None:
    """Check that a batch finds the events that its trajectories have alone, and ends where they end."""
    program: Any = method.compile(problem.system)
    if not offers(program, Events):
        return "it finds no events"
    grid = irregular(problem)
    plain = integrate(problem, method, grid).y[:, 0]
    level = float(plain.min() + plain.max()) / 2.0
    event = Event(lambda y: y[0] - level, terminal=2, name="level")
    begin = program.with_events(problem, {"level": event})
    if not (offers(begin, BatchesEvents) and begin.goes_in_batches()):
        return "it finds no events in batches"
    starts, par = np.outer([1.0, 1.001, 0.999], problem.y0), np.tile(problem.par, (3, 1))
    batch, happened = begin.find_in_batch(starts, par, grid, problem.t0, 1)
    for y0, status, stop, events in zip(starts, batch.status, batch.t_stop, happened, strict=True):
        alone = integrate(problem.replace(y0=y0), method, grid, events=event)
        require(status is alone.status, f"a trajectory ends as alone, {alone.status}, but: {status}")
        moments = np.append(events["level"].t, stop) - np.append(alone.events["level"].t, alone.t_stop)
        apart = float(np.max(np.abs(moments)))
        require(apart < BATCH_BOUND, f"its events happen when they do alone, but for {apart:.1e}")
    return None


def prepared_batches_are_batches(method: MethodBase, problem: Problem) -> str | None:
    """Check that a prepared batch is bitwise identical to one that was not prepared."""
    program: Any = method.compile(problem.system)
    if not offers(program, PreparedBatches):
        return "it prepares no batches"
    _same_bits(program, problem, lambda *rows, **options: program.prepare_batch(*rows, **options)())
    return None


def threads_change_no_bits(method: MethodBase, problem: Problem) -> str | None:
    """Check that a batch in two threads is bitwise identical to one in a single thread."""
    program: Any = method.compile(problem.system)
    if not (offers(program, Threads) and program.threaded):
        return "its batches take no threads"
    _same_bits(program, problem, partial(program.batch, threads=2))
    return None


def shared_steps_are_the_same(method: MethodBase, problem: Problem) -> str | None:
    """Check that steps that two threads share are bitwise those of one."""
    alone, shared = start(method, problem), start(method, problem)
    if not offers(shared, SharedSteps):
        return "no threads share its steps"
    try:
        shared.share(2)
    except InputError as refusal:
        return str(refusal)
    ours, theirs = (stepper.advance(regular(problem, 5)).y for stepper in (alone, shared))
    require(np.array_equal(ours, theirs), "threads change no bits")
    return None


def the_size_of_a_piece_is_a_count(method: MethodBase, problem: Problem) -> str | None:
    """Check that the size of a first piece is a whole number above 0."""
    program: Any = method.compile(problem.system)
    if not offers(program, PieceSize):
        return "it asks for no size of a piece"
    require(isinstance(program.piece, int) and program.piece > 0, f"piece is a count, not {program.piece!r}")
    return None


def pairs_hold_twice_the_digits(method: MethodBase, problem: Problem) -> str | None:
    """Check that pairs are normalised, that a start comes back, and that its low part moves the end."""
    program: Any = method.compile(problem.system)
    if not offers(program, DoubleDouble):
        return "its states are doubles"
    grid = regular(problem, 4)[1:] * 0.25 + 0.75 * problem.t0
    ends = []
    for share in (0.0, 0.25):
        pairs = np.stack([problem.y0, share * np.spacing(problem.y0)], axis=1)
        stepper = program.start_pairs(pairs, problem.par, problem.t0)
        here = stepper.advance(np.array([problem.t0]))
        require(np.array_equal(np.stack([here.y[0], stepper.low[0]], axis=1), pairs), "a start is a sample")
        samples = stepper.advance(grid)
        require(stepper.low.shape == samples.y.shape, "low has the shape of the samples")
        nearest = np.abs(stepper.low) <= 0.5 * np.spacing(np.abs(samples.y))
        require(bool(nearest.all()), "samples are the nearest doubles")
        ends.append((samples.y[-1], stepper.low[-1]))
    moved = (ends[1][0] - ends[0][0]) + (ends[1][1] - ends[0][1])
    miss, size = float(np.max(np.abs(moved))), float(np.max(np.abs(problem.y0)))
    require(0.0 < miss < MOVED * size, f"the low part of a start moves the end, but by {miss:.1e}")
    return None


def is_the_hbvm_that_it_names(method: MethodBase, problem: Problem) -> str | None:
    """Check that the HBVM that a method says it is has its order and its trajectory."""
    if not offers(method, AsHBVM):
        return "it is no HBVM"
    try:
        same: Any = method.as_hbvm()  # type: ignore[attr-defined]
    except InputError as refusal:
        return str(refusal)
    if method.order is not None:
        require(order_of(method) == method.order, "its tableau has the order that it states")
    ours, theirs = (start(each, problem).advance(regular(problem, 5)).y for each in (method, same))
    require(np.array_equal(ours, theirs), f"{method!r} gives the bits of {same!r}")
    return None


CHECK_OF: dict[type, Callable[[MethodBase, Problem], str | None]] = {
    Samplings: samplings_are_as_stated,
    Destination: a_destination_leaves_the_samples_alone,
    KeptError: keeps_the_error_of_a_user_s_function,
    Checkpoints: checkpoints_continue_bit_for_bit,
    Interruptible: comes_back_when_it_is_stopped,
    Events: finds_events_beside_its_steps,
    Actions: events_may_change_the_state,
    Batches: batches_are_single_trajectories,
    BatchesAlong: batches_along_are_single_trajectories,
    BatchesEvents: batches_find_the_events_of_single_trajectories,
    PreparedBatches: prepared_batches_are_batches,
    Threads: threads_change_no_bits,
    SharedSteps: shared_steps_are_the_same,
    PieceSize: the_size_of_a_piece_is_a_count,
    Variations: tangents_follow_and_change_nothing,
    Gradients: adjoints_are_what_tangents_say,
    DoubleDouble: pairs_hold_twice_the_digits,
    AsHBVM: is_the_hbvm_that_it_names,
}
"""Which check a capability has."""


def _same_bits(program: Any, problem: Problem, run: Callable[..., Any]) -> None:
    """Fail unless ``run`` gives the bits of ``program.batch``."""
    starts, par = np.outer([1.0, 1.001, 0.999], problem.y0), np.tile(problem.par, (3, 1))
    options: dict[str, Any] = {"times": regular(problem, 9)[1:2], "t0": problem.t0}
    plain, other = program.batch(starts, par, **options), run(starts, par, **options)
    require(np.array_equal(plain.y, other.y), "it has the bits of a plain batch")
