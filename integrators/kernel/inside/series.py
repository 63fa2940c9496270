"""The polynomial on which zeros are looked for: that of the solved step, where s is small one term more.

States at zeros are ends of partial steps, which differ from the step's own polynomial by O(h^(s + 1)). With
s = 1 that is as much as a solution bends within a step: positions go along straight lines, and do not turn
back inside. The coefficient gamma_s of the field on that polynomial takes the difference down to
O(h^(s + 2)). Stages tell it; Gauss methods, whose P_s is 0 at the nodes, evaluate the field at others.
"""

from integrators.kernel.inside.memory import NODES
from integrators.kernel.inside.sample import interpolate8, is_finite, weigh
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_field, get, put, splat8, total
from integrators.kernel.step.fixed_point import project


@compiled
def take_series(ctx, search):
    """Set `Search.series`."""
    project(ctx, ctx.tables.projection, ctx.tables.groups)
    for j in range(ctx.s):
        take_term(ctx, search, j, ctx.tables.first + j)
    if search.terms == ctx.s:
        return
    if ctx.k > ctx.s:
        project(ctx, ctx.tables.mode_projection, ctx.tables.mode_groups)
        take_term(ctx, search, ctx.s, ctx.s)
    else:
        add_term(ctx, search)


@compiled
def take_term(ctx, search, j, i):
    """Let coefficient i of those of the step be term j."""
    gamma, group = ctx.scratch.coefficients, 8 * ctx.padded
    for d in range(ctx.rows):
        search.series[place(search, j, d)] = gamma[(i // 8) * group + 8 * d + i % 8]


@compiled
def place(search, j, d):
    """Return where in `Search.series` term j of row d is."""
    return (j // 8) * 8 * search.dim + 8 * d + j % 8


@compiled
def add_term(ctx, search):
    """Set the term beyond those of the step from the field on its polynomial."""
    c, times, block = get(search.gauss, 0), search.node_times, search.block
    weigh(ctx, c, ctx.s, search.weights)
    interpolate8(ctx, search, c, ctx.s, search.weights, block)
    lanes, stages, values = ctx.lanes, ctx.scratch.old_stages, ctx.scratch.sums
    for chunk in range(0, lanes, NODES):  # idle lanes repeat
        put(times, chunk, search.time + (ctx.h * c + splat8(search.time_low)))
        for d in range(ctx.rows):
            put(stages, lanes * d + chunk, get(block, 8 * d))
    call_field(ctx.field, times, stages, ctx.par, values)
    ctx.counters.evaluations += NODES
    for d in range(ctx.rows):
        term = total(get(search.gauss, NODES) * get(values, lanes * d))
        search.series[place(search, ctx.s, d)] = term if is_finite(term) else 0.0
