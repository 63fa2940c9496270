"""A traced vector field, compiled once behind ``void(t, stages, par, values)``.

The four arguments are addresses: the times of 8 or 16 stages, the stages (rows of
as many doubles), the parameters, and room for the field's values, laid out like
the stages. The user's code runs on all stages at once. Where numba cannot type
it on lanes, it runs on one stage after another behind the same signature.
"""

from integrators.kernel.native import binary, stages, store
from problems import targets
from problems.systems.base import System

BUILT_BY = stages.__name__


def compile_field(
    system: System, quantity: targets.Quantity, lanes: int, stride: int | None = None
) -> binary.Native:
    """Compile one of a system's functions for stage memory, or load it.

    Parameters
    ----------
    system : System
        The traced system.
    quantity : str or Function
        ``"field"``, or ``"force"`` for the second-order form, or another function of the system.
    lanes : int
        Stages per call.
    stride : int, optional
        Stages that lie side by side; by default no others.

    Returns
    -------
    Native
        Its note is `ON_LANES` or `ONE_BY_ONE`.
    """
    source = targets.source(system, quantity, "numba")
    name = store.key("field", source.text, f"{lanes} {stride or lanes}", binary.sources(BUILT_BY))
    return binary.obtain(name, lambda: stages.build(targets.numba(system, quantity).py_func, lanes, stride))


def compile_part(system: System, quantity: targets.Quantity, lanes: int) -> binary.Native | None:
    """Compile what sets a part of the rows, ``void(t, stages, par, values, first, last)``; ``None``: none is.

    All ``lanes`` stages lie side by side.
    """
    made = targets.numba_of_part(system, quantity)
    if made is None:
        return None
    text, function = made
    name = store.key("part", text, str(lanes), binary.sources(BUILT_BY))
    return binary.obtain(name, lambda: (stages.ON_LANES, stages.build_part(function, lanes)))
