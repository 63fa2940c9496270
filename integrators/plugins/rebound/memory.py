"""REBOUND's memory seen from compiled code: the particles' columns, and the state of our integrator."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, njit, types  # pyright: ignore[reportPrivateImportUsage]
from numba.extending import intrinsic

from integrators.plugins.rebound import layout as at

# Functions that compiled code calls; `integrators.plugins.rebound` has given LLVM their addresses.
_tables = types.ExternalFunction("hbvm_rebound_tables", types.int64(types.int64, types.int64))
_calloc = types.ExternalFunction("calloc", types.int64(types.int64, types.int64))
_free = types.ExternalFunction("free", types.void(types.int64))

compiled: Any = njit(  # pyright: ignore[reportCallIssue]
    error_model="numpy", no_cpython_wrapper=True
)


def _pointer_of(typingctx: Any, address: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))

    return types.voidptr(types.int64), codegen


def _fused(typingctx: Any, x: Any, y: Any, z: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(ir.DoubleType(), [ir.DoubleType()] * 3)
        return builder.call(builder.module.declare_intrinsic("llvm.fma", [ir.DoubleType()], kind), arguments)

    return types.float64(types.float64, types.float64, types.float64), codegen


_pointer: Any = intrinsic(_pointer_of)
"""``_pointer(address)``: an address (int64) as a pointer."""
fma: Any = intrinsic(_fused)
"""``fma(x, y, z)``: x y + z, rounded once."""


@compiled
def reals(address, count):
    """Return ``count`` doubles at an address."""
    return carray(_pointer(address), (count,), np.float64)


@compiled
def words(address, count):
    """Return ``count`` words of eight bytes at an address."""
    return carray(_pointer(address), (count,), np.int64)


@compiled
def small(address, count):
    """Return ``count`` words of four bytes at an address."""
    return carray(_pointer(address), (count,), np.int32)


@compiled
def matrix(address, rows, columns):
    """Return a matrix of doubles at an address."""
    return carray(_pointer(address), (rows, columns), np.float64)


@compiled
def free(state):
    """Free a state."""
    number = words(state, at.WORDS)
    for slot in (at.REST, at.FORCES, at.WORK):
        _free(number[slot])
    _free(state)


@compiled
def added(simulation):
    """Take note that a particle was added: the forces of the step before are of other particles."""
    state = words(simulation, at.SIMULATION)[at.STATE]
    if state != 0:
        reals(state, at.WORDS)[at.LENGTH] = 0.0


@compiled
def removed(simulation, index):
    """Take note that a particle will be removed: what is left of the rounding is by particle too."""
    state = words(simulation, at.SIMULATION)[at.STATE]
    if state != 0:
        reals(state, at.WORDS)[at.LENGTH] = 0.0
        number = words(state, at.WORDS)
        _free(number[at.REST])
        number[at.REST] = 0
        number[at.REST_COUNT] = 0


@compiled
def ready(state, n):
    """Provide tables and memory for n coordinates; return the address of the tables, 0 if there are none."""
    number = words(state, at.WORDS)
    k = number[at.K]
    if number[at.TABLES] == 0 or number[at.TABLES_K] != k or number[at.TABLES_S] != number[at.S]:
        number[at.TABLES] = _tables(k, number[at.S])
        number[at.TABLES_K], number[at.TABLES_S] = k, number[at.S]
    if number[at.TABLES] == 0:
        return 0
    for slot, counter, length in (
        (at.REST, at.REST_COUNT, 2 * n),
        (at.FORCES, at.FORCES_COUNT, k * n),
        (at.WORK, at.WORK_COUNT, 4 * (k + 1) * n + k),
    ):
        if number[counter] != length:
            _free(number[slot])
            number[slot] = _calloc(length, 8)
            number[counter] = length
            if slot == at.FORCES:
                reals(state, at.WORDS)[at.LENGTH] = 0.0
    return number[at.TABLES]


@compiled
def _bodies(simulation, slot, count):
    """Return a view of a simulation's particles of one kind."""
    return matrix(words(simulation, at.SIMULATION)[slot], count, at.STRIDE)


@compiled
def scatter(simulation, column, values):
    """Put values of all coordinates into three columns of the particles, then of the variational ones."""
    number = words(simulation, at.SIMULATION)
    start = 0
    for slot, count in ((at.PARTICLES, number[at.COUNT]), (at.VARIATIONAL, number[at.VARIATIONS])):
        particles = _bodies(simulation, slot, count)
        for i in range(count):
            for d in range(3):
                particles[i, column + d] = values[start + 3 * i + d]
        start += 3 * count


@compiled
def gather(simulation, column, values):
    """Get values of all coordinates from three columns of the particles, then of the variational ones."""
    number = words(simulation, at.SIMULATION)
    start = 0
    for slot, count in ((at.PARTICLES, number[at.COUNT]), (at.VARIATIONAL, number[at.VARIATIONS])):
        particles = _bodies(simulation, slot, count)
        for i in range(count):
            for d in range(3):
                values[start + 3 * i + d] = particles[i, column + d]
        start += 3 * count
