"""Memory by name: the same words for Python and compiled code, in parts too."""

import ctypes
import gc
import weakref

import numpy as np
import pytest

import problems
from integrators import HBVM, Event, Gauss, LineIntegral, integrate, integrate_many
from integrators.kernel.native.memory import (
    Array,
    Backward,
    Integer,
    Memory,
    Part,
    Pointer,
    Pointers,
    Real,
    Within,
    address_of,
)


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


class Thing:
    """What has an address, and something to be told of its end by."""

    calls_back = False

    def __init__(self, address):
        self.address = address


class Pointing(Memory):
    code = Pointer()
    several = Pointers()
    above = Backward()


def alive(thing):
    """Return what tells whether a thing is there, which is given away here."""
    return weakref.ref(thing)


def test_what_a_memory_points_to_lives_as_long_as_the_memory():
    memory = Pointing({}, {})
    memory.code, memory.several = Thing(64), [Thing(128), None, np.ones(3)]
    code, first = alive(memory.pointed[0]), alive(memory.pointed[1][0])
    assert (memory.code, memory.several.addresses[:2].tolist()) == (64, [128, 0])
    copy = memory.copy()
    memory.code, memory.several = None, []
    assert code() is not None
    assert first() is not None
    assert (copy.code, copy.several.addresses[0]) == (64, 128)
    del copy
    gc.collect()
    assert code() is None
    assert first() is None


def test_an_address_without_its_owner_is_refused():
    memory = Pointing({}, {})
    with pytest.raises(AttributeError):
        memory.code = 64
    with pytest.raises(AttributeError):
        memory.several = [64]


def test_a_memory_does_not_keep_the_one_that_keeps_it():
    outer, inner = Pointing({}, {}), Pointing({}, {})
    outer.code, inner.above = inner, outer
    assert (outer.code, inner.above) == (inner.address, outer.address)
    kept = alive(outer)
    del outer, inner
    assert kept() is None  # without a collection of circles


def test_a_memory_knows_whether_something_that_it_points_to_calls_python_back():
    memory, caller = Pointing({}, {}), Thing(64)
    assert not memory.calls_back
    caller.calls_back = True
    memory.several = [Thing(8), caller]
    assert memory.calls_back
    outer = Pointing({}, {})
    outer.code = memory
    assert outer.calls_back
    outer.code = None
    assert not outer.calls_back


BOUNCE = Event(lambda q: q[0], then=lambda y: [y[0], y[1], -y[2], y[3]])
METHODS = {
    "events": (
        HBVM(k=4, s=2, h=0.1),
        {"events": BOUNCE},
    ),
    "vectors": (HBVM(max_step=0.5), {"variations": ["y0"]}),
    "Newton": (HBVM(k=4, s=2, h=0.1, solver="newton"), {"variations": ["y0"]}),
    "line integral": (LineIntegral(k=8, s=4, h=0.1, invariants=["energy"]), {}),
    "projected": (HBVM(tol=1e-8, projection="energy"), {}),
    "reversible": (Gauss(s=6, tol=1e-9, steps="reversible"), {}),
    "lanes": (HBVM(), {"events": Event(lambda q: q[0])}),
    "lanes of fixed steps": (HBVM(k=4, s=2, h=0.1), {}),
}


@pytest.mark.parametrize("name", METHODS)
def test_every_address_in_a_memory_is_that_of_something_that_it_holds(name, monkeypatch):
    memories, made = [], Memory.__init__

    def watched(memory, *arguments):
        made(memory, *arguments)
        memories.append(memory)

    monkeypatch.setattr(Memory, "__init__", watched)
    method, given = METHODS[name]
    problem = problems.load("henon_heiles")
    if "lanes" in name:
        integrate_many(problem, method, starts=[problem.y0] * 9, times=[1.0], **given)
    else:
        integrate(problem, method, [1.0], **given)
    seen = 0
    for memory in memories:
        for slot_name, slot in memory._all.items():
            word = memory.word_of[slot_name]
            if not isinstance(slot, Pointer) or not memory.words[word]:
                continue
            owner = memory.pointed[word]
            owner = owner() if isinstance(owner, weakref.ref) else owner
            # a search in lanes is turned from one lane to the next
            if owner is not None and not (name == "lanes" and slot_name in ("own", "partial")):
                assert memory.words[word] == address_of(owner), slot_name
                seen += 1
    pointing = [m for m in memories if any(isinstance(slot, Pointer) for slot in m._all.values())]
    assert seen >= len(pointing) > 0
