"""The C function of the implicit solver."""

from integrators.kernel.context import Context
from integrators.kernel.implicit.memory import Corrections
from integrators.kernel.implicit.newton import solve_step
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled

context, workspace = view(Context), view(Corrections)


@compiled
def entry(ctx, memory, started):
    """Solve the step of the context at an address with the workspace at another; see `solve_step`."""
    return solve_step(context(ctx), workspace(memory), started)
