"""States between steps."""

from integrators.kernel.line import layout as at
from integrators.kernel.line.solve import commit, end, interpolate, solve
from integrators.kernel.line.views import compiled


@compiled
def sample(m, between, t, h, part, out):
    """Write the state ``part`` after the last step into ``out``; the step ahead has the length h."""
    y, next_y, count = m.y, m.next_y, m.count
    if part == 0.0:
        for d in range(m.dim):
            out[d] = y[d]
        return at.DONE
    dense = between == at.DENSE
    length = h if dense else part
    if not (dense and count[at.SOLVED]):
        outcome = solve(m, t, length)
        count[at.SOLVED] = dense and outcome == at.DONE
        if outcome != at.DONE:
            return outcome
    if dense:
        interpolate(m, h, part / h, out)
        return at.DONE
    end(m, part)
    count[at.PARTIAL] += 1
    for d in range(m.dim):
        out[d] = next_y[d]
    if between == at.LAND:
        commit(m, part)
    return at.DONE
