"""The kernel's functions compiled by numba's public interface, where `private` does not work.

numba optimizes and links each function by itself, which takes longer, and gives the text
of what it has made (``inspect_llvm``). The machine code is made of that text as of what `private` lowers.
"""

import re
from typing import Any

import llvmlite.binding as llvm
from numba import njit
from numba.extending import register_jitable

COUNTING = ("NRT_incref", "NRT_decref")
"""Reference counts. The kernel's arrays are views of memory that Python owns: there is nothing to count."""


def compiled(function: Any) -> Any:
    """Decorate a function of the kernel; see `integrators.kernel.native.jit`."""
    return njit(error_model="numpy")(function)


def for_both_widths(function: Any) -> Any:
    """Decorate a rule; see `integrators.kernel.native.jit`."""
    return register_jitable(error_model="numpy")(function)


def module(function: Any, kinds: tuple[Any, ...]) -> tuple[Any, str]:
    """Compile a `compiled` function; return a module of it and all that it calls, and its name there.

    Raises
    ------
    numba.core.errors.NumbaError
        If it cannot be compiled for these types.
    """
    function.compile(kinds)
    parsed = llvm.parse_assembly(function.inspect_llvm(kinds))
    names = {function_.name for function_ in parsed.functions if not function_.is_declaration}
    (name,) = (function_ for function_ in names if f"cfunc.{function_}" in names)
    return _uncounted(parsed), name


def _uncounted(parsed: Any) -> Any:
    """Return a module whose reference counts are nobody's: it needs nothing of numba when it is loaded."""
    text = str(parsed)
    for name in COUNTING:
        text = re.sub(
            rf"(?ms)^define [^\n]*@{name}\(.*?^\}}\n", f"define void @{name}(ptr %0) {{ ret void }}\n", text
        )
        text = re.sub(
            rf"(?m)^declare [^\n]*@{name}\(.*$", f"define void @{name}(ptr %0) {{ ret void }}", text
        )
    return llvm.parse_assembly(text)
