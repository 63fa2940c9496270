"""Compiled callbacks that REBOUND calls from its own loop: the watchdog, a counter, forces.

They are C functions made by numba. They are put into the simulation's function
pointers directly: by REBOUND's Python setters each call would pass through a Python
thunk at 0.4 microseconds, a tenth of an IAS15 step; so it costs nothing measurable.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numba
import numpy as np
from numba import carray, types  # pyright: ignore[reportPrivateImportUsage]
from numba.extending import intrinsic
from numpy.typing import NDArray

from integrators.peers import load
from integrators.protocol import Array
from integrators.running import watchdog as rules

FROZEN = 128
"""Steps in a row that leave the time where it is, after which a simulation has stalled."""

RING = 2048
"""Steps of which the times and lengths are kept."""

# Places in a simulation's block of doubles, which REBOUND's `extras` points to.
REASON, EVALUATIONS, LAST, STILL, MARK, MARKED, START, STARTED, END, SEEN, NUMBERS, RECORD = range(12)
BLOCK = RECORD + 2 * RING

# Why the watchdog stopped a simulation.
GOING, STANDS, STALLED, NAN = range(4)


class Block:
    """The memory that the callbacks of one simulation share with us.

    Attributes
    ----------
    values : ndarray, shape (BLOCK,)
        Counters and the ring of (t, dt) of the last steps.
    numbers : ndarray
        What the forces need: parameters, scales c, and room for q and for the forces.
    """

    def __init__(self, numbers: Array) -> None:
        self.values = np.zeros(BLOCK)
        self.numbers = np.ascontiguousarray(numbers)
        self.values.view(np.int64)[NUMBERS] = self.numbers.ctypes.data

    def aim(self, t: float, end: float, steps: int) -> None:
        """Tell the watchdog where the simulation is and where it shall go."""
        self.values[[REASON, STILL]] = 0.0
        self.values[[LAST, MARK, START]] = t
        self.values[END] = end
        self.values[[SEEN, MARKED, STARTED]] = steps

    def history(self, steps: int) -> Array:
        """Return the times and lengths (n, 2) of the last steps, oldest first, after ``steps`` steps."""
        ring = self.values[RECORD:].reshape(RING, 2)
        first = max(0, steps - RING) + 1
        return ring[np.arange(first, steps + 1) % RING].copy()


def _pointer_of(typingctx: Any, address: Any) -> Any:
    """Turn an address (int64) into a pointer."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))

    return types.voidptr(types.int64), codegen


_pointer: Any = intrinsic(_pointer_of)
_makes_no_progress: Any = numba.njit(rules.makes_no_progress)


def _offset(field: str, size: int) -> int:
    return getattr(load("rebound").Simulation, field).offset // size


@cache
def watchdog() -> Any:
    """Return the heartbeat: it records t and dt, and stops a simulation that no longer gets anywhere.

    It stops as `reb_simulation_stop` does, by REBOUND's status "user".
    """
    T, DT, DONE = _offset("t", 8), _offset("dt", 8), _offset("dt_last_done", 8)
    STEPS, EXTRAS, STATUS = _offset("steps_done", 8), _offset("extras", 8), _offset("_status", 4)
    # numba's cache of compiled code sees a change of these, but not of another module's constants.
    constants = rules.STALL_STEPS, rules.STALL_SHARE, rules.SMALL_SHARE, rules.SLOWER

    @numba.cfunc(types.void(types.voidptr), cache=True)
    def watch(simulation: Any) -> None:
        real = carray(simulation, (128,), np.float64)
        whole = carray(simulation, (128,), np.int64)
        block = carray(_pointer(whole[EXTRAS]), (BLOCK,), np.float64)
        steps = whole[STEPS]
        if steps == block[SEEN]:
            return  # REBOUND also calls this before the first step
        block[SEEN] = steps
        t = real[T]
        place = RECORD + 2 * (steps % RING)
        block[place] = t
        block[place + 1] = real[DONE]
        reason = GOING
        if not (np.isfinite(t) and np.isfinite(real[DT])):
            reason = NAN
        if t == block[LAST]:
            block[STILL] += 1.0
            if block[STILL] >= FROZEN:
                reason = STANDS
        else:
            block[STILL] = 0.0
            block[LAST] = t
        if steps - block[MARKED] >= constants[0]:
            way, left = abs(t - block[MARK]), abs(block[END] - block[MARK])
            before = abs(block[MARK] - block[START])
            if _makes_no_progress(way, left, before, block[MARKED] - block[STARTED]):
                reason = STALLED
            block[MARK] = t
            block[MARKED] = steps
        if reason != GOING:
            block[REASON] = reason
            carray(simulation, (256,), np.int32)[STATUS] = 5  # REB_STATUS_USER

    return watch


@cache
def counter() -> Any:
    """Return additional forces of nothing, which count how often REBOUND evaluates the forces."""
    EXTRAS = _offset("extras", 8)

    @numba.cfunc(types.void(types.voidptr), cache=True)
    def count(simulation: Any) -> None:
        block = carray(_pointer(carray(simulation, (128,), np.int64)[EXTRAS]), (BLOCK,), np.float64)
        block[EVALUATIONS] += 1.0

    return count


@cache
def forces(kernel: Any, dof: int, n_par: int) -> Any:
    """Return additional forces q'' = c force(t, q), coordinates in threes to a particle, counting calls.

    Parameters
    ----------
    kernel : numba dispatcher
        ``kernel(t, q, par, out)``: minus the gradient of the potential.
    dof, n_par : int
        Number of coordinates and of parameters.

    Returns
    -------
    numba C function
        Its `Block` holds as numbers: parameters (n_par), c (dof), room for q (dof) and
        for the force (dof).
    """
    T, EXTRAS, PARTICLES = _offset("t", 8), _offset("extras", 8), _offset("_particles", 8)
    stride = particle_size()
    length = n_par + 3 * dof
    particles = -(-dof // 3)

    @numba.cfunc(types.void(types.voidptr))
    def force(simulation: Any) -> None:
        whole = carray(simulation, (128,), np.int64)
        block = carray(_pointer(whole[EXTRAS]), (BLOCK,), np.float64)
        block[EVALUATIONS] += 1.0
        address = carray(_pointer(whole[EXTRAS]), (BLOCK,), np.int64)[NUMBERS]
        numbers = carray(_pointer(address), (length,), np.float64)
        par, scale = numbers[:n_par], numbers[n_par : n_par + dof]
        q, out = numbers[n_par + dof : n_par + 2 * dof], numbers[n_par + 2 * dof :]
        body = carray(_pointer(whole[PARTICLES]), (particles, stride), np.float64)
        if dof <= 3:  # the coordinates of one particle lie side by side: nothing to copy
            acceleration = body[0, 6 : 6 + dof]
            kernel(carray(simulation, (128,), np.float64)[T], body[0, :dof], par, acceleration)
            for i in range(dof):
                acceleration[i] *= scale[i]
            return
        for i in range(dof):
            q[i] = body[i // 3, i % 3]
        kernel(carray(simulation, (128,), np.float64)[T], q, par, out)
        for i in range(dof):
            body[i // 3, 6 + i % 3] = scale[i] * out[i]

    return force


def particle_size() -> int:
    """Return the size of a REBOUND particle in doubles: x y z vx vy vz ax ay az m ..."""
    return ctypes.sizeof(load("rebound").Particle) // 8


def attach(simulation: Any, block: Block, *, heartbeat: Any = None, force: Any = None) -> None:
    """Put compiled callbacks into a simulation's function pointers; the caller keeps all of them alive."""
    simulation.extras = block.values.ctypes.data
    simulation._heartbeat = _function(simulation, 0 if heartbeat is None else heartbeat.address)
    simulation._additional_forces = _function(simulation, 0 if force is None else force.address)


@contextmanager
def detached(simulation: Any) -> Iterator[None]:
    """Take a simulation's callbacks away for a while: with them REBOUND warns when it copies."""
    # What ctypes returns for a field is a view of it, so the addresses are what to keep.
    names = "_heartbeat", "_additional_forces"
    held = [ctypes.cast(getattr(simulation, name), ctypes.c_void_p).value for name in names]
    for name in names:
        setattr(simulation, name, _function(simulation, 0))
    try:
        yield
    finally:
        for name, address in zip(names, held, strict=True):
            setattr(simulation, name, _function(simulation, address or 0))


def _function(simulation: Any, address: int) -> Any:
    """Return the C function at an address, as REBOUND's function pointers want it; 0 is none."""
    kind = dict(type(simulation)._fields_)["_heartbeat"]
    return kind(address) if address else kind()


def particles(simulation: Any) -> NDArray[np.float64]:
    """Return a view (N, size) of a simulation's particles; valid until particles are added."""
    n, size = int(simulation.N), particle_size()
    first = ctypes.cast(simulation._particles, ctypes.POINTER(ctypes.c_double))
    return np.ctypeslib.as_array(first, (n, size))
