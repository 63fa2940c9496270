"""States between steps."""

from integrators.kernel.context import DENSE, DONE, LAND
from integrators.kernel.line.solve import commit, end, interpolate, solve
from integrators.kernel.native.jit import compiled


@compiled
def sample(m, between, t, h, part, out):
    """Write the state ``part`` after the last step into ``out``; the step ahead has the length h."""
    y, next_y = m.y, m.next_y
    if part == 0.0:
        for d in range(m.dim):
            out[d] = y[d]
        return DONE
    dense = between == DENSE
    length = h if dense else part
    if not (dense and m.solved):
        outcome = solve(m, t, length)
        m.solved = dense and outcome == DONE
        if outcome != DONE:
            return outcome
    if dense:
        interpolate(m, h, part / h, out)
        return DONE
    end(m, part)
    m.partial += 1
    for d in range(m.dim):
        out[d] = next_y[d]
    if between == LAND:
        commit(m, part)
    return DONE
