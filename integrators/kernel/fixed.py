"""Fixed steps of HBVM(k, s) for any first-order system, one stage after another.

This is the kernel to read: the method's equations in loops, nothing else. The
vector field comes as the address of a C function ``void(double t, double* y,
double* par, double* out)``, so these loops are compiled once for all systems
and kept on disk.

Every component of a sum over stages or coefficients is added in the same
order, and nothing is contracted or reassociated: two bodies that mirror each
other keep doing so to the last bit.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import cfunc, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from problems import System, emit

# How a call of `advance` ended.
DONE, BUDGET, DIVERGED, NOT_FINITE = range(4)

# How states between steps are made.
SIDE, LAND, DENSE = range(3)

# Counters, as indices.
STEPS, ITERATIONS, EVALUATIONS, PARTIAL, RESTARTS = range(5)

MAX_ITERATIONS = 1000
CONVERGED = 1e-16
STAGNATION = 1e-13  # above it, a change that stops decreasing is a failure
PATIENCE, SLOWNESS = 2, 16  # stagnation is 2 + (iterations so far)/16 without a new smallest change
FLOOR = 1e-3  # of the largest size in its group: where rounding of the field may hide a small component
MODES = 12  # P_j(2) grows like 5.8^j: beyond, extrapolation amplifies rounding more than it helps
FARTHEST = 2.0  # no extrapolation farther than this many previous steps


def _typed_call(typingctx: Any, field: Any, t: Any, y: Any, par: Any, out: Any) -> Any:
    """Call the C function at address ``field`` on the data of three contiguous arrays."""
    signature = types.void(types.int64, types.float64, y, par, out)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        double = ir.DoubleType()
        pointer = double.as_pointer()
        function_type = ir.FunctionType(ir.VoidType(), [double, pointer, pointer, pointer])
        function = builder.inttoptr(args[0], function_type.as_pointer())
        data = [
            cgutils.create_struct_proxy(kind)(context, builder, value=value).data
            for kind, value in zip(sig.args[2:], args[2:], strict=True)
        ]
        builder.call(function, [args[1], *data])
        return context.get_dummy_value()

    return signature, codegen


_call: Any = intrinsic(_typed_call)


@njit(cache=True, error_model="numpy", nogil=True)
def _evaluate(field, par, t, h, y, e, integrals, nodes, gamma, stage, values):
    """Set values[l] = f(t + c_l h, y + (e + h sum_j integrals[l, j] gamma[j]))."""
    k, s = integrals.shape
    dim = y.size
    for i in range(k):
        for d in range(dim):
            stage[d] = 0.0
        for j in range(s):
            weight = integrals[i, j]
            for d in range(dim):
                stage[d] += weight * gamma[j, d]
        for d in range(dim):
            stage[d] = y[d] + (e[d] + h * stage[d])
        _call(field, t + nodes[i] * h, stage, par, values[i])


@njit(cache=True, error_model="numpy", nogil=True)
def _project(projection, values, gamma):
    """Set gamma = projection @ values, added in the order of the stages."""
    s, k = projection.shape
    dim = values.shape[1]
    for j in range(s):
        for d in range(dim):
            gamma[j, d] = projection[j, 0] * values[0, d]
        for i in range(1, k):
            weight = projection[j, i]
            for d in range(dim):
                gamma[j, d] += weight * values[i, d]


@njit(cache=True, error_model="numpy", nogil=True)
def _change(h, y, block, group, old, new, size, change, largest):
    """Largest change of h*gamma over the blocks, relative to the block and to its floored size."""
    size[:] = 0.0
    change[:] = 0.0
    largest[:] = 0.0
    s, dim = new.shape
    for d in range(dim):
        top, moved = 0.0, 0.0
        for j in range(s):
            top = max(top, abs(h * new[j, d]))
            difference = abs(h * (new[j, d] - old[j, d]))
            if not difference < np.inf:
                return difference, difference
            moved = max(moved, difference)
        b = block[d]
        size[b] = max(size[b], abs(y[d]) + top)
        change[b] = max(change[b], moved)
    for b in range(size.size):
        largest[group[b]] = max(largest[group[b]], size[b])
    strict, floored = 0.0, 0.0
    for b in range(size.size):
        if change[b] > 0.0:
            strict = max(strict, change[b] / size[b])
            floored = max(floored, change[b] / max(size[b], FLOOR * largest[group[b]]))
    return strict, floored


@njit(cache=True, error_model="numpy", nogil=True)
def _predict(projection, nodes, ratio, previous, values, gamma):
    """Extrapolate the previous step's polynomial to 1 + ratio * c_l and project it."""
    s, k = projection.shape
    modes = min(s, MODES)
    dim = previous.shape[1]
    for i in range(k):
        x = 1.0 + 2.0 * ratio * nodes[i]  # 2c - 1 at c = 1 + ratio * c_i
        before, legendre = 0.0, 1.0
        for d in range(dim):
            values[i, d] = 0.0
        for j in range(modes):
            weight = np.sqrt(2.0 * j + 1.0) * legendre
            for d in range(dim):
                values[i, d] += weight * previous[j, d]
            before, legendre = legendre, ((2 * j + 1) * x * legendre - j * before) / (j + 1)
    _project(projection, values, gamma)


@njit(cache=True, error_model="numpy", nogil=True)
def _iterate(field, par, t, h, y, e, integrals, projection, nodes, block, group, gamma, counters):
    """Iterate gamma <- projection f(...) from the given gamma; return how it ended and the last change."""
    k, s = integrals.shape
    dim = y.size
    stage = np.empty(dim)
    values = np.empty((k, dim))
    new = np.empty((s, dim))
    size = np.empty(group.size)
    change = np.empty(group.size)
    largest = np.empty(group.size)
    best, last, stalled = np.inf, 0.0, 0
    for iteration in range(MAX_ITERATIONS):
        _evaluate(field, par, t, h, y, e, integrals, nodes, gamma, stage, values)
        _project(projection, values, new)
        counters[ITERATIONS] += 1
        counters[EVALUATIONS] += k
        strict, floored = _change(h, y, block, group, gamma, new, size, change, largest)
        gamma[:] = new
        if not strict < np.inf:
            # Growing changes overflow in the end; a NaN out of the blue is the field's own.
            return (DIVERGED if last > 1.0 else NOT_FINITE), strict
        last = strict
        if strict <= CONVERGED:
            return DONE, strict
        if floored < best:
            best, stalled = floored, 0
        else:
            stalled += 1
        if stalled >= PATIENCE + iteration // SLOWNESS and best < STAGNATION:
            return DONE, strict
    return DIVERGED, last


@njit(cache=True, error_model="numpy", nogil=True)
def _solve(
    field, par, t, h, y, e, integrals, projection, nodes, block, group, previous, length, gamma, counters
):
    """Find gamma of the step of length h at t; length is the previous step's (0: there is none)."""
    if length != 0.0 and abs(h / length) <= FARTHEST:
        values = np.empty((nodes.size, y.size))
        _predict(projection, nodes, h / length, previous, values, gamma)
        code, change = _iterate(
            field, par, t, h, y, e, integrals, projection, nodes, block, group, gamma, counters
        )
        if code == DONE:
            return code, change
        counters[RESTARTS] += 1
    gamma[:] = 0.0
    _call(field, t, y, par, gamma[0])
    counters[EVALUATIONS] += 1
    if not np.isfinite(gamma[0]).all():
        return NOT_FINITE, np.nan
    return _iterate(field, par, t, h, y, e, integrals, projection, nodes, block, group, gamma, counters)


@njit(cache=True, error_model="numpy", nogil=True)
def _add(y, e, h, slope):
    """Add h slope to (y, e), exactly but for the rounding of the increment (two-sum)."""
    for d in range(y.size):
        increment = h * slope[d] + e[d]
        total = y[d] + increment
        part = total - y[d]
        e[d] = (y[d] - (total - part)) + (increment - part)
        y[d] = total


@njit(cache=True, error_model="numpy", nogil=True)
def _interpolate(y, e, h, c, gamma, out):
    """Set out = y + h sum_j gamma_j int_0^c P_j, the collocation polynomial inside the step."""
    s, dim = gamma.shape
    out[:] = 0.0
    x = 2.0 * c - 1.0
    before, legendre = 1.0, 1.0  # L_{-1} = 1 makes int_0^c L_0 = (L_1 - L_{-1}) / 2 + 1 come out
    for j in range(s):
        after = ((2 * j + 1) * x * legendre - j * before) / (j + 1)
        weight = c if j == 0 else (after - before) / (2.0 * np.sqrt(2.0 * j + 1.0))
        for d in range(dim):
            out[d] += weight * gamma[j, d]
        before, legendre = legendre, after
    for d in range(dim):
        out[d] = y[d] + (e[d] + h * out[d])


@njit(cache=True, error_model="numpy", nogil=True)
def advance(
    field, par, integrals, projection, nodes, block, group,
    h, t0, n, y, e, previous, length,
    between, times, targets, parts, first, out, budget, counters,
):  # fmt: skip
    """Take own steps, and make the states asked for.

    Parameters
    ----------
    field : int
        Address of the vector field.
    par : ndarray
        Its parameters.
    integrals, projection, nodes : ndarray, shapes (k, s), (s, k), (k,)
        The tables of HBVM(k, s).
    block, group : ndarray of int, shapes (dim,), (blocks,)
        The block of each component, in which changes are measured together,
        and the group of each block, whose largest size is a floor.
    h : float
        Length of a step, negative backwards.
    t0, n : float, int
        The present time is t0 + n h.
    y, e, previous : ndarray, shapes (dim,), (dim,), (s, dim)
        State, its compensation, coefficients of the last step; overwritten.
    length : float
        Length of the last step, 0 if there is none.
    between : int
        `SIDE`, `LAND` or `DENSE`.
    times, targets, parts : ndarray, shape (m,)
        Sample i is at n = targets[i], and parts[i] beyond; `LAND` counts from sample i - 1.
    first : int
        The first sample still to be made.
    out : ndarray, shape (m, dim)
        Samples; overwritten.
    budget : int
        Own steps after which to come back.
    counters : ndarray of int
        Counters; added to.

    Returns
    -------
    code, change, t0, n, length, made
        How it ended, the last relative change, the new t0, n and length, and the samples made.
    """
    dim = y.size
    gamma = np.empty_like(previous)
    partial = np.empty(dim)
    remainder = np.empty(dim)
    solved = False  # whether gamma is the solution of the own step ahead
    for i in range(first, times.size):
        while n < targets[i]:
            if budget == 0:
                return BUDGET, 0.0, t0, n, length, i
            if not solved:
                code, change = _solve(
                    field, par, t0 + n * h, h, y, e, integrals, projection, nodes, block, group,
                    previous, length, gamma, counters,
                )  # fmt: skip
                if code != DONE:
                    return code, change, t0, n, length, i
            solved = False
            _add(y, e, h, gamma[0])
            previous[:] = gamma
            length = h
            n += 1
            budget -= 1
            counters[STEPS] += 1
        part = parts[i]
        if part == 0.0:
            out[i] = y
        elif between == DENSE:
            if not solved:
                code, change = _solve(
                    field, par, t0 + n * h, h, y, e, integrals, projection, nodes, block, group,
                    previous, length, gamma, counters,
                )  # fmt: skip
                if code != DONE:
                    return code, change, t0, n, length, i
                solved = True
            _interpolate(y, e, h, part / h, gamma, out[i])
        else:
            code, change = _solve(
                field, par, t0 + n * h, part, y, e, integrals, projection, nodes, block, group,
                previous, length, gamma, counters,
            )  # fmt: skip
            if code != DONE:
                return code, change, t0, n, length, i
            partial[:] = y
            remainder[:] = e
            _add(partial, remainder, part, gamma[0])
            out[i] = partial
            counters[PARTIAL] += 1
            if between == LAND:
                y[:] = partial
                e[:] = remainder
                previous[:] = gamma
                length = part
        if between == LAND:
            t0, n = times[i], 0
    return DONE, 0.0, t0, n, length, times.size


_fields: dict[str, Any] = {}


def compile_field(system: System) -> tuple[int, bool]:
    """Compile a vector field; return the address of its C function, and whether it came from a cache."""
    key = system.fingerprint
    if key in _fields:
        return _fields[key].address, True
    function = emit.numba(system, "field")
    number = types.CPointer(types.float64)

    def field(t: Any, y: Any, par: Any, out: Any) -> None:
        function(t, y, par, out)

    # Kept for as long as the process lives: it owns the code.
    _fields[key] = cfunc(types.void(types.float64, number, number, number))(field)
    return _fields[key].address, not function.stats.cache_misses


def compile_kernel() -> bool:
    """Compile `advance`, or load it from disk; return whether nothing had to be compiled."""
    misses = sum(advance.stats.cache_misses.values())
    empty, table, index = np.empty(0), np.empty((0, 0)), np.empty(0, dtype=np.int64)
    constant = np.empty((0, 0))
    constant.flags.writeable = False
    nodes = constant.reshape(-1)
    advance(
        0, empty, constant, constant, nodes, index, index,
        1.0, 0.0, 0, empty, empty.copy(), table, 0.0,
        SIDE, empty, index, empty, 0, table, 0, index,
    )  # fmt: skip
    return sum(advance.stats.cache_misses.values()) == misses
