"""How the kernel's functions are compiled: by private parts of numba, or by its public interface.

`private` compiles faster, but what it is made of may be gone from the next numba. A
version that no test has seen is tried on a small function first, and where that fails `public` takes over.
"""

import ctypes
import warnings
from importlib.metadata import version
from typing import Any, cast

from integrators.kernel.native import machine

NEWEST = (0, 68)
"""The newest numba that the tests have run with; see pyproject.toml for the oldest."""

FALLBACK = (
    "numba {version} lacks parts by which the kernel is compiled ({error}): it is compiled by numba's public "
    "interface, which takes longer; `pip install 'numba<{next}'` avoids that"
)
REFUSAL = "numba {version} cannot compile the kernel ({error}): pip install 'numba<{next}'"


def _told(sentence: str, error: BaseException) -> str:
    first = " ".join(str(error).split())[:120]
    return sentence.format(
        version=version("numba"),
        error=f"{type(error).__name__}: {first}",
        next=f"{NEWEST[0]}.{NEWEST[1] + 1}",
    )


def _unseen() -> bool:
    """Whether this numba is newer than those that the tests have run with."""
    return tuple(int(part) for part in version("numba").split(".")[:2]) > NEWEST


def _checked(way: Any) -> Any:
    """Return a way to compile, if it gives the right number for a small function.

    Raises
    ------
    Exception
        Of any type, by whatever that numba lacks.
    """
    from numba import types
    from numba.extending import intrinsic, models, register_model

    class Half(types.Type):
        """A type with an attribute."""

    register_model(Half)(models.OpaqueModel)
    way.attributes(
        Half,
        ["value"],
        lambda kind, name: types.float64,
        lambda context, *_: context.get_constant(types.float64, 0.5),
    )

    @cast(Any, intrinsic)
    def one_half(typing):
        return Half("half")(), lambda context, *_: context.get_dummy_value()

    @way.compiled
    def half(x):
        return x * one_half().value

    @way.compiled
    def summed(n):
        total = 0.0
        for i in range(n):
            total += half(i * 1.0)
        return int(total)

    code = machine.emitted(way.module(summed, (types.int64,)), [(types.int64, "i64")], "i64")
    answer = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(machine.load(code))(9)
    if answer != 18:
        raise ArithmeticError(f"a sum of 18 is {answer}")
    return way


def _chosen() -> Any:
    try:
        from integrators.kernel.native import private

        return _checked(private) if _unseen() else private
    except Exception as error:  # a module, a name or a way to call it is gone
        try:
            from integrators.kernel.native import public

            way = _checked(public)
        except Exception as worse:
            raise ImportError(_told(REFUSAL, worse)) from worse
        warnings.warn(_told(FALLBACK, error), RuntimeWarning, stacklevel=2)
        return way


_way = _chosen()

compiled: Any = _way.compiled
"""Decorate a function of the kernel: numba code that allocates nothing and raises nothing."""

module: Any = _way.module
"""Compile a `compiled` function; return a module of it and all that it calls, and its name there."""

attributes: Any = _way.attributes
"""Give values of a numba type attributes: ``attributes(kind, names, kind_of, read)``.

``kind_of(value, name)`` returns the numba type of one, or ``None``, and ``read(context, builder, kind, value,
name)`` writes the instructions that read it. May be called again with more names.
"""
