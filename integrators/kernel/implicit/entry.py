"""The C function of the implicit solver."""

from numba import types

from integrators.kernel import layout as at
from integrators.kernel import native
from integrators.kernel.implicit import layout as of
from integrators.kernel.implicit.layout import Memory
from integrators.kernel.implicit.newton import solve_step
from integrators.kernel.line.views import compiled, integers, numbers, table
from integrators.kernel.memory import get_int


@compiled
def entry(ctx, place, started):
    """Solve the step of a context with the solver's memory at ``place``; see `solve_step`."""
    head = integers(place, of.HEAD)
    rows, s, pairs, entries = head[of.ROWS], head[of.DEGREE], head[of.PAIRS], head[of.ENTRIES]
    a = integers(place + 8 * of.HEAD, 35)
    components = 2 * rows if get_int(ctx, at.SECOND) else rows
    m = Memory(
        numbers(a[0], 1), numbers(a[1], 1), numbers(a[2], 1), numbers(a[3], 1),
        table(a[4], pairs, s), table(a[5], pairs, s), table(a[6], s, pairs), table(a[7], s, pairs),
        numbers(a[8], pairs), numbers(a[9], pairs), table(a[10], s, s), table(a[11], s, s),
        integers(a[12], entries), integers(a[13], entries), integers(a[14], of.COUNTS),
        numbers(a[15], of.REALS), numbers(a[16], rows), table(a[17], s, components),
        numbers(a[18], components), table(a[19], s, components), table(a[20], s, components),
        table(a[21], s, components), numbers(a[22], rows), numbers(a[23], rows), numbers(a[24], rows),
        numbers(a[25], entries), table(a[26], pairs * rows, rows), table(a[27], pairs * rows, rows),
        integers(a[28], pairs * rows), numbers(a[29], rows), numbers(a[30], rows),
        numbers(a[31], components), numbers(a[32], components), numbers(a[33], 1), numbers(a[34], 1),
    )  # fmt: skip
    return solve_step(ctx, m, head[of.METHOD], head[of.JACOBIAN], head[of.FACTORS], started)


def build() -> bytes:
    """Compile `entry` to an object file."""
    return native.build(entry, [(types.int64, "i64")] * 3, "i64")
