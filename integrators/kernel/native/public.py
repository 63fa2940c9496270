"""The kernel's functions compiled by numba's public interface, where `private` does not work.

numba optimizes and links each function by itself, which takes longer, and gives the text
of what it has made (``inspect_llvm``). The machine code is made of that text as of what `private` lowers.
"""

from collections.abc import Iterable
from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba import njit
from numba.extending import intrinsic, overload_attribute


def compiled(function: Any) -> Any:
    """Decorate a function of the kernel; see `integrators.kernel.native.jit`."""
    return njit(error_model="numpy")(function)


@cache
def _attribute(kind: Any, name: str, kind_of: Any, read: Any) -> None:
    @intrinsic
    def get(typing, memory):
        def generate(context, builder, sig, args):
            return read(context, builder, sig.args[0], args[0], name)

        result = kind_of(memory, name)
        return None if result is None else (result(memory), generate)

    overload_attribute(kind, name)(lambda memory: lambda memory: get(memory))  # type: ignore[call-arg]


def attributes(kind: Any, names: Iterable[str], kind_of: Any, read: Any) -> None:
    """Give values attributes in compiled code, each a function; see `integrators.kernel.native.jit`."""
    for name in names:
        _attribute(kind, name, kind_of, read)


def module(function: Any, kinds: tuple[Any, ...]) -> tuple[Any, str]:
    """Compile a `compiled` function; return a module of it and all that it calls, and its name there.

    Raises
    ------
    numba.NumbaError
        If it cannot be compiled for these types.
    """
    function.compile(kinds)
    parsed = llvm.parse_assembly(function.inspect_llvm(kinds))
    names = {function_.name for function_ in parsed.functions if not function_.is_declaration}
    (name,) = (function_ for function_ in names if f"cfunc.{function_}" in names)
    return parsed, name
