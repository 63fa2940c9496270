"""Memory that Python and compiled code share, by name.

A subclass of `Memory` declares its slots once, with their types and shapes. Here
they are attributes of an object; in compiled code `integrators.kernel.native.attributes`
makes them attributes of its address:

    class Orbit(Memory):
        rows = Integer()
        h = Real()
        state = Array(2, "rows")

    orbit = Orbit({"rows": 3})          orbit.h = 0.5           orbit.state[:] = 1.0

    @compiled
    def drift(orbit):                   # machine code: two loads at constant places
        return orbit.h * orbit.state[0]

The addresses of other things are no numbers that somebody has to keep valid: an `Array` that is pointed to, a
`Pointer` and `Pointers` are set to the things themselves, which then live as long as the memory does.

Slots of one idea make a `Part`, which a memory has among its own as ``solver = Within(Solver)``:
``orbit.solver.rate`` is a number at a constant place too, and what is called with ``orbit.solver`` reads
nothing else.
"""

import ctypes
from collections.abc import Mapping, Sequence
from math import prod
from operator import attrgetter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, Self, TypeVar, overload
from weakref import ref

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


class Addressed(Protocol):
    """What compiled code finds by an address: a `Memory`, machine code, a function that it calls back."""

    @property
    def address(self) -> int: ...


def address_of(owner: "Addressed | NDArray[Any] | None") -> int:
    """Return the address that a slot holds of something; 0 of ``None``."""
    if owner is None:
        return 0
    return address(owner) if isinstance(owner, np.ndarray) else owner.address


class Pointed(dict[int, Any]):
    """What a memory points to, by the word that holds its address: it lives as long as the memory."""

    calls_back = False
    """Whether any of it calls Python back; it is complete when it is pointed to."""

    def hold(self, word: int, owner: Any) -> None:
        """Keep what a word holds the address of, instead of what was there before."""
        before, self[word] = self.get(word), owner
        if self.calls_back or getattr(owner, "calls_back", False) or getattr(before, "calls_back", False):
            self.calls_back = any(getattr(each, "calls_back", False) for each in self.values())

    def become(self, other: "Pointed") -> None:
        """Hold what another holds."""
        self.clear()
        self.update(other)
        self.calls_back = other.calls_back


class Slot:
    """One word of eight bytes: a number, or the address of an array."""

    name: str
    index: int
    """Which word it is of what declares it."""
    lasting = False
    """Whether what comes later depends on what it holds; see `Memory.lasting`."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name


class Number(Slot, property):
    """A slot that holds a number; it is read without a call of Python's."""

    kind: Any
    """Of `ctypes`."""

    def __init__(self, *, lasting: bool = False):
        self.lasting = lasting

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        property.__init__(self, attrgetter(f"numbers.{name}"), self._write)

    def _write(self, memory: "_Slots", value: float) -> None:
        raise NotImplementedError


class Integer(Number):
    """A whole number."""

    kind = ctypes.c_int64

    if TYPE_CHECKING:

        @overload
        def __get__(self, memory: None, owner: type) -> Self: ...
        @overload
        def __get__(self, memory: "_Slots", owner: type) -> int: ...
        def __get__(  # type: ignore[override]
            self, memory: "_Slots | None", owner: type
        ) -> "Self | int": ...
        def __set__(self, memory: "_Slots", value: int) -> None: ...

    def _write(self, memory: "_Slots", value: float) -> None:
        setattr(memory.numbers, self.name, int(value))


class Real(Number):
    """A double."""

    kind = ctypes.c_double

    if TYPE_CHECKING:

        @overload
        def __get__(self, memory: None, owner: type) -> Self: ...
        @overload
        def __get__(self, memory: "_Slots", owner: type) -> float: ...
        def __get__(  # type: ignore[override]
            self, memory: "_Slots | None", owner: type
        ) -> "Self | float": ...
        def __set__(self, memory: "_Slots", value: float) -> None: ...

    def _write(self, memory: "_Slots", value: float) -> None:
        setattr(memory.numbers, self.name, value)


class Pointer(Integer):
    """The address of something, which lives as long as the memory.

    It is set to the thing itself, or to ``None``; read, here and in compiled code, it is the address or 0.
    """

    if TYPE_CHECKING:

        def __set__(  # type: ignore[override]
            self, memory: "_Slots", value: Addressed | NDArray[Any] | None
        ) -> None: ...

    def _write(self, memory: "_Slots", value: Any) -> None:
        setattr(memory.numbers, self.name, address_of(value))
        memory.pointed.hold(memory._first + self.index, value)


class Backward(Pointer):
    """The address of the memory that holds this one and outlives it: to hold it too would make a circle."""

    def _write(self, memory: "_Slots", value: Any) -> None:
        setattr(memory.numbers, self.name, value.address)
        memory.pointed.hold(memory._first + self.index, ref(value))


class Array(Slot):
    r"""The address of an array.

    In compiled code ``x[i]`` is one number of it, whatever its shape, and ``x + n`` its part from n on.

    Parameters
    ----------
    *shape : int or str
        Numbers, or names of `Integer` slots, of the same part or of the memory; their product is the length.
        None: the array is `Memory.point`\ ed to.
    kind : {float, int}
        What it holds.
    lasting : bool
        Whether what comes later depends on that.
    """

    def __init__(self, *shape: int | str, kind: type = float, lasting: bool = False):
        self.shape, self.dtype, self.lasting = shape, kind, lasting

    @overload
    def __get__(self, memory: None, owner: type) -> Self: ...
    @overload
    def __get__(self, memory: "_Slots", owner: type) -> Any: ...
    def __get__(self, memory: "_Slots | None", owner: type) -> Any:
        if memory is None:
            return self
        if (pointed := memory.pointed.get(memory._first + self.index)) is not None:
            return pointed
        # Compiled code may have exchanged it for another.
        start = memory._first + (getattr(memory.numbers, self.name) - memory.address) // 8
        words = memory._memory[start : memory._ends[start]]
        return words if self.dtype is float else words.view(np.int64)


class Pointers(Array):
    """The address of an array of addresses of things, all of which live as long as the memory.

    It is set to a sequence of the things themselves, in which ``None`` has the address 0.
    """

    def __init__(self) -> None:
        super().__init__(kind=int)

    if TYPE_CHECKING:

        @overload
        def __get__(self, memory: None, owner: type) -> Self: ...
        @overload
        def __get__(self, memory: "_Slots", owner: type) -> "Sequence[Addressed | NDArray[Any] | None]": ...
        def __get__(self, memory: "_Slots | None", owner: type) -> Any: ...

    def __set__(self, memory: "_Slots", value: "Sequence[Addressed | NDArray[Any] | None]") -> None:
        addresses = np.array([address_of(each) for each in value], dtype=np.int64)
        setattr(memory.numbers, self.name, address(addresses))
        memory.pointed.hold(memory._first + self.index, Several(tuple(value), addresses))


class Several(tuple[Any, ...]):
    """Things that a memory points to by one array of their addresses."""

    addresses: Integers

    def __new__(cls, things: tuple[Any, ...], addresses: Integers) -> Self:
        self = super().__new__(cls, things)
        self.addresses = addresses
        return self

    @property
    def calls_back(self) -> bool:
        """Whether any of them calls Python back; see `Memory.calls_back`."""
        return any(getattr(thing, "calls_back", False) for thing in self)


class Table(Array):
    """An `Array` that stays where it is: its address is loaded before a loop, not after each store in it."""


Declared = TypeVar("Declared", bound="Part")


class Within(Generic[Declared]):
    """Where a memory has a part."""

    name: str
    index: int

    def __init__(self, declared: type[Declared]):
        self.declared = declared

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, memory: None, owner: type) -> type[Declared]: ...
    @overload
    def __get__(self, memory: "Memory", owner: type) -> Declared: ...
    def __get__(self, memory: "Memory | None", owner: type) -> Any:
        if memory is None:
            return self.declared
        view = vars(memory)[self.name] = self.declared(memory, self)  # what is looked up the next time
        return view


class _Slots:
    """What declares slots and parts, in the order in which their words lie."""

    slots: ClassVar[dict[str, Slot]] = {}
    part_of: ClassVar[dict[str, "Within[Any]"]] = {}
    _size: ClassVar[int] = 0
    """How many words these are."""
    _structure: ClassVar[Any]

    _first = 0  # which word of the memory is the first of these
    pointed: Pointed  # what it points to, and keeps alive
    _memory: Numbers
    _ends: dict[int, int]
    address: int
    numbers: Any

    def __init_subclass__(cls) -> None:
        own = {name: slot for name, slot in vars(cls).items() if isinstance(slot, Slot | Within)}
        if twice := sorted(own.keys() & (cls.slots.keys() | cls.part_of.keys())):
            raise TypeError(f"{cls.__name__} declares again what its base has: {', '.join(twice)}.")
        slots, parts, fields = dict(cls.slots), dict(cls.part_of), []
        for name, slot in own.items():
            slot.index = cls._size
            if isinstance(slot, Slot):
                slots[name] = slot
                cls._size += 1
                fields.append((name, getattr(slot, "kind", ctypes.c_int64)))
            else:
                parts[name] = slot
                cls._size += slot.declared._size
                fields.append((name, slot.declared._structure))
        cls.slots, cls.part_of = slots, parts
        base = getattr(cls, "_structure", ctypes.Structure)
        # whose fields are read at once
        cls._structure = type(f"{cls.__name__}Numbers", (base,), {"_fields_": fields})


class Part(_Slots):
    """Slots of one idea, which lie side by side in a `Memory`."""

    def __init__(self, memory: "Memory", within: "Within[Any]"):
        self._first = within.index
        self.numbers = getattr(memory.numbers, within.name)
        self.address = memory.address + 8 * within.index
        self._memory, self._ends, self.pointed = memory._memory, memory._ends, memory.pointed


class Memory(_Slots):
    """Slots, and the arrays that belong to them, in one piece of memory.

    Slots of parts are named like ``"solver.rate"``.

    Parameters
    ----------
    numbers : mapping of str to number
        What slots begin with; the shapes of arrays follow from it. The others are 0.
    arrays : mapping of str to ndarray
        Arrays to point to, by their slots' names; not copied.
    pointers : mapping of str to Addressed or None, optional
        What `Pointer` slots point to, by their names.

    Attributes
    ----------
    words, reals : ndarray
        The slots as integers and as doubles: the same memory.
    numbers : ctypes.Structure
        The same by name.
    address : int
        For compiled functions.
    """

    word_of: ClassVar[dict[str, int]] = {}
    """The word of each slot, those of parts too."""
    _all: ClassVar[dict[str, Slot]] = {}
    lasting_words: ClassVar[dict[str, int]] = {}
    """The word of each slot that lasts and holds a number; see `lasting`."""
    lasting_arrays: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls._all, cls.word_of = dict(cls.slots), {name: slot.index for name, slot in cls.slots.items()}
        for part in cls.part_of.values():
            for name, slot in part.declared.slots.items():
                cls._all[f"{part.name}.{name}"] = slot
                cls.word_of[f"{part.name}.{name}"] = part.index + slot.index
        lasting = {name: slot for name, slot in cls._all.items() if slot.lasting}
        cls.lasting_arrays = tuple(name for name, slot in lasting.items() if isinstance(slot, Array))
        cls.lasting_words = {name: cls.word_of[name] for name in lasting if name not in cls.lasting_arrays}

    def __init__(
        self, numbers: Mapping[str, float], arrays: Mapping[str, NDArray[Any]],
        pointers: "Mapping[str, Addressed | None]" = MappingProxyType({}),
    ):  # fmt: skip
        def size(n: int | str, part: str) -> int:
            if isinstance(n, int):
                return n
            return int(numbers[part + n if isinstance(self._all.get(part + n), Integer) else n])

        end = -(-self._size // LINE) * LINE
        self._own: dict[str, tuple[int, int]] = {}  # where an array begins and ends
        self._ends: dict[int, int] = {}  # the same, for all that were ever its own
        for name, slot in self._all.items():
            if isinstance(slot, Array) and slot.shape and name not in arrays:
                length = prod(size(n, name.removesuffix(slot.name)) for n in slot.shape)
                self._own[name] = (end, end + length)
                self._ends[end] = end + length
                end += -(-max(length, 1) // LINE) * LINE
        self._lies_in(aligned(end))
        for name, (start, _) in self._own.items():
            self.words[self.word_of[name]] = self.address + 8 * start
        for name, value in numbers.items():
            (self.reals if isinstance(self._all[name], Real) else self.words)[self.word_of[name]] = value
        self._find_indices()
        self.pointed = Pointed()
        self.point(arrays)
        for name, owner in pointers.items():
            self.pointed.hold(self.word_of[name], owner)
            self.words[self.word_of[name]] = address_of(owner)

    def _lies_in(self, memory: Numbers) -> None:
        self._memory = memory
        self.reals = memory[: self._size]
        self.words = self.reals.view(np.int64)
        self.numbers = self._structure.from_buffer(memory)
        self.address = ctypes.addressof(self.numbers)

    @property
    def calls_back(self) -> bool:
        """Whether compiled code that is called with it may call Python back: something it points to does."""
        return self.pointed.calls_back

    def copy(self) -> Self:
        """Return memory of its own with the same content, which points to the same arrays."""
        other = object.__new__(type(self))
        vars(other).update({k: v for k, v in vars(self).items() if k not in self.part_of})
        other.pointed = Pointed()
        other._lies_in(_from_a_line_on(np.empty(self._memory.size + LINE)))
        other.become(self)
        return other

    def become(self, other: Self) -> None:
        """Take the content of another of the same shape, and point to the same arrays."""
        self._memory[:] = other._memory
        self._own, self._indices = other._own, other._indices
        self.words[self._indices] += self.address - other.address
        self.pointed.become(other.pointed)

    def lasting(self) -> tuple[dict[str, int], dict[str, NDArray[Any]]]:
        """Return copies of what later steps depend on, by the names of the slots: words, and arrays."""
        words = {name: int(self.words[word]) for name, word in self.lasting_words.items()}
        return words, {name: attrgetter(name)(self).copy() for name in self.lasting_arrays}

    def go_on(self, words: Mapping[str, int], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Hold what `lasting` returned."""
        for name, word in words.items():
            self.words[self.word_of[name]] = word
        for name, array in arrays.items():
            attrgetter(name)(self)[:] = array

    def point(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Let slots point to arrays, and keep these alive."""
        for name, array in arrays.items():
            index = self.word_of[name]
            self.pointed.hold(index, array)
            self.words[index] = address(array)
        if not self._own.keys().isdisjoint(arrays):
            self._own = {name: part for name, part in self._own.items() if name not in arrays}
            self._find_indices()

    def _find_indices(self) -> None:
        # of the addresses in this memory, which are others in a copy
        self._indices = np.array([self.word_of[name] for name in self._own], dtype=np.intp)
