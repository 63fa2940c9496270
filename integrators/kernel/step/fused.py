"""Whole fixed-point iterations for systems with a few rows, around the traced field.

In a small system an iteration waits for its own results: the stages are stored and loaded
by the field, its values are stored and loaded by the product. Compiled together, one
after another, iterations keep stages and values in registers, as far as there are enough: the sums of three
rows of sixteen stages would take 48 registers of AVX2, which has 16, and are made one after another. The
operations and the order of each sum are those of `fixed_point.evaluate`, `fixed_point.product8` and
`fixed_point.product16`, hence the bits are (``tests/integrators/kernel/step/test_fused.py``).
"""

from typing import Any

from llvmlite import ir

from integrators.kernel.context import EVALUATE, Context
from integrators.kernel.native import machine
from integrators.kernel.simd.emit import (
    ALIGNMENT,
    DOUBLE,
    INTEGER,
    WIDTH,
    Chains,
    indices,
    larger_of,
    largest_of,
    llvm_call,
    splat,
    text_of,
    vector,
)

ITERATIONS = ir.FunctionType(ir.VoidType(), [INTEGER] * 3)

ROWS = 4
"""Components of a stage up to which whole iterations are compiled with the field."""


def iterations(inner: str, lanes: int, rows: int, by_columns: bool) -> str:
    """Return LLVM's text of ``void(context, count, after)`` around a compiled field, factors in the matrix.

    It does ``count`` iterations. With ``after`` = `MEASURE`, for one iteration or more, `Scratch.old_stages`
    then holds the stages before the last one, and `Solver.change` the largest change relative to the size of
    its block; with `EVALUATE`, the field's values are then those at the newest stages.

    Parameters
    ----------
    inner : str
        Name of the field, on lanes.
    lanes : int
        All stages.
    rows : int
        Components of a stage.
    by_columns : bool
        Whether products go through the matrix once, with the sums of all rows in registers; else eight
        stages of a row after another, with their values in memory.
    """
    module = ir.Module()
    pointer = DOUBLE.as_pointer()
    whole, eight = vector(lanes), vector(WIDTH)
    status = ir.FunctionType(
        ir.IntType(32), [pointer.as_pointer(), pointer.as_pointer(), whole, pointer, pointer, pointer]
    )
    field = ir.Function(module, status, inner)
    function = ir.Function(module, ITERATIONS, machine.ENTRY)
    context, count, after = function.args
    b: Any = ir.IRBuilder(function.append_basic_block("start"))
    words = b.inttoptr(context, INTEGER.as_pointer())

    def number(value: int) -> Any:
        return ir.Constant(INTEGER, value)

    def word(slot: str) -> Any:
        return b.gep(words, [number(Context.word_of[slot])])

    def array(slot: str) -> Any:
        return b.inttoptr(b.load(word(slot)), pointer)

    def pointer_to(base: Any, index: int, kind: Any) -> Any:
        return b.bitcast(b.gep(base, [number(index)]), kind.as_pointer())

    def get(base: Any, index: int, kind: Any) -> Any:
        return b.load(pointer_to(base, index, kind), align=None if kind == DOUBLE else ALIGNMENT)

    def put(value: Any, base: Any, index: int) -> None:
        b.store(value, pointer_to(base, index, value.type), align=ALIGNMENT)

    def lane(value: Any, j: int) -> Any:
        """Return lane j in eight lanes."""
        return b.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), indices(*[j] * WIDTH))

    def joined(halves: list[Any]) -> Any:
        if len(halves) == 1:
            return halves[0]
        return b.shuffle_vector(*halves, indices(*range(lanes)))

    room = ir.ArrayType(whole, rows)
    stages, values = b.alloca(room), b.alloca(room)
    stages.align = values.align = ALIGNMENT
    result, exception = b.alloca(pointer), b.alloca(pointer)
    q, other, f = array("stages"), array("scratch.old_stages"), array("values")
    par = array("par")
    times = get(array("times"), 0, whole)
    state, base, scale = array("scratch.row_state"), array("scratch.base"), array("blocks.weights")
    parts = range(lanes // WIDTH)
    starts = [[get(base, lanes * d + WIDTH * part, eight) for part in parts] for d in range(rows)]
    states = [splat(b, get(state, d, DOUBLE), WIDTH) for d in range(rows)]
    first = [get(q, lanes * d, whole) for d in range(rows)]
    zero, unity = number(0), number(1)
    evaluates = b.icmp_signed("==", after, number(EVALUATE))
    entry, loop, product, end, evaluated = (
        b.block,
        *(function.append_basic_block(name) for name in ("loop", "product", "end", "evaluated")),
    )
    b.branch(loop)

    b.position_at_end(loop)
    left = b.phi(INTEGER)
    old = [b.phi(whole) for _ in range(rows)]
    at_stages, at_values = b.bitcast(stages, pointer), b.bitcast(values, pointer)
    for d in range(rows):
        put(old[d], at_stages, lanes * d)
    b.call(field, [result, exception, times, at_stages, par, at_values])
    vectors = [get(at_values, lanes * d, whole) for d in range(rows)]
    b.cbranch(b.icmp_signed(">", left, zero), product, evaluated)

    b.position_at_end(product)
    matrix = b.inttoptr(b.load_atomic(word("tables.matrix"), "monotonic", 8), pointer)

    def all_at_once() -> list[Any]:
        """Return the stages, column by column, for few of these to be in registers at a time."""
        sums = {(d, part): Chains(b, lanes, starts[d][part]) for d in range(rows) for part in parts}
        for j in range(lanes):
            columns = [get(matrix, lanes * WIDTH * part + WIDTH * j, eight) for part in parts]
            for d in range(rows):
                factor = lane(vectors[d], j)
                for part in parts:
                    sums[d, part].add(columns[part], factor)
        return [joined([b.fadd(states[d], sums[d, part].total()) for part in parts]) for d in range(rows)]

    def eight_by_eight() -> list[Any]:
        """Return the stages, made in a loop that has nothing but their sum in registers."""
        inside, done = (function.append_basic_block(name) for name in ("eight", "done"))
        before = b.block
        b.branch(inside)
        b.position_at_end(inside)
        i = b.phi(INTEGER)
        i.add_incoming(zero, before)
        d, part = b.udiv(i, number(len(parts))), b.urem(i, number(len(parts)))
        columns = b.gep(matrix, [b.mul(part, number(lanes * WIDTH))])
        factors = b.gep(at_values, [b.mul(d, number(lanes))])
        start = b.mul(i, number(WIDTH))
        total = Chains(b, lanes, get(b.gep(base, [start]), 0, eight))
        for j in range(lanes):
            total.add(get(columns, WIDTH * j, eight), splat(b, get(factors, j, DOUBLE), WIDTH))
        level = splat(b, b.load(b.gep(state, [d])), WIDTH)
        put(b.fadd(level, total.total()), b.gep(at_stages, [start]), 0)
        after_it = b.add(i, unity)
        i.add_incoming(after_it, b.block)
        b.cbranch(b.icmp_unsigned("<", after_it, number(rows * len(parts))), inside, done)
        b.position_at_end(done)
        return [get(at_stages, lanes * d, whole) for d in range(rows)]

    new = all_at_once() if by_columns else eight_by_eight()
    fewer = b.sub(left, unity)
    left.add_incoming(count, entry)
    left.add_incoming(fewer, b.block)
    for d in range(rows):
        old[d].add_incoming(first[d], entry)
        old[d].add_incoming(new[d], b.block)
    b.cbranch(b.or_(b.icmp_signed(">", fewer, zero), evaluates), loop, end)

    b.position_at_end(evaluated)
    for d in range(rows):
        put(old[d], q, lanes * d)
        put(vectors[d], f, lanes * d)
    b.ret_void()

    b.position_at_end(end)
    for d in range(rows):
        put(new[d], q, lanes * d)
        put(vectors[d], f, lanes * d)
    with b.if_then(b.icmp_signed("!=", after, zero)):
        top = ir.Constant(eight, [0.0] * WIDTH)
        for d in range(rows):
            put(old[d], other, lanes * d)
            size = splat(b, get(scale, d, DOUBLE), WIDTH)
            for part in parts:
                chosen = indices(*range(WIDTH * part, WIDTH * (part + 1)))
                moved = b.fsub(
                    b.shuffle_vector(new[d], new[d], chosen), b.shuffle_vector(old[d], old[d], chosen)
                )
                top = larger_of(b, top, b.fmul(llvm_call(b, "fabs", moved), size))
        b.store(largest_of(b, top), b.bitcast(word("solver.change"), pointer))
    b.ret_void()
    return text_of(module)
