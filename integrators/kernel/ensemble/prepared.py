"""A method's coefficients for trajectories in lanes, and the memory of groups of them."""

from collections.abc import Callable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from integrators.kernel import tables
from integrators.kernel.context import width_of_blocks
from integrators.kernel.engines import lanes, run, run_own
from integrators.kernel.ensemble.form import JUDGED, Form
from integrators.kernel.ensemble.group import Group
from integrators.kernel.native import binary, machine
from integrators.kernel.native.memory import Numbers, aligned
from integrators.kernel.tables import Constants
from problems import targets
from problems.graph.functions import FUNCTIONS
from problems.graph.nodes import reachable
from problems.systems.base import System

LANES = 8  # of a register of AVX-512
# Operations not waited for
SHORT_LATENCY = ("const", "symbol", "index", "add", "sub", "mul", "neg", "pow", "sum")
STAGES = 16  # at most: their sums are unrolled
UNROLLED = 640  # products of an iteration that are written out, at most
FEW_ROWS, FEW_CALLS = 4, 3  # where both are exceeded, no products are written out
# Operations of the field at all stages, at most, a function being so many: LLVM unrolls no longer loops
OPERATIONS, CALL = 4000, 40
ROOM = 4096  # rows of all stages, at most: beyond, a group of trajectories does not fit in the nearest caches

Result = TypeVar("Result")


class Lanes:
    """HBVM(k, s) on trajectories in lanes, compiled for one system.

    Parameters
    ----------
    system : System
        What is integrated; its field can run on lanes.
    constants : Constants
        The method's.
    second : bool
        Whether in second-order form.
    unit : bool
        Whether the rows' factors can be in the matrix; see `integrators.kernel.tables.unit`.
    varying : bool
        Whether each trajectory has adaptive steps.

    Raises
    ------
    numba.NumbaError
        If parameters that differ from lane to lane keep the field from running on lanes.
    """

    def __init__(self, system: System, constants: Constants, second: bool, unit: bool, varying: bool):
        self.rows = system.dof if second and system.dof is not None else system.dim
        self.dim, self.parameters = system.dim, system.n_par
        blocks = blocks_of(system, second, self.rows)
        self._compile(system, constants, "force" if second else "field", second, unit, varying, blocks)

    def _compile(
        self, system: System, constants: Constants, quantity: targets.Quantity, second: bool, unit: bool,
        varying: bool, blocks: dict[str, int], vectors: Mapping[str, int] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        """Compile the steps around a function of stages of `rows` components."""
        self.system, self.second, self._constants = system, second, constants
        self.unit, self.varying, self.k = unit and not varying, varying, constants.k
        self.width = width_for(system, second, self.rows)
        unrolled = unrolled_for(system, second, self.k, self.rows)
        register = LANES if machine.many_registers() else LANES // 2
        degrees = tables.degrees_judged(constants.k, constants.s)
        numbers = {
            "k": self.k, "rows": self.rows, "second": second, "unit": self.unit, "varying": varying,
            "unrolled": unrolled, "held": unrolled and register == self.width,
            **{f"blocks.{name}": value for name, value in blocks.items()},
            **{f"vectors.{name}": value for name, value in vectors.items()},
            **dict(zip(JUDGED, degrees, strict=True)),
        }  # fmt: skip
        form = Form(numbers, {})
        self._code = lanes.code(
            system,
            quantity,
            self.width,
            (self.width, register),
            constants=form.words.tolist(),
            par=True,
            unrolled=unrolled,
        )
        loop = (run_own if varying else run).code()
        self.from_cache = self._code.from_cache and loop.from_cache
        self._scaled: dict[float, Numbers] = {}

    @staticmethod
    def takes(system: System, constants: Constants, second: bool) -> bool:
        """Whether stages of so many components, and so many of them, are few enough."""
        rows = system.dim // 2 if second else system.dim
        return constants.k <= STAGES and constants.k * rows <= ROOM

    @cached_property
    def _fixed(self) -> dict[str, Numbers]:
        """The tables that do not depend on the step."""
        a = self._constants.arrays
        names = ("nodes", "nodes_low", "weights", "weights_low", "position_weights", "position_weights_low")
        extrapolation = a["extrapolation_basis"][:, : tables.MODES] @ a["to_legendre"][: tables.MODES]
        chosen = {name: a[name] for name in names} | {"extrapolation": extrapolation}
        if self.varying:
            chosen |= {"to_legendre": a["to_legendre"], "in_powers": in_powers(self.k)}
        return {name: _aligned(values) for name, values in chosen.items()}

    def _matrix(self, h: float) -> Numbers:
        """Return the matrix for the step h, shape (k, k)."""
        if h not in self._scaled:
            a = self._constants.arrays
            high, low = tables.times(a["matrix"], a["matrix_low"], h)
            if self.second and self.unit:
                high, low = tables.times(high, low, h)
            self._scaled[h] = tables.keep_moments(high, low, a["basis"])
        return self._scaled[h]

    def parts(self, parts: Numbers, h: float) -> dict[str, NDArray[Any]]:
        """Return what `Group` has of partial steps that follow a step of h."""
        from integrators.coefficients.legendre import legendre

        a, modes = self._constants.arrays, min(self.k, tables.MODES)
        lengths, indices = np.unique(parts, return_inverse=True)
        nodes = 1.0 + (lengths / h)[:, None] * a["nodes"].reshape(-1)
        basis = legendre(nodes.reshape(-1), modes).reshape(lengths.size, self.k, modes)
        factor = lengths * lengths if self.second and self.unit else lengths
        matrix = factor[:, None, None] * self._matrix(1.0)
        return {
            "parts": parts,
            "part_indices": indices.astype(np.int64),
            "part_matrix": np.ascontiguousarray(matrix),
            "part_extrapolation": np.ascontiguousarray(basis @ a["to_legendre"][:modes]),
            "part_norms": _norm(matrix),
        }

    def velocities(self, par: Numbers) -> Numbers:
        """Return q' = velocity * p of all trajectories, shape (n, rows); ones in first-order form."""
        if not self.second:
            return np.ones((len(par), self.rows))
        there = np.zeros((self.system.dim, len(par)))
        scales = targets.numpy(self.system, "velocity_scale")(0.0, there, np.ascontiguousarray(par.T))
        return np.ascontiguousarray(scales.T)

    def groups(
        self, t0: float, h: float, numbers: dict[str, int], arrays: dict[str, NDArray[np.generic]]
    ) -> tuple[Group, Group]:
        """Return memory for a group of trajectories with step h, and for partial steps.

        Parameters
        ----------
        t0, h : float
            Time of the starts, and the step.
        numbers, arrays : dict
            What `Group` is to know of the trajectories.
        """
        shape = {
            "lanes": self.width, "rows": self.rows, "dim": self.dim,
            "parameters": self.parameters, "k": self.k, "events": 0, **numbers,
        }  # fmt: skip
        matrix = self._matrix(h)
        held = {**self._fixed, **arrays, "matrix": matrix}
        group, partial = (Group(shape, held, {"code": self._code}) for _ in range(2))
        group.matrix_norm = float(_norm(matrix))
        group.h[:], group.t0[:] = h, t0
        group.start_time = t0
        return group, partial


def blocks_of(system: System, second: bool, rows: int) -> dict[str, int]:
    """Return the blocks of a stage of so many components, as `ensemble.form.Blocks` has them."""
    width, groups = width_of_blocks(system), 1 if second or system.dof is None else 2
    return {"first": 0, "groups": groups, "count": rows // groups // width, "width": width}


def in_powers(k: int) -> Numbers:
    """Return powers of x in Legendre polynomials on [-1, 1], orthonormal on [0, 1].

    Returns
    -------
    ndarray, shape (k + 1, k)
        For each power below k its factor in the polynomial of each degree; then the polynomials at 1.
    """
    from numpy.polynomial.legendre import leg2poly  # takes its time, and is needed for adaptive steps only

    factors = np.zeros((k + 1, k))
    for j in range(k):
        factors[k, j] = np.sqrt(2.0 * j + 1.0)
        factors[: j + 1, j] = leg2poly([0.0] * j + [factors[k, j]])
    return factors


def width_for(system: System, second: bool, rows: int) -> int:
    """Return how many trajectories go side by side.

    Eight, which fill a register where there are 32 of eight doubles; more where the field has few components,
    for results are waited for: sixteen (Henon and Heiles: 15 % faster), or 32 where they are those of
    divisions, roots or other functions (Kepler: 15 % faster with sixteen, and as much again with 32). With
    sixteen the four rows of a double pendulum are 7 % slower.

    With 16 registers of AVX2 eight fill two of them, and sixteen are faster only where one component waits
    for a function (Morse: 9 % with adaptive and 15 % with fixed steps; a pendulum's sine: within 3 %). Kepler
    is 14 % slower with fixed and 6 % with adaptive steps, the double pendulum 36 %.
    """
    nodes = reachable(system.function("force" if second else "field").roots)
    waits = any(node.op not in SHORT_LATENCY for node in nodes)
    if not machine.many_registers():
        return 2 * LANES if rows == 1 and waits else LANES
    if rows > 3:
        return LANES
    return 4 * LANES if rows == 1 or (rows == 2 and waits) else 2 * LANES


def unrolled_for(system: System, second: bool, k: int, rows: int) -> bool:
    """Return whether stages and rows are unrolled, so that a step's values are in registers.

    The field is written out with them. With many exponentials, sines, ... that is more code than the nearest
    cache has: in loops, steps of Toda lattices of six to eight take 7 to 18 % less, those of a double
    pendulum with a tangent vector 6 %, and their compilation a third. But a double pendulum alone takes 7 %
    more, Morse's oscillator with five tangent vectors 21 %, and six rows without functions 2 to 35 %.
    """
    nodes = reachable(system.function("force" if second else "field").roots)
    called = [node for node in nodes if node.op in FUNCTIONS and node.op != "sqrt"]
    calls = sum(len(node.loop) if node.loop else 1 for node in called)
    in_loops = (rows > FEW_ROWS and calls > FEW_CALLS) or k * (len(nodes) + CALL * calls) > OPERATIONS
    return k * k * rows <= UNROLLED and not in_loops


def lanes_of(
    system: System, constants: Constants, second: bool, unit: bool, varying: bool
) -> tuple[Lanes | None, float]:
    """Return a method on trajectories in lanes, or ``None`` where it cannot be; and the seconds that took."""
    if not Lanes.takes(system, constants, second):
        return None, 0.0
    return compiled_lanes(lambda: Lanes(system, constants, second, unit, varying))


def compiled_lanes(make: Callable[[], Result]) -> tuple[Result | None, float]:
    """Return what a function compiles, or ``None`` where numba cannot; and the seconds that took."""
    started = binary.clock()
    lanes_ = None
    try:
        lanes_ = make()
    except Exception as error:
        from numba import NumbaError  # has been imported to compile

        if not isinstance(error, NumbaError):
            raise
    return lanes_, binary.clock() - started


def _norm(matrix: Numbers) -> Numbers:
    """Return how far a change of the values moves the stages at most, for a matrix or for several.

    In the next iteration a stage meets the changes at itself and at those after it: the others have moved it.
    """
    return np.abs(np.triu(matrix)).sum(axis=-1).max(axis=-1)


def _aligned(values: Numbers) -> Numbers:
    copy = aligned(values.size)
    copy[:] = values.reshape(-1)
    return copy
