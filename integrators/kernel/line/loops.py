"""What Python calls: the steps of a trajectory and the states asked for."""

from numba import types

from integrators.kernel.line import layout as at
from integrators.kernel.line.sample import sample
from integrators.kernel.line.solve import commit, end, evaluate_at, solve
from integrators.kernel.line.varying import first_length, vary, walk
from integrators.kernel.line.views import address, call, compiled, integers, memory, numbers, table
from integrators.kernel.native import binary as native


@compiled
def advance(m, between, times, targets, parts, made, out, budget):
    """Take steps of one length, t = t0 + n h; sample i is at n = targets[i], and parts[i] beyond.

    With `LAND` the steps are counted from sample i - 1. Returns how it ended, after
    ``budget`` steps at the latest.
    """
    real, count = m.real, m.count
    h = real[at.H]
    for i in range(made, times.size):
        count[at.MADE] = i
        while True:
            t = real[at.T0] + count[at.N] * h
            if count[at.N] >= targets[i]:
                break
            if budget == 0:
                return at.BUDGET
            budget -= 1
            outcome = at.DONE if count[at.SOLVED] else solve(m, t, h)
            if outcome != at.DONE:
                return outcome
            end(m, h)
            commit(m, h)
            count[at.N] += 1
            count[at.STEPS] += 1
        outcome = sample(m, between, t, h, parts[i], out[i])
        if outcome != at.DONE:
            return outcome
        if between == at.LAND:
            real[at.T0], count[at.N] = times[i], 0
    count[at.MADE] = times.size
    if between == at.SIDE and times.size > made and parts[times.size - 1] != 0.0 and not count[at.SOLVED]:
        # Samples inside a step that cannot be solved are worth nothing; the stepper drops them.
        outcome = solve(m, real[at.T0] + count[at.N] * h, h)
        count[at.SOLVED] = outcome == at.DONE
        return outcome
    return at.DONE


@compiled
def reset(m):
    """Take the invariants at the state as what they are to be, and a first step if none is given."""
    m.time[0] = m.real[at.T0]
    if m.mode == at.INVARIANTS:
        call(m.values, address(m.time), address(m.y), address(m.par), address(m.reference))
    if m.real[at.TOLERANCE] > 0.0 and m.real[at.NEXT] == 0.0:
        evaluate_at(m, m.real[at.T0], m.y, 0)
        m.real[at.NEXT] = first_length(m)
    return at.DONE


@compiled
def entry(what, place, between, samples, times, targets, parts, made, out, budget, end_time):
    """Do what is asked, with the trajectory at an address."""
    m = memory(place)
    if what == at.RESET:
        return reset(m)
    asked, states = numbers(times, samples), table(out, samples, m.dim)
    if what == at.WALK:
        return walk(m, asked, states, end_time, budget)
    if what == at.VARY:
        return vary(m, between, asked, made, states, budget)
    return advance(
        m, between, asked, integers(targets, samples), numbers(parts, samples), made, states, budget
    )


def build() -> bytes:
    """Compile `entry` to an object file."""
    return native.build(entry, [*[(types.int64, "i64")] * 10, (types.float64, "double")], "i64")
