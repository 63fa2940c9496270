"""A traced vector field, compiled once behind ``void(t, stages, par, values)``.

The four arguments are addresses: the times of 8 or 16 stages, the stages (rows of
as many doubles), the parameters, and room for the field's values, laid out like
the stages. The user's code runs on all stages at once. Where numba cannot type
it on lanes, it runs on one stage after another behind the same signature.
"""

from typing import Any

from integrators.kernel.native import binary, store
from problems import emit
from problems.systems.base import System

ON_LANES, ONE_BY_ONE = "L", "S"
Arguments = list[tuple[Any, str]]

SOURCES = ("simd", "native")


def compile_field(system: System, quantity: emit.Quantity, lanes: int) -> binary.Native:
    """Compile one of a system's functions for stage memory, or load it.

    Parameters
    ----------
    system : System
        The traced system.
    quantity : str or Function
        ``"field"``, or ``"force"`` for the second-order form, or another function of the system.
    lanes : int
        Stages per call.

    Returns
    -------
    Native
        Its note is `ON_LANES` or `ONE_BY_ONE`.
    """
    source = emit.source(system, quantity, "numba")
    name = store.key("field", source.text, str(lanes), binary.sources(*SOURCES))
    return binary.obtain(name, lambda: build(emit.numba(system, quantity).py_func, lanes))


def build(function: Any, lanes: int) -> tuple[str, bytes]:
    """Compile ``function(t, y, par, out)`` on lanes if that is possible, else stage by stage.

    Raises
    ------
    numba.NumbaError
        If it can be compiled neither way.
    """
    from numba import NumbaError

    try:
        return ON_LANES, build_on_lanes(function, lanes)
    except NumbaError:
        return ONE_BY_ONE, build_one_by_one(function, lanes)


def assembly(system: System, quantity: emit.Quantity, lanes: int) -> str:
    """Return the machine code of a field, as text; the arguments are those of `compile_field`.

    Raises
    ------
    numba.NumbaError
        If it cannot be compiled.
    """
    from numba import NumbaError

    function = emit.numba(system, quantity).py_func
    try:
        return binary.assembly(*on_lanes(function, lanes))
    except NumbaError:
        return binary.assembly(*_one_by_one(function, lanes))


def build_on_lanes(function: Any, lanes: int) -> bytes:
    """Compile ``function(t, y, par, out)`` with t and y[i] as lanes."""
    return binary.build(*on_lanes(function, lanes))


def build_one_by_one(function: Any, lanes: int) -> bytes:
    """Compile a loop over stages that calls ``function`` with scalars."""
    return binary.build(*_one_by_one(function, lanes))


def on_lanes(function: Any, lanes: int, *, par: bool = False) -> tuple[Any, Arguments]:
    """Return ``function(t, y, par, out)`` for numba, and its arguments on lanes for `binary.build`.

    Parameters are the same in all lanes, or with ``par`` rows like the stages.
    """
    from integrators.kernel.native.jit import compiled
    from integrators.kernel.simd import functions  # noqa: F401 -- gives sin, exp, ... a meaning on lanes
    from integrators.kernel.simd.lanes import Lanes
    from integrators.kernel.simd.views import DOUBLES, Rows

    stages = Rows(lanes)
    arguments = [(Lanes(lanes), f"<{lanes} x double>"), (stages, "ptr"), (stages if par else DOUBLES, "ptr")]
    return compiled(function), [*arguments, (stages, "ptr")]


def _one_by_one(function: Any, lanes: int) -> tuple[Any, Arguments]:
    from numba import types

    from integrators.kernel.native.jit import compiled
    from integrators.kernel.simd.views import strided

    scalar = compiled(function)

    def loop(t, stages, par, values):
        for stage in range(lanes):
            time = strided(t, 1)[stage]
            scalar(
                time, strided(stages + 8 * stage, lanes), strided(par, 1), strided(values + 8 * stage, lanes)
            )

    return compiled(loop), [(types.int64, "i64")] * 4
