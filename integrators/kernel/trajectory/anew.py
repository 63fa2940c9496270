"""The beginning of a trajectory: at its start, and where an event has changed the state."""

from integrators.kernel.context import DONE, UNSOLVED
from integrators.kernel.inside.surfaces import find_surface
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.discontinuities import NOTHING
from integrators.kernel.parts.implicit import ALWAYS_IMPLICIT
from integrators.kernel.simd.memory import put, splat8
from integrators.kernel.step.begin import set_factors
from integrators.kernel.step.estimate import first_length, shorten_first
from integrators.kernel.step.finish import arrive
from integrators.kernel.step.projection import take_energy
from integrators.kernel.step.reversible import begin_pace
from integrators.kernel.step.rule import FIRST_RATE
from integrators.kernel.step.sample import read, vectors_of_state


@compiled
def reset(ctx, start):
    """Put a trajectory at a start, at t0, with h or a first length: no history.

    What follows is the same, bit for bit, whatever the memory was used for before. The implicit solver's
    own memory is not here.
    """
    for i in range(vectors_of_state(ctx)):
        put(ctx.state, 8 * i, splat8(0.0))
        put(ctx.error, 8 * i, splat8(0.0))
    read(ctx, ctx.state, start)
    ctx.samples_written = 0
    for g in range(ctx.blocks.groups):
        ctx.estimate.largest[g] = 0.0
    begin_anew(ctx)


@compiled
def begin_anew(ctx):
    """Begin at the present state, at t0: no history."""
    solver, implicit = ctx.solver, ctx.implicit
    if ctx.energy.code:
        take_energy(ctx)
    set_factors(ctx, ctx.h)
    ctx.length = ctx.older_length = 0.0
    ctx.n = ctx.blocks.age = solver.free = 0
    ctx.solved = UNSOLVED
    ctx.discontinuities.boundary = ctx.discontinuities.next_boundary = NOTHING
    find_surface(ctx)
    solver.outcome = DONE
    ctx.time_low, solver.rate = 0.0, FIRST_RATE
    if implicit.strategy != ALWAYS_IMPLICIT:
        implicit.active = implicit.slow = implicit.held = implicit.left = 0
    arrive(ctx)
    if ctx.pace.code:
        begin_pace(ctx)
    elif ctx.varying and ctx.controller.next_length == 0.0:
        ctx.controller.next_length = first_length(ctx)
        shorten_first(ctx)
        ctx.blocks.age = 0
