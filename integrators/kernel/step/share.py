"""Let the threads of a team do a job for a step."""

from integrators.kernel.native.attributes import address_of, view
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.team import DONE_WITH, FIELD, NEXT, OPENED, Team
from integrators.kernel.simd.atomic import increase, observe
from integrators.kernel.simd.lanes import rarely
from integrators.kernel.simd.memory import call_nothing, call_work, get, larger, largest, splat8

team_at = view(Team)
SPINS = 1 << 10  # looks at a number before another thread may have the processor


@compiled
def shared(ctx):
    """Whether a team shares the step; else what is done for one is not inlined where steps are short."""
    return rarely(ctx.team != 0)


@compiled
def wait(team, looks):
    """Wait for a moment; return how often that was done."""
    if looks >= SPINS:
        call_nothing(team.rest)
    return looks + 1


@compiled
def share(ctx, job, table):
    """Do a job, in this thread and in all others of the team; ``table`` is that of a product."""
    team = team_at(ctx.team)
    pieces, first = team.pieces, observe(team.pieces, NEXT)
    team.context, team.job, team.table, team.first = address_of(ctx), job, table, first
    count = (ctx.rows + team.block - 1) // team.block
    if job == FIELD and team.part == 0:
        count = ctx.calls * (ctx.lanes >> 3)
    increase(pieces, OPENED, count)
    call_work(team.code, team, 0)
    looks = 0
    while observe(pieces, DONE_WITH) < first + count:
        looks = wait(team, looks)


@compiled
def largest_result(ctx):
    """Return the largest of the results of the pieces of the last job; NaN if any is."""
    team = team_at(ctx.team)
    results = team.results
    top = splat8(0.0)
    for piece in range((ctx.rows + team.block - 1) // team.block):
        top = larger(top, get(results, 8 * piece))
    return largest(top)
