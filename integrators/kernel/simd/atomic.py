"""Integers that several threads read and write: each of these operations is whole, and seen in order."""

from llvmlite import ir
from numba import types

from integrators.kernel.simd.emit import INTEGER
from integrators.kernel.simd.lanes import intrinsic
from integrators.kernel.simd.views import INTEGERS, element


@intrinsic
def observe(typing, numbers, index):
    """Return an integer; what its writer wrote before is seen too."""

    def generate(context, builder, sig, args):
        numbers, index = args
        return builder.load_atomic(element(builder, numbers, index, 1, INTEGER), "acquire", 8)

    return types.int64(INTEGERS, types.int64), generate


@intrinsic
def increase(typing, numbers, index, value):
    """Add to an integer; who sees the sum sees all that was written before."""

    def generate(context, builder, sig, args):
        numbers, index, value = args
        builder.atomic_rmw("add", element(builder, numbers, index, 1, INTEGER), value, "acq_rel")
        return context.get_dummy_value()

    return types.void(INTEGERS, types.int64, types.int64), generate


@intrinsic
def claim(typing, numbers, index, value):
    """Increase an integer by 1 if it is ``value``; return whether it was."""

    def generate(context, builder, sig, args):
        numbers, index, value = args
        one = builder.add(value, ir.Constant(INTEGER, 1))
        place = element(builder, numbers, index, 1, INTEGER)
        return builder.extract_value(builder.cmpxchg(place, value, one, "acq_rel", "acquire"), 1)

    return types.boolean(INTEGERS, types.int64, types.int64), generate
