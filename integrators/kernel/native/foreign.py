"""Fields that are not traced, behind the kernel's ``void(t, stages, par, values)``.

A numba function is wrapped by numba and called from machine code. Any other Python
function is called back, under the interpreter's lock.
"""

import ctypes
from collections.abc import Callable
from time import perf_counter
from typing import Any
from weakref import WeakKeyDictionary, ref

import numpy as np

from integrators.kernel.native import binary, raised
from integrators.kernel.native.field import compile_field
from integrators.kernel.native.stages import ONE_BY_ONE
from problems import targets
from problems.systems.base import System
from problems.systems.opaque import Opaque

_functions: WeakKeyDictionary[Opaque, dict[tuple[int, int], tuple[int, Any]]] = WeakKeyDictionary()
"""The address of each field by lanes, and the function that it is of: as long as its system is there."""


def field_of(
    system: System, quantity: targets.Quantity, lanes: int, stride: int | None = None
) -> binary.Native:
    """Return one of a system's functions for stage memory; see `field.compile_field`.

    Raises
    ------
    problems.errors.InputError
        For another function than the field of a system that is not traced, and a numba function that
        cannot be compiled for arrays of numbers.
    """
    if not isinstance(system, Opaque) or quantity != "field":
        return compile_field(system, quantity, lanes, stride)
    started = perf_counter()
    with binary.lock:  # two of them would leave one thread with the address of what the other throws away
        compiled = _functions.setdefault(system, {})
        apart = stride or lanes
        known = (lanes, apart) in compiled
        if not known:
            compiled[lanes, apart] = (_compiled if system.numba else _called)(system, lanes, apart)
        address, function = compiled[lanes, apart]
    seconds = perf_counter() - started
    return binary.Native(address, ONE_BY_ONE, known, seconds, not system.numba, (system, function))


def _compiled(system: Opaque, lanes: int, stride: int) -> tuple[int, Any]:
    """Return the address of a numba field on stage memory, and the function."""
    import numba
    from numba import types

    carray: Any = numba.carray  # type: ignore[attr-defined]
    f, dim, size = system.f, system.dim, system.n_par
    takes_parameters, in_place = system.takes_parameters, system.in_place
    njit: Any = numba.njit

    # One of these four is compiled: numba chooses no branch by the number of arguments.
    def plain(t, y, par, dy):
        value = f(t, y)
        if len(value) != dim:
            raise ValueError("f does not return dim numbers")
        for d in range(dim):
            dy[d] = value[d]

    def plain_in_place(t, y, par, dy):
        f(t, y, dy)

    def parametric(t, y, par, dy):
        value = f(t, y, par)
        if len(value) != dim:
            raise ValueError("f does not return dim numbers")
        for d in range(dim):
            dy[d] = value[d]

    def parametric_in_place(t, y, par, dy):
        f(t, y, par, dy)

    chosen = ((plain, plain_in_place), (parametric, parametric_in_place))
    inner = njit(chosen[takes_parameters][in_place])

    # Loops, not array expressions: those take seconds to compile.
    def field(t, stages, par, values):
        times = carray(t, (lanes,))
        rows = carray(stages, (dim, stride))
        out = carray(values, (dim, stride))
        numbers = np.empty(size)
        given = carray(par, (size,))
        for i in range(size):
            numbers[i] = given[i]
        for d in range(dim):
            for l in range(lanes):
                out[d, l] = np.nan  # what is left if f raises
        y = np.empty(dim)
        dy = np.empty(dim)
        for l in range(lanes):
            same = l > 0 and times[l] == times[l - 1]
            for d in range(dim):
                same = same and rows[d, l] == rows[d, l - 1]
            if not same:  # idle lanes repeat the last stage
                for d in range(dim):
                    y[d] = rows[d, l]
                    dy[d] = np.nan
                inner(times[l], y, numbers, dy)
            for d in range(dim):
                out[d, l] = dy[d]

    pointer = types.CPointer(types.float64)
    try:
        function = numba.cfunc(types.void(pointer, pointer, pointer, pointer))(field)
    except numba.NumbaError as error:
        raise (system.not_compiled(error) or error) from error
    address: Any = function.address
    return address, function


def _called(system: Opaque, lanes: int, stride: int) -> tuple[int, Any]:
    """Return the address of a callback to a Python field, and the callback."""
    dim, size = system.dim, system.n_par
    owner = ref(system)  # which holds this callback, not the other way round
    line, block, numbers = (ctypes.c_double * n for n in (lanes, dim * stride, size))

    def view(kind: Any, address: int) -> Any:
        return np.frombuffer(kind.from_address(address))

    def field(t: int, stages: int, par: int, values: int) -> None:
        try:
            out = view(block, values).reshape(dim, stride)[:, :lanes]
            out[:] = np.nan
            if raised.kept() is not None:
                return
            times = view(line, t).tolist()
            states = view(block, stages).reshape(dim, stride)[:, :lanes].T.copy()
            given = view(numbers, par).copy() if size else np.empty(0)
            derivatives = np.empty((lanes, dim))
            previous: tuple[Any, ...] = ()
            evaluated = owner()
            assert evaluated is not None  # which the `Native` of this callback holds
            with np.errstate(all="ignore"):
                for time, state, derivative in zip(times, states, derivatives, strict=True):
                    if previous and time == previous[0] and (state == previous[1]).all():
                        derivative[:] = previous[2]  # idle lanes repeat the last stage
                    else:
                        evaluated.evaluate(time, state, given, derivative)
                    previous = time, state, derivative
            out[:] = derivatives.T
        except BaseException as error:  # also Ctrl-C: nothing passes through compiled code
            raised.keep(error)

    kind: Callable[..., Any] = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)
    function: Any = kind(field)
    address = ctypes.cast(function, ctypes.c_void_p).value
    assert address is not None
    return address, function
