"""What steps in lanes are written with: rows in memory or in registers, loops, conditions."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir

from integrators.kernel.native import machine
from integrators.kernel.native.memory import Slot
from integrators.kernel.simd.emit import ALIGNMENT, DOUBLE, INTEGER, splat, vector
from integrators.kernel.simd.values import Value

Index = Any  # a number, or LLVM's


class Writer:
    """Writes a function ``void(memory, count)`` whose numbers are rows, with one trajectory in each lane.

    Parameters
    ----------
    inner : str
        Name of the compiled field in the same module.
    lanes : int
        Length of a row.
    unrolled : bool
        Whether loops are unrolled; rows then are in registers, as far as there are any.
    """

    def __init__(self, inner: str, lanes: int, *, unrolled: bool):
        self.lanes, self.unrolled = lanes, unrolled
        self.kind, self.bits = vector(lanes), ir.VectorType(ir.IntType(1), lanes)
        module = ir.Module()
        pointer = DOUBLE.as_pointer()
        arguments = [pointer.as_pointer(), pointer.as_pointer(), self.kind, pointer, pointer, pointer]
        self.field = ir.Function(module, ir.FunctionType(ir.IntType(32), arguments), inner)
        function = ir.Function(module, ir.FunctionType(ir.VoidType(), [INTEGER] * 2), machine.ENTRY)
        self.module, self.function = module, function
        self.b: Any = ir.IRBuilder(function.append_basic_block("start"))
        self.words = self.b.inttoptr(function.args[0], INTEGER.as_pointer())

    def word(self, slot: Slot, kind: Any = INTEGER) -> Any:
        """Return where a slot is."""
        pointer = self.b.gep(self.words, [ir.Constant(INTEGER, slot.index)])
        return self.b.bitcast(pointer, kind.as_pointer())

    def array(self, slot: Slot) -> Any:
        """Return the address in a slot."""
        return self.b.inttoptr(self.b.load(self.word(slot)), DOUBLE.as_pointer())

    def table(self, slot: Slot) -> Any:
        """Return the address in a slot; its numbers are loaded anew in every iteration: registers are few."""
        address = self.b.load_atomic(self.word(slot), "monotonic", 8)
        return self.b.inttoptr(address, DOUBLE.as_pointer())

    def room(self, slot: Slot, count: int) -> Any:
        """Return where ``count`` rows are during steps: in registers if possible, or in the slot's memory."""
        if not self.unrolled:
            return self.array(slot)
        memory = self.b.alloca(ir.ArrayType(self.kind, count))
        memory.align = ALIGNMENT
        return self.b.bitcast(memory, DOUBLE.as_pointer())

    def variable(self, kind: Any, value: Any) -> Any:
        """Return where a variable is."""
        with self.b.goto_entry_block():
            memory = self.b.alloca(kind)
        self.b.store(value, memory)
        return memory

    def load(self, variable: Any) -> Value:
        """Load a variable that is a row."""
        return Value(self.b, self.b.load(variable))

    def pointer_to(self, base: Any, index: Index, kind: Any) -> Any:
        """Return the address of item ``index`` of an array of ``kind``."""
        index = ir.Constant(INTEGER, index) if isinstance(index, int) else index
        return self.b.gep(self.b.bitcast(base, kind.as_pointer()), [index])

    def get(self, base: Any, index: Index = 0) -> Value:
        """Load a row."""
        return Value(self.b, self.b.load(self.pointer_to(base, index, self.kind), align=ALIGNMENT))

    def put(self, value: Value, base: Any, index: Index = 0) -> None:
        """Store a row."""
        self.b.store(value.value, self.pointer_to(base, index, self.kind), align=ALIGNMENT)

    def number(self, base: Any, index: Index) -> Value:
        """Return a double of memory in all lanes."""
        return Value(self.b, splat(self.b, self.b.load(self.pointer_to(base, index, DOUBLE)), self.lanes))

    def at(self, i: Index, width: int, d: Index = 0) -> Index:
        """Return ``i * width + d``."""
        if isinstance(i, int) and isinstance(d, int):
            return i * width + d
        i, d = (ir.Constant(INTEGER, x) if isinstance(x, int) else x for x in (i, d))
        return self.b.add(self.b.mul(i, ir.Constant(INTEGER, width)), d)

    def each(self, count: int, body: Callable[[Any], None]) -> None:
        """Write ``body(i)`` for so many i, one after another or as a loop."""
        if self.unrolled or count == 1:
            for i in range(count):
                body(i)
            return
        before = self.b.block
        loop = self.function.append_basic_block("loop")
        self.b.branch(loop)
        self.b.position_at_end(loop)
        i = self.b.phi(INTEGER)
        i.add_incoming(ir.Constant(INTEGER, 0), before)
        body(i)
        following = self.b.add(i, ir.Constant(INTEGER, 1))
        i.add_incoming(following, self.b.block)
        end = self.function.append_basic_block("end")
        self.b.cbranch(self.b.icmp_signed("<", following, ir.Constant(INTEGER, count)), loop, end)
        self.b.position_at_end(end)

    def any(self, mask: Any) -> Any:
        """Return whether a mask holds in any lane."""
        bits = self.b.bitcast(mask, ir.IntType(self.lanes))
        return self.b.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))
