"""Calls of other C functions from compiled code."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def _call(builder: Any, arguments: Any) -> Any:
    word = ir.IntType(64)
    kind = ir.FunctionType(word, [word] * (len(arguments) - 1))
    return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])


def _ask(typingctx: Any, function: Any, what: Any, which: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _call(builder, arguments)

    return types.int64(*[types.int64] * 3), codegen


def _call_solver(typingctx: Any, function: Any, ctx: Any, memory: Any, started: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _call(builder, arguments)

    return types.int64(*[types.int64] * 4), codegen


ask: Any = intrinsic(_ask)
"""``ask(function, what, which)``: call ``int64(int64, int64)`` at an address."""
call_solver: Any = intrinsic(_call_solver)
"""``call_solver(function, context, memory, started)``: call ``int64(int64, int64, int64)`` at an address."""
