"""A traced vector field, compiled once behind ``void(t, stages, par, values)``.

The four arguments are addresses: the times of 8 or 16 stages, the stages (rows of
as many doubles), the parameters, and room for the field's values, laid out like
the stages. The user's code runs on all stages at once. Where numba cannot type
it on lanes, it runs on one stage after another behind the same signature.
"""

from collections.abc import Callable

from integrators.kernel.native import binary, stages, store
from integrators.kernel.native.stages import ON_LANES
from problems import targets
from problems.systems.base import System

BUILT_BY = stages.__name__


def compile_field(system: System, quantity: targets.Quantity, lanes: int) -> binary.Native:
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
    source = targets.source(system, quantity, "numba")
    name = store.key("field", source.text, str(lanes), binary.sources(BUILT_BY))
    return binary.obtain(name, lambda: stages.build(targets.numba(system, quantity).py_func, lanes))


def compile_around(
    system: System, quantity: targets.Quantity, lanes: int, module: str, form: object,
    written: Callable[[str], str], *, par: bool = False,
) -> binary.Native:  # fmt: skip
    """Compile LLVM's text that is written around one of a system's functions on lanes, or load it.

    Parameters
    ----------
    system, quantity
        As for `compile_field`.
    lanes : int
        Stages, or trajectories, per call of the function.
    module : str
        Where ``written`` is from.
    form : object
        What else it depends on, as its ``repr`` tells.
    written : callable
        Given the name of the compiled function, returns the text of an `ENTRY` that calls it.
    par : bool
        Whether parameters differ from lane to lane.

    Raises
    ------
    numba.NumbaError
        If the function cannot be compiled on lanes.
    """
    source = targets.source(system, quantity, "numba")
    name = store.key("around", source.text, str(lanes), repr(form), binary.sources(BUILT_BY, module))

    def make() -> tuple[str, bytes]:
        function, arguments = stages.on_lanes(targets.numba(system, quantity).py_func, lanes, par=par)
        return ON_LANES, binary.build(function, arguments, around=written)

    return binary.obtain(name, make)


def assembly(system: System, quantity: targets.Quantity, lanes: int) -> str:
    """Return the machine code of a field, as text; the arguments are those of `compile_field`.

    Raises
    ------
    numba.NumbaError
        If it cannot be compiled.
    """
    return stages.assembly(targets.numba(system, quantity).py_func, lanes)
