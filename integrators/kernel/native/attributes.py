"""Slots of a `Memory` as attributes in compiled code: ``ctx.h``, ``ctx.solver.rate``, ``ctx.stages[i]``."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import lower_setattr_generic

from integrators.kernel.native import jit
from integrators.kernel.native.memory import Integer, Memory, Part, Real, Table
from integrators.kernel.simd.emit import INTEGER
from integrators.kernel.simd.lanes import intrinsic, represent
from integrators.kernel.simd.views import DOUBLES, INTEGERS


class MemoryType(types.Type):
    """The address of a `Memory` of one class, or of a `Part`."""

    def __init__(self, declared: type[Memory | Part]):
        self.declared = declared
        super().__init__(name=f"Memory({declared.__module__}.{declared.__qualname__})")


represent(MemoryType, lambda kind: INTEGER.as_pointer())


def _kind(slot: Any) -> Any:
    """Return the numba type of a slot."""
    if isinstance(slot, Integer):
        return types.int64
    if isinstance(slot, Real):
        return types.float64
    return DOUBLES if slot.dtype is float else INTEGERS


def _kind_of(memory: Any, name: str) -> Any:
    """Return the numba type of an attribute, or ``None``."""
    if (part := memory.declared.part_of.get(name)) is not None:
        return MemoryType(part.declared)
    slot = memory.declared.slots.get(name)
    return None if slot is None else _kind(slot)


def _word(context: Any, builder: Any, memory: Any, slot: Any, kind: Any) -> Any:
    """Return where a slot is, as a pointer to what it holds."""
    pointer = builder.gep(memory, [ir.Constant(INTEGER, slot.index)])
    return builder.bitcast(pointer, context.get_value_type(kind).as_pointer())


def _read(context, builder, typ, value, attr):
    if attr in typ.declared.part_of:
        return builder.gep(value, [ir.Constant(INTEGER, typ.declared.part_of[attr].index)])
    slot = typ.declared.slots[attr]
    kind = _kind(slot)
    held = builder.load(_word(context, builder, value, slot, kind))
    if isinstance(slot, Table):
        held.set_metadata("invariant.load", builder.module.add_metadata([]))
    return held


@lower_setattr_generic(MemoryType)
def _set(context, builder, sig, args, attr):
    slot = sig.args[0].declared.slots[attr]
    builder.store(args[1], _word(context, builder, args[0], slot, _kind(slot)))


@intrinsic(prefer_literal=True)
def load_anew(typing, memory, name):
    """Return an array of a memory or part by its name (a literal), for a loop to load its numbers anew.

    It would else keep them in registers, which are few, or beside these on the stack.
    """
    if not isinstance(name, types.StringLiteral):
        return None
    slot = memory.declared.slots[name.literal_value]

    def generate(context, builder, sig, args):
        word = builder.gep(args[0], [ir.Constant(INTEGER, slot.index)])
        address = builder.load_atomic(word, "monotonic", 8)
        return builder.inttoptr(address, context.get_value_type(_kind(slot)))

    return _kind(slot)(memory, name), generate


@intrinsic
def address_of(typing, memory):
    """Return the address of a memory."""
    return types.int64(memory), lambda context, builder, sig, args: builder.ptrtoint(args[0], INTEGER)


def _names(declared: type[Memory | Part]) -> set[str]:
    """Return the names of all that a memory holds, and its parts."""
    parts = declared.part_of
    return {*declared.slots, *parts}.union(*(_names(part.declared) for part in parts.values()))


def view(declared: type[Memory]) -> Any:
    """Return what makes of an address (intp), in compiled code, a memory of that class."""
    kind = MemoryType(declared)
    jit.attributes(MemoryType, _names(declared), _kind_of, _read)

    @intrinsic
    def at(typing, address):
        def generate(context, builder, sig, args):
            return builder.inttoptr(args[0], INTEGER.as_pointer())

        return kind(types.intp), generate

    return at
