"""Functions of a state behind ``void(t, stages, par, values)``: on all stages at once, or one by one."""

from typing import Any

from integrators.kernel.native import binary

ON_LANES, ONE_BY_ONE = "L", "S"
Arguments = list[tuple[Any, str]]


def build(function: Any, lanes: int, stride: int | None = None) -> tuple[str, bytes]:
    """Compile ``function(t, y, par, out)`` on lanes if that is possible, else stage by stage.

    Rows are ``stride`` numbers apart, by default as many as there are lanes.

    Raises
    ------
    numba.NumbaError
        If it can be compiled neither way.
    """
    from numba import NumbaError

    try:
        return ON_LANES, build_on_lanes(function, lanes, stride)
    except NumbaError:
        return ONE_BY_ONE, build_one_by_one(function, lanes, stride)


def build_on_lanes(function: Any, lanes: int, stride: int | None = None) -> bytes:
    """Compile ``function(t, y, par, out)`` with t and y[i] as lanes."""
    return binary.build(*on_lanes(function, lanes, stride))


def build_part(function: Any, lanes: int) -> bytes:
    """Compile ``function(t, y, par, out, first, last)`` with t and y[i] as lanes, and two integers."""
    from numba import types

    compiled, arguments = on_lanes(function, lanes)
    return binary.build(compiled, [*arguments, (types.int64, "i64"), (types.int64, "i64")])


def build_one_by_one(function: Any, lanes: int, stride: int | None = None) -> bytes:
    """Compile a loop over stages that calls ``function`` with scalars."""
    return binary.build(*_one_by_one(function, lanes, stride))


def on_lanes(
    function: Any, lanes: int, stride: int | None = None, *, par: bool = False
) -> tuple[Any, Arguments]:
    """Return ``function(t, y, par, out)`` for numba, and its arguments on lanes for `binary.build`.

    Parameters are the same in all lanes, or with ``par`` rows like the stages.
    """
    from integrators.kernel.native import functions  # noqa: F401 -- gives sin, exp, ... a meaning on lanes
    from integrators.kernel.native.jit import compiled
    from integrators.kernel.simd.lanes import Lanes
    from integrators.kernel.simd.views import DOUBLES, Rows

    stages = Rows(lanes, stride)
    arguments = [(Lanes(lanes), f"<{lanes} x double>"), (stages, "ptr"), (stages if par else DOUBLES, "ptr")]
    return compiled(function), [*arguments, (stages, "ptr")]


def _one_by_one(function: Any, lanes: int, stride: int | None = None) -> tuple[Any, Arguments]:
    from numba import types

    from integrators.kernel.native.jit import compiled
    from integrators.kernel.simd.views import strided

    scalar, apart = compiled(function), stride or lanes

    def loop(t, stages, par, values):
        for stage in range(lanes):
            time = strided(t, 1)[stage]
            scalar(
                time,
                strided(stages + 8 * stage, apart),
                strided(par, 1),
                strided(values + 8 * stage, apart),
            )

    return compiled(loop), [(types.int64, "i64")] * 4
