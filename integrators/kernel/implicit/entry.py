"""The C function of the implicit solver."""

from numba import types

from integrators.kernel import layout as at
from integrators.kernel.implicit import layout as of
from integrators.kernel.implicit.layout import Memory
from integrators.kernel.implicit.newton import solve_step
from integrators.kernel.line.views import compiled, integers, numbers, table
from integrators.kernel.native import binary as native
from integrators.kernel.simd.memory import get_int


@compiled
def entry(ctx, place, started):
    """Solve the step of a context with the solver's memory at ``place``; see `solve_step`."""
    head = integers(place, of.HEAD)
    rows, k, s, pairs = head[of.ROWS], head[of.STAGES], head[of.DEGREE], head[of.PAIRS]
    entries, whole = head[of.ENTRIES], head[of.WHOLE]
    dim = 2 * rows if get_int(ctx, at.SECOND) else rows
    a = integers(place + 8 * of.HEAD, 43)
    m = Memory(
        numbers(a[0], 1), numbers(a[1], 1), numbers(a[2], 1), numbers(a[3], 1),
        table(a[4], k, s), table(a[5], k, s), table(a[6], s, k),
        table(a[7], pairs, s), table(a[8], pairs, s), table(a[9], s, pairs), table(a[10], s, pairs),
        numbers(a[11], pairs), numbers(a[12], pairs), table(a[13], s, s), table(a[14], s, s),
        integers(a[15], entries), integers(a[16], entries), integers(a[17], of.COUNTS),
        numbers(a[18], of.REALS), numbers(a[19], rows), table(a[20], s, dim), numbers(a[21], dim),
        table(a[22], s, dim), table(a[23], s, dim), table(a[24], s, dim),
        numbers(a[25], rows), numbers(a[26], rows), numbers(a[27], rows), numbers(a[28], entries),
        table(a[29], pairs * rows, rows), table(a[30], pairs * rows, rows), integers(a[31], pairs * rows),
        table(a[32], whole, whole), table(a[33], whole, whole), integers(a[34], whole),
        numbers(a[35], whole), numbers(a[36], whole),
        numbers(a[37], rows), numbers(a[38], rows), numbers(a[39], dim), numbers(a[40], dim),
        numbers(a[41], 1), numbers(a[42], 1),
    )  # fmt: skip
    return solve_step(ctx, m, head[of.METHOD], head[of.JACOBIAN], head[of.FACTORS], started)


def build() -> bytes:
    """Compile `entry` to an object file."""
    return native.build(entry, [(types.int64, "i64")] * 3, "i64")
