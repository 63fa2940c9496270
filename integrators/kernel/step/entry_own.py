"""What Python calls: trajectories with steps of varying length."""

from numba import types

from integrators.kernel import layout as at
from integrators.kernel.native import binary as native
from integrators.kernel.simd.memory import get_float, put_float, put_int
from integrators.kernel.step.advance import reset
from integrators.kernel.step.estimate import first_length
from integrators.kernel.step.sweep import compiled
from integrators.kernel.step.vary import vary, walk

# What `entry` can do; `engine` has the same numbers.
RESET, VARY, WALK = range(3)


@compiled
def entry(what, ctx, side, between, count, times, first, out, budget):
    """Do what ``what`` names: the one C function.

    Parameters
    ----------
    what : {RESET, VARY, WALK}
        Put the trajectory at the state at ``out``, and choose a first step if there is
        none; go to ``count`` times; take up to ``budget`` steps, none beyond times[0], which
        are then in ``times``.
    ctx, side, between, count, times, first, out, budget
        As in `integrators.kernel.step.advance.advance`.
    """
    if what == RESET:
        reset(ctx, out)
        if get_float(ctx, at.NEXT_LENGTH) == 0.0:
            put_float(ctx, at.NEXT_LENGTH, first_length(ctx))
            put_int(ctx, at.AGE, 0)
        return at.DONE
    if what == VARY:
        return vary(ctx, side, between, count, times, first, out, budget)
    return walk(ctx, times, out, get_float(times, 0), budget)


def build() -> bytes:
    """Compile `entry` to an object file."""
    return native.build(entry, [(types.int64, "i64")] * 9, "i64")
