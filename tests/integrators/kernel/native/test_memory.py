"""Memory by name: the same words for Python and compiled code, in parts too."""

import ctypes

import numpy as np
import pytest

from integrators.kernel.native.memory import Array, Integer, Memory, Part, Real, Within


class Inner(Part):
    rate = Real()
    count = Integer()
    sizes = Array("count")
    rows = Array(2, "rows", kind=int)  # of the memory: the part has no such number


class Outer(Memory):
    rows = Integer()
    inner = Within(Inner)
    last = Real()


class Longer(Outer):
    more = Integer()


@pytest.fixture
def memory():
    return Longer({"rows": 3, "inner.count": 5, "inner.rate": 0.5, "more": 7}, {})


def test_slots_of_a_part_lie_between_those_of_its_memory(memory):
    assert Longer.word_of == {
        "rows": 0, "last": 5, "more": 6,
        "inner.rate": 1, "inner.count": 2, "inner.sizes": 3, "inner.rows": 4,
    }  # fmt: skip
    assert (memory.inner.rate, memory.reals[1], memory.inner.address) == (0.5, 0.5, memory.address + 8)
    assert (memory.inner.sizes.size, memory.inner.rows.size, memory.inner.rows.dtype) == (5, 6, np.int64)


def test_a_copy_has_parts_of_its_own(memory):
    memory.inner.sizes[:] = 2.0
    other = memory.copy()
    other.inner.rate, other.inner.sizes[0] = 0.25, 3.0
    assert (memory.inner.rate, memory.inner.sizes[0], other.more) == (0.5, 2.0, 7)
    assert other.inner.sizes.tolist() == [3.0, 2.0, 2.0, 2.0, 2.0]


def test_an_array_that_a_part_points_to_is_not_copied(memory):
    table = np.arange(4.0)
    memory.point({"inner.sizes": table})
    memory.inner.sizes[1] = 9.0
    assert table[1] == 9.0
    assert memory.copy().inner.sizes is table


def test_compiled_code_reads_and_writes_a_part(memory):
    from numba import types

    from integrators.kernel.native import machine
    from integrators.kernel.native.attributes import view
    from integrators.kernel.native.jit import compiled, module

    at = view(Longer)

    @compiled
    def grow(inner):
        inner.rate = 2.0 * inner.rate
        inner.sizes[4] = inner.rate

    @compiled
    def entry(place):
        here = at(place)
        grow(here.inner)
        return here.inner.count + here.more

    code = machine.emitted(module(entry, (types.int64,)), [(types.int64, "i64")], "i64")
    call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(machine.load(code))
    assert call(memory.address) == 12
    assert (memory.inner.rate, memory.inner.sizes[4]) == (1.0, 1.0)
