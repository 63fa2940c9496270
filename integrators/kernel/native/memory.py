"""Memory that Python and compiled code share, by name.

A subclass of `Memory` declares its slots once, with their types and shapes. Here
they are attributes of an object; in compiled code `integrators.kernel.simd.attributes`
makes them attributes of its address:

    class Orbit(Memory):
        rows = Integer()
        h = Real()
        state = Array(2, "rows")

    orbit = Orbit({"rows": 3})          orbit.h = 0.5           orbit.state[:] = 1.0

    @compiled
    def drift(orbit):                   # machine code: two loads at constant places
        return orbit.h * orbit.state[0]
"""

import ctypes
from collections.abc import Mapping
from math import prod
from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar, Self, overload

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]

LINE = 8  # words in 64 bytes, at a multiple of which every array begins


def aligned(n: int) -> Numbers:
    """Return n zeros at an address that is a multiple of 64."""
    return _from_a_line_on(np.zeros(n + LINE))


def _from_a_line_on(room: Numbers) -> Numbers:
    """Return the part of an array, `LINE` words shorter, that begins at a multiple of 64."""
    start = (-address(room) % 64) // 8
    return room[start : start + room.size - LINE]


def address(array: Any) -> int:
    """Return where an array's numbers begin: ``array.ctypes.data``, mostly in a quarter of the time."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(array))
    except (TypeError, ValueError, BufferError):  # it is read-only, empty or has gaps
        return array.ctypes.data


class Slot:
    """One word of eight bytes: a number, or the address of an array."""

    name: str
    place: int
    """Which word it is."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name


class Number(Slot, property):
    """A slot that holds a number; it is read without a call of Python's."""

    kind: Any
    """Of `ctypes`."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        property.__init__(self, attrgetter(f"numbers.{name}"), self._write)

    def _write(self, memory: "Memory", value: float) -> None:
        raise NotImplementedError


class Integer(Number):
    """A whole number, or the address of a function."""

    kind = ctypes.c_int64

    if TYPE_CHECKING:

        @overload
        def __get__(self, memory: None, owner: type) -> Self: ...
        @overload
        def __get__(self, memory: "Memory", owner: type) -> int: ...
        def __get__(  # type: ignore[override]
            self, memory: "Memory | None", owner: type
        ) -> "Self | int": ...
        def __set__(self, memory: "Memory", value: int) -> None: ...

    def _write(self, memory: "Memory", value: float) -> None:
        memory.words[self.place] = value


class Real(Number):
    """A double."""

    kind = ctypes.c_double

    if TYPE_CHECKING:

        @overload
        def __get__(self, memory: None, owner: type) -> Self: ...
        @overload
        def __get__(self, memory: "Memory", owner: type) -> float: ...
        def __get__(  # type: ignore[override]
            self, memory: "Memory | None", owner: type
        ) -> "Self | float": ...
        def __set__(self, memory: "Memory", value: float) -> None: ...

    def _write(self, memory: "Memory", value: float) -> None:
        memory.reals[self.place] = value


class Array(Slot):
    r"""The address of an array.

    In compiled code ``x[i]`` is one number of it, whatever its shape, and ``x + n`` its part from n on.

    Parameters
    ----------
    *shape : int or str
        Numbers, or names of `Integer` slots; their product is the length. None: the array is
        `Memory.point`\ ed to.
    of : {float, int}
        What it holds.
    """

    def __init__(self, *shape: int | str, of: type = float):
        self.shape, self.of = shape, of

    @overload
    def __get__(self, memory: None, owner: type) -> Self: ...
    @overload
    def __get__(self, memory: "Memory", owner: type) -> Any: ...
    def __get__(self, memory: "Memory | None", owner: type) -> Any:
        if memory is None:
            return self
        # Compiled code may have exchanged it for another.
        if self.name in memory._pointed:
            return memory._pointed[self.name]
        start = (int(memory.words[self.place]) - memory.address) // 8
        found = memory._memory[start : memory._ends[start]]
        return found if self.of is float else found.view(np.int64)


class Table(Array):
    """An `Array` that compiled code sees as numba's own array, with its shape: ``x[i, j]``, ``x.shape``."""


class Memory:
    """Slots, and the arrays that belong to them, in one piece of memory.

    Parameters
    ----------
    numbers : mapping of str to number
        What slots begin with; the shapes of arrays follow from it. The others are 0.
    arrays : mapping of str to ndarray
        Arrays to point to, by their slots' names; not copied.

    Attributes
    ----------
    words, reals : ndarray
        The slots as integers and as doubles: the same memory.
    numbers : ctypes.Structure
        The same by name.
    address : int
        For compiled functions.
    """

    slots: ClassVar[dict[str, Slot]] = {}
    _numbers: ClassVar[Any] = None

    def __init_subclass__(cls) -> None:
        own = {name: slot for name, slot in vars(cls).items() if isinstance(slot, Slot)}
        if twice := sorted(own.keys() & cls.slots.keys()):
            raise TypeError(f"{cls.__name__} declares again what its base has: {', '.join(twice)}.")
        for place, slot in enumerate(own.values(), len(cls.slots)):
            slot.place = place
        cls.slots = {**cls.slots, **own}
        cls._numbers = None

    @classmethod
    def _as_numbers(cls) -> Any:
        """Return the slots as a structure of `ctypes`, whose fields are read at once."""
        if cls._numbers is None:
            fields = [(name, getattr(slot, "kind", ctypes.c_int64)) for name, slot in cls.slots.items()]
            cls._numbers = type(f"{cls.__name__}Numbers", (ctypes.Structure,), {"_fields_": fields})
        return cls._numbers

    def __init__(self, numbers: Mapping[str, float], arrays: Mapping[str, NDArray[Any]]):
        def length(slot: Array) -> int:
            return prod(int(numbers[n]) if isinstance(n, str) else n for n in slot.shape)

        end = -(-len(self.slots) // LINE) * LINE
        self._own: dict[str, tuple[int, int]] = {}  # where an array begins and ends
        self._ends: dict[int, int] = {}  # the same, for all that were ever its own
        for name, slot in self.slots.items():
            if isinstance(slot, Array) and slot.shape and name not in arrays:
                self._own[name] = (end, end + length(slot))
                self._ends[end] = end + length(slot)
                end += -(-max(length(slot), 1) // LINE) * LINE
        self._structure = self._as_numbers()
        self._lies_in(aligned(end))
        for name, (start, _) in self._own.items():
            self.words[self.slots[name].place] = self.address + 8 * start
        for name, value in numbers.items():
            setattr(self, name, value)
        self._find_places()
        self._pointed: dict[str, NDArray[Any]] = {}
        self.point(arrays)

    def _lies_in(self, memory: Numbers) -> None:
        self._memory = memory
        self.reals: Numbers = memory[: len(self.slots)]
        self.words: Integers = self.reals.view(np.int64)
        self.numbers = self._structure.from_buffer(memory)
        self.address: int = ctypes.addressof(self.numbers)

    def copy(self) -> Self:
        """Return memory of its own with the same content, which points to the same arrays."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        other._pointed = self._pointed.copy()
        memory = _from_a_line_on(np.empty(self._memory.size + LINE))
        memory[:] = self._memory
        other._lies_in(memory)
        other.words[self._places] += other.address - self.address
        return other

    def point(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Let slots point to arrays, and keep these alive."""
        for name, array in arrays.items():
            self._pointed[name] = array
            self.words[self.slots[name].place] = address(array)
        if not self._own.keys().isdisjoint(arrays):
            self._own = {name: part for name, part in self._own.items() if name not in arrays}
            self._find_places()

    def _find_places(self) -> None:
        # of the addresses in this memory, which are others in a copy
        self._places = np.array([self.slots[name].place for name in self._own], dtype=np.intp)
