"""What the threads of a team do."""

from integrators.kernel.context import Context
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.team import (
    CLOSED,
    COEFFICIENTS,
    DONE_WITH,
    FIELD,
    FINISH,
    NEXT,
    OPENED,
    PREPARE,
    PRODUCT,
    PRODUCT_AND_CHANGE,
    PRODUCT_FOR_ONE,
    PRODUCT_OF_TWO,
)
from integrators.kernel.simd.atomic import claim, increase, observe
from integrators.kernel.simd.memory import call_field, call_part, put
from integrators.kernel.step.begin import prepare_rows
from integrators.kernel.step.coefficients import take_coefficients_of_rows
from integrators.kernel.step.finish import finish_rows
from integrators.kernel.step.fixed_point import (
    product_and_change_of_rows,
    product_for_one_of_rows,
    product_of_rows,
    product_of_two_of_rows,
)
from integrators.kernel.step.share import team_at, wait
from integrators.kernel.step.stages import offset

context = view(Context)


@compiled
def next_piece(pieces):
    """Return the number of a piece that is this thread's from now on; -1: there is none."""
    while True:
        opened = observe(pieces, OPENED)
        number = observe(pieces, NEXT)
        if number >= opened:
            return -1
        if claim(pieces, NEXT, number):
            return number


@compiled
def do(ctx, team, piece):
    """Do a piece of the job."""
    job, table = team.job, team.table
    if job == FIELD and team.part == 0:
        start = offset(ctx, piece)
        call_field(team.field, ctx.times + 8 * piece, ctx.stages + start, ctx.par, ctx.values + start)
        return
    first = team.block * piece
    last = min(first + team.block, ctx.rows)
    if job == FIELD:
        for call in range(ctx.calls):
            times, shift = ctx.times + ctx.lanes * call, ctx.lanes * ctx.padded * call
            call_part(team.part, times, ctx.stages + shift, ctx.par, ctx.values + shift, first, last)
    elif job == PRODUCT:
        product_of_rows(ctx, table, first, last)
    elif job == PRODUCT_AND_CHANGE:
        put(team.results, 8 * piece, product_and_change_of_rows(ctx, table, first, last))
    elif job == PRODUCT_OF_TWO:
        product_of_two_of_rows(ctx, table, first, last)
    elif job == PRODUCT_FOR_ONE:
        product_for_one_of_rows(ctx, table, first, last)
    elif job == PREPARE:
        prepare_rows(ctx, first, last)
    elif job == COEFFICIENTS:
        take_coefficients_of_rows(ctx, first, last)
    elif job == FINISH:
        put(team.results, 8 * piece, finish_rows(ctx, first, last))


@compiled
def work(address, helper):
    """Do pieces of jobs until none is left, or as a ``helper`` until all is over."""
    team = team_at(address)
    pieces, looks = team.pieces, 0
    while True:
        piece = next_piece(pieces)
        if piece >= 0:
            do(context(team.context), team, piece - team.first)
            increase(pieces, DONE_WITH, 1)
            looks = 0
        elif helper == 0 or observe(pieces, CLOSED):
            return 0
        else:
            looks = wait(team, looks)
