"""A numba value of K doubles: code that looks scalar runs on all stages at once.

``Lanes(K)`` is LLVM's ``<K x double>``. On a machine whose vectors are shorter
LLVM splits it, so K = 8 and K = 16 are correct everywhere and merely fastest
where a vector holds eight doubles. Every operator is one IEEE operation per
lane in the order written: nothing is contracted or reordered, because the
symmetry of a problem may hang on the last bit. The one fused operation,
`fma`, is explicit and meant for the linear algebra, not for vector fields.

A vector field reads and writes them through the views of `integrators.kernel.simd.views`.
"""

import math
import operator
from typing import Any, cast

from llvmlite import ir
from numba import extending, types
from numba.core.typing import templates
from numba.core.typing.templates import AbstractTemplate, signature
from numba.extending import models, overload, register_model

# What numba makes of a decorated function has another signature than the function.
intrinsic = cast(Any, extending.intrinsic)
infer_global = cast(Any, templates.infer_global)
lower_builtin = cast(Any, extending.lower_builtin)

DOUBLE = ir.DoubleType()
ALIGNMENT = 64


class Lanes(types.Type):
    """K doubles side by side."""

    def __init__(self, count: int):
        self.count = count
        super().__init__(name=f"Lanes({count})")


class Mask(types.Type):
    """The outcome of comparing `Lanes`: K booleans side by side."""

    def __init__(self, count: int):
        self.count = count
        super().__init__(name=f"Mask({count})")


def vector(count: int) -> ir.VectorType:
    """Return LLVM's type of ``count`` doubles."""
    return ir.VectorType(DOUBLE, count)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any):
        super().__init__(manager, kind, vector(kind.count))


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any):
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), kind.count))


# --- values in and out of vectors ---------------------------------------------------------------


def splat(builder: Any, scalar: Any, count: int) -> Any:
    """Return ``scalar`` in every lane."""
    one = builder.insert_element(
        ir.Constant(vector(count), ir.Undefined), scalar, ir.Constant(ir.IntType(32), 0)
    )
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), count), [0] * count)
    return builder.shuffle_vector(one, ir.Constant(vector(count), ir.Undefined), zeros)


def _count(*kinds: Any) -> int | None:
    """Return the number of lanes if all of ``kinds`` are lanes of one width or numbers, and one is lanes."""
    counts = {kind.count for kind in kinds if isinstance(kind, Lanes)}
    rest = [kind for kind in kinds if not isinstance(kind, Lanes)]
    if len(counts) != 1 or not all(isinstance(kind, types.Number) for kind in rest):
        return None
    return counts.pop()


def arguments_for(kinds: Any) -> list[Any]:
    """Lanes stay lanes; every other number is converted to a double before it is spread."""
    return [kind if isinstance(kind, Lanes) else types.float64 for kind in kinds]


def spread_to(builder: Any, kinds: Any, values: Any, count: int) -> list[Any]:
    """Return values of these kinds as lanes: numbers in all of them."""
    return [
        v if isinstance(kind, Lanes) else splat(builder, v, count)
        for kind, v in zip(kinds, values, strict=True)
    ]


def register(function: Any, arity: int, result: Any, emit: Any) -> None:
    """Give ``function`` a meaning on lanes: its typing, and one lowering per mixture with scalars."""

    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            count = None if kws or len(args) != arity else _count(*args)
            return None if count is None else signature(result(count), *arguments_for(args))

    infer_global(function)(Template)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        count = _count(*sig.args)
        assert count is not None
        return emit(builder, *spread_to(builder, sig.args, args, count))

    mixtures = [[Lanes]] if arity == 1 else [[Lanes, Lanes], [Lanes, types.Float], [types.Float, Lanes]]
    for kinds in mixtures:
        lower_builtin(function, *kinds)(lower)


def llvm_call(builder: Any, name: str, *values: Any) -> Any:
    """Call LLVM's intrinsic of that name on numbers of 64 bits or vectors of them."""
    kind = values[0].type
    count = f"v{kind.count}" if isinstance(kind, ir.VectorType) else ""
    item = kind.element if count else kind
    full = f"llvm.{name}.{count}{'f' if item == DOUBLE else 'i'}64"
    function = builder.module.globals.get(full)
    if function is None:
        function = ir.Function(builder.module, ir.FunctionType(kind, [kind] * len(values)), full)
    return builder.call(function, values)


def intrinsic_call(name: str) -> Any:
    """Return what emits LLVM's intrinsic of that name, for `register`."""
    return lambda builder, *values: llvm_call(builder, name, *values)


def _compare(symbol: str) -> Any:
    def emit(builder: Any, x: Any, y: Any) -> Any:
        compare = builder.fcmp_unordered if symbol == "!=" else builder.fcmp_ordered
        return compare(symbol, x, y)

    return emit


def _pick(symbol: str) -> Any:
    """Python's ``min``/``max``: the first argument unless the second is strictly smaller/larger."""

    def emit(builder: Any, x: Any, y: Any) -> Any:
        return builder.select(builder.fcmp_ordered(symbol, y, x), y, x)

    return emit


for _operator, _in_place, _name in (
    (operator.add, operator.iadd, "fadd"),
    (operator.sub, operator.isub, "fsub"),
    (operator.mul, operator.imul, "fmul"),
    (operator.truediv, operator.itruediv, "fdiv"),
):
    for _function in (_operator, _in_place):
        register(_function, 2, Lanes, lambda b, x, y, name=_name: getattr(b, name)(x, y))
for _operator, _symbol in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
    (operator.ne, "!="),
):
    register(_operator, 2, Mask, _compare(_symbol))
register(operator.neg, 1, Lanes, lambda b, x: b.fneg(x))
register(operator.pos, 1, Lanes, lambda b, x: x)
register(min, 2, Lanes, _pick("<"))
register(max, 2, Lanes, _pick(">"))
for _function, _name in (
    (math.sqrt, "sqrt"),
    (abs, "fabs"),
    (math.fabs, "fabs"),
    (math.copysign, "copysign"),
):
    register(_function, 2 if _name == "copysign" else 1, Lanes, intrinsic_call(_name))


def _register_mask(function: Any, arity: int, emit: Any) -> None:
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if kws or len(args) != arity or not all(isinstance(kind, Mask) for kind in args):
                return None
            return signature(args[0], *args) if len(set(args)) == 1 else None

    infer_global(function)(Template)
    lower_builtin(function, *[Mask] * arity)(lambda context, builder, sig, args: emit(builder, *args))


_register_mask(operator.and_, 2, lambda b, x, y: b.and_(x, y))
_register_mask(operator.or_, 2, lambda b, x, y: b.or_(x, y))
_register_mask(operator.xor, 2, lambda b, x, y: b.xor(x, y))
_register_mask(operator.invert, 1, lambda b, x: b.not_(x))


@overload(operator.pow)
def _power(base, exponent):
    """Integer powers by repeated squaring, from the lowest bit of the exponent up."""
    if not isinstance(base, Lanes) or not isinstance(exponent, types.Integer):
        return None

    def power(base, exponent):
        result = base * 0.0 + 1.0
        square = base
        rest = abs(exponent)
        first = True
        while rest > 0:
            if rest & 1:
                result = square if first else result * square
                first = False
            square = square * square
            rest >>= 1
        return 1.0 / result if exponent < 0 else result

    return power


# --- explicit operations --------------------------------------------------------------------------


def fma(x: Any, y: Any, z: Any) -> Any:
    """Return ``x * y + z`` rounded once; numba code only."""
    raise NotImplementedError("fma exists in compiled code only.")


def select(mask: Any, x: Any, y: Any) -> Any:
    """Return ``x`` where ``mask`` holds, else ``y``; numba code only."""
    raise NotImplementedError("select exists in compiled code only.")


@overload(fma)
def _fma(x, y, z):
    if all(isinstance(kind, types.Float) for kind in (x, y, z)):
        return lambda x, y, z: _fma_scalars(x, y, z)
    if _count(x, y, z) is not None:
        return lambda x, y, z: _fma_lanes(x, y, z)
    return None


@intrinsic
def _fma_scalars(typing, x, y, z):
    def generate(context, builder, sig, args):
        return llvm_call(builder, "fma", *args)

    return signature(types.float64, types.float64, types.float64, types.float64), generate


@intrinsic
def _fma_lanes(typing, x, y, z):
    count = _count(x, y, z)
    assert count is not None

    def generate(context, builder, sig, args):
        return llvm_call(builder, "fma", *spread_to(builder, sig.args, args, count))

    return signature(Lanes(count), *arguments_for((x, y, z))), generate


@overload(select)
def _select(mask, x, y):
    return (lambda mask, x, y: _select_lanes(mask, x, y)) if isinstance(mask, Mask) else None


@intrinsic
def _select_lanes(typing, mask, x, y):
    def generate(context, builder, sig, args):
        first, second = spread_to(builder, sig.args[1:], args[1:], mask.count)
        return builder.select(args[0], first, second)

    return signature(Lanes(mask.count), mask, *arguments_for((x, y))), generate
