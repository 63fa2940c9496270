"""The memory of a trajectory: a context and the arrays it points to."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from integrators.kernel import layout as at
from integrators.kernel.tables import Constants, aligned

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Shape:
    """What the memory of all trajectories of a program has in common.

    Attributes
    ----------
    rows : int
        Components of a stage.
    second : bool
        Second-order form: a stage holds positions, the state (q, p).
    unit : bool
        Whether the rows' factors are in the matrix.
    field : int
        Address of the vector field.
    fused : int
        Address of whole sweeps; 0: none.
    parameters : int
        Length of the parameter vector.
    block, group : ndarray of int
        Block of each row, group of each block.
    constants : Constants
        The method's.
    """

    rows: int
    second: bool
    unit: bool
    field: int
    fused: int
    parameters: int
    block: Integers
    group: Integers
    constants: Constants

    @property
    def dim(self) -> int:
        """Length of the state."""
        return self.rows * (2 if self.second else 1)


class Context:
    """A context and its arrays in one piece of memory; shares tables that do not change with others.

    Parameters
    ----------
    shape : Shape
        Of the program.
    tables : mapping of str to ndarray
        Tables by their slot's name; not copied.

    Attributes
    ----------
    words, reals : ndarray, shape (CONTEXT,)
        The context as integers and as doubles: the same memory.
    address : int
        Of the context, for compiled functions.
    """

    def __init__(self, shape: Shape, tables: Mapping[str, Array]):
        c = shape.constants
        rows, lanes = shape.rows, c.lanes
        padded = -(-rows // 8) * 8
        blocks, chunks = -(-c.k // lanes), -(-c.k // 8)
        sizes = {
            "FIELD": shape.field, "FUSED": shape.fused, "ROWS": rows, "PADDED": padded, "LANES": lanes,
            "BLOCKS": blocks,
            "CHUNKS": chunks, "ROUTE": c.route, "SECOND": int(shape.second), "UNIT": int(shape.unit),
            "STAGES": c.k, "DEGREE": c.s, "MODES": c.modes, "MODE_CHUNKS": -(-c.modes // 8),
            "FIRST_COEFFICIENT": c.first, "COEFFICIENT_CHUNKS": -(-(c.s + c.first) // 8),
            "BLOCK_COUNT": shape.group.size, "GROUP_COUNT": int(shape.group.max()) + 1,
        }  # fmt: skip
        stage, modes = blocks * padded * lanes, -(-max(c.modes, c.s + c.first) // 8)
        lengths = {
            "PAR": shape.parameters, "MATRIX": tables["RAW_MATRIX"].size, "BASIS": 64 * chunks * modes,
            "VELOCITY": padded, "ROW_FACTOR": padded, "STEP_FACTOR": 2 * padded, "KICK_FACTOR": 2 * padded,
            "Q": stage, "OTHER_Q": stage, "F": stage, "BASE": stage, "SUM": stage,
            "COEFFICIENTS": 8 * modes * padded, "TIMES": blocks * lanes,
            "STATE": 2 * padded, "ERROR": 2 * padded, "NEXT_STATE": 2 * padded, "NEXT_ERROR": 2 * padded,
            "ROW_STATE": padded, "ROW_ERROR": padded, "ROW_DRIFT": padded, "ROW_DRIFT_LOW": padded,
            "STRICT": padded, "FLOORED": padded, "SIZE": shape.group.size, "LARGEST": shape.group.size,
        }  # fmt: skip
        self.shape = shape
        self._places: dict[str, tuple[int, int]] = {}  # of own arrays: where they begin and end
        end = at.CONTEXT
        for name, n in lengths.items():
            if name not in tables:
                self._places[name] = (end, end + n)
                end += -(-n // 8) * 8
        self._put(aligned(end))
        for name, (start, _) in self._places.items():
            self.words[getattr(at, name)] = self.address + 8 * start
        for name, value in sizes.items():
            self.words[getattr(at, name)] = value
        self._shared: dict[str, Array] = {}
        self.point(tables)
        self.point({"BLOCK": shape.block.view(np.float64), "GROUP": shape.group.view(np.float64)})
        self.words[at.MATRIX_SIZE] = tables["RAW_MATRIX"].size // 8
        self["ROW_FACTOR"][:] = 1.0
        self["KICK_FACTOR"].reshape(-1, 8)[:, :4] = 1.0

    def _put(self, memory: Array) -> None:
        self._memory = memory
        self.reals: Array = memory[: at.CONTEXT]
        self.words: Integers = self.reals.view(np.int64)
        self.address: int = memory.ctypes.data

    def copy(self) -> "Context":
        """Return a context of its own with the same content; much faster than a new one."""
        other = object.__new__(Context)
        other.shape = self.shape
        other._places, other._shared = self._places.copy(), self._shared.copy()
        memory = aligned(self._memory.size)
        memory[:] = self._memory
        other._put(memory)
        slots = [getattr(at, name) for name in self._places]
        other.words[slots] += other.address - self.address
        return other

    def point(self, arrays: Mapping[str, Array]) -> None:
        """Let slots point to arrays, and keep these alive."""
        for name, array in arrays.items():
            self._places.pop(name, None)
            self._shared[name] = array
            self.words[getattr(at, name)] = array.ctypes.data

    def __getitem__(self, name: str) -> Array:
        """Return an array by the name of its slot; not those that compiled code exchanges."""
        if name in self._shared:
            return self._shared[name]
        start, end = self._places[name]
        return self._memory[start:end]

    def array(self, slot: int) -> Array:
        """Return the own array that a slot points to now; for those that compiled code exchanges."""
        begin = (int(self.words[slot]) - self.address) // 8
        return next(self._memory[start:end] for start, end in self._places.values() if start == begin)

    def state(self) -> Array:
        """Return a copy of the state, as (q, p) or y; shape (dim,)."""
        state, rows = self.array(at.STATE), self.shape.rows
        if not self.shape.second:
            return state[:rows].copy()
        places = np.arange(rows) // 4 * 8 + np.arange(rows) % 4
        return state[np.concatenate([places + 4, places])]

    def set_factors(self, h: float) -> None:
        """Set H and what is h times the velocities."""
        self.reals[at.H] = h
        if self.shape.second:
            rows = self.shape.rows
            kh = h * self["VELOCITY"][:rows]
            places = np.arange(rows) // 4 * 8 + np.arange(rows) % 4
            self["ROW_FACTOR"][:rows] = kh
            self["STEP_FACTOR"][places] = kh
            self["KICK_FACTOR"][places + 4] = kh
