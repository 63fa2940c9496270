"""What Python calls: the steps of a trajectory and the states asked for."""

from integrators.kernel.context import BUDGET, DONE, LAND, SIDE
from integrators.kernel.line.memory import INVARIANTS, Trajectory
from integrators.kernel.line.sample import sample
from integrators.kernel.line.solve import commit, end, evaluate_at, solve
from integrators.kernel.line.varying import first_length, vary, walk
from integrators.kernel.native.attributes import address, view
from integrators.kernel.native.engine import RESET, WALK
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_field
from integrators.kernel.simd.views import doubles, integers

trajectory = view(Trajectory)


@compiled
def advance(m, between, count, times, targets, parts, made, out, budget):
    """Take steps of one length, t = t0 + n h; sample i is at n = targets[i], and parts[i] beyond.

    With `LAND` the steps are counted from sample i - 1. Returns how it ended, after
    ``budget`` steps at the latest.
    """
    h = m.h
    for i in range(made, count):
        m.made = i
        while True:
            t = m.t0 + m.n * h
            if m.n >= targets[i]:
                break
            if budget == 0:
                return BUDGET
            budget -= 1
            outcome = DONE if m.solved else solve(m, t, h)
            if outcome != DONE:
                return outcome
            end(m, h)
            commit(m, h)
            m.n += 1
            m.steps += 1
        outcome = sample(m, between, t, h, parts[i], out + m.dim * i)
        if outcome != DONE:
            return outcome
        if between == LAND:
            m.t0, m.n = times[i], 0
    m.made = count
    if between == SIDE and count > made and parts[count - 1] != 0.0 and not m.solved:
        # Samples inside a step that cannot be solved are worth nothing; the stepper drops them.
        outcome = solve(m, m.t0 + m.n * h, h)
        m.solved = outcome == DONE
        return outcome
    return DONE


@compiled
def reset(m):
    """Take the invariants at the state as what they are to be, and a first step if none is given."""
    m.time[0] = m.t0
    if m.mode == INVARIANTS:
        call_field(m.values, m.time, address(m.y), m.par, address(m.reference))
    if m.tolerance > 0.0 and m.next_length == 0.0:
        evaluate_at(m, m.t0, m.y, 0)
        m.next_length = first_length(m)
    return DONE


@compiled
def entry(what, place, side, between, count, times, targets, parts, made, out, budget):
    """Do what is asked, with the trajectory at an address; see `integrators.kernel.step.entry`."""
    m, t, y = trajectory(place), doubles(times), doubles(out)
    if what == RESET:
        for d in range(m.dim):
            m.y[d] = y[d]
        return reset(m)
    if what == WALK:
        return walk(m, t, y, budget)
    if m.tolerance > 0.0:
        return vary(m, between, count, t, made, y, budget)
    return advance(m, between, count, t, integers(targets), doubles(parts), made, y, budget)
