"""HBVM(k, s) and Gauss(s) as an integrator of REBOUND.

    import rebound
    from integrators import HBVM
    from integrators.plugins.rebound import install

    sim = rebound.Simulation()
    ...
    install(sim, HBVM(k=8, s=8, h=0.01))
    sim.integrate(100.0)

Importing this module registers the integrator ``"hbvm"`` with REBOUND, so that
``sim.integrator = "hbvm"`` and archives of such simulations work too; ``sim.dt``
is the step, ``sim.integrator.k`` and ``.s`` are the method's.
"""

import ctypes
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from integrators.coefficients.legendre import legendre, tables
from integrators.kernel.native import binary as native
from integrators.kernel.native import store
from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM, TOLERANCE
from integrators.plugins.rebound import layout
from integrators.plugins.rule import MODES
from problems.errors import InputError

__all__ = ["install"]

rebound = layout.rebound

NAME = "hbvm"

DOCUMENTATION = """\
HBVM(k,s), a Hamiltonian Boundary Value Method (Brugnano, Iavernaro, Trigiante 2010); with tol, own timesteps.
It is of order 2s and conserves the energy for any sequence of timesteps as soon as k is large enough.
HBVM(s,s) is the Gauss-Legendre collocation method, which is symplectic and conserves the angular momentum.
The method is implicit. It handles arbitrary forces, including those that depend on velocities or time.
The solution of the implicit equations and the sums of positions and velocities are accurate to round-off.
"""

DOUBLE, UINT64, POINTER = 1, 6, 10  # REBOUND's enum REB_BINARYDATA_DTYPE

FIELDS = (
    ("Number of nodes of the quadrature, at least s. Default is 8.", UINT64, "k", layout.K, None),
    ("Degree of the polynomial; the order is 2s. Default is 8.", UINT64, "s", layout.S, None),
    ("", POINTER, "rest", layout.REST, layout.REST + 1),
    ("", POINTER, "forces", layout.FORCES, layout.FORCES + 1),
    ("", DOUBLE, "length", layout.LENGTH, None),
    ("Iterations so far.", UINT64, "iterations", layout.ITERATIONS, None),
    ("Force evaluations so far.", UINT64, "evaluations", layout.EVALUATIONS, None),
    (
        "Estimated local error of a step, relative to the largest velocity that the first body sees, beyond "
        "which the integration ends with an error. Default is 1e-3 (30 times that for s = 1); inf: never.",
        DOUBLE,
        "largest_error",
        layout.LARGEST_ERROR,
        None,
    ),
    (
        "Estimated local error of a step, in the same units, that its length follows; sim.dt is then the "
        "next step. Default is 0: steps of constant length.",
        DOUBLE,
        "tol",
        layout.TOL,
        None,
    ),
)

MESSAGES = {
    layout.UNKNOWN_METHOD: "HBVM needs whole numbers k >= s >= 1: set sim.integrator.k and sim.integrator.s.",
    layout.ROUGH: "HBVM solves to round-off, for smooth forces; a tree's are not: set sim.gravity = 'basic'.",
    layout.DIVERGED: "The iteration for a step of HBVM did not converge; take a smaller sim.dt.",
    layout.UNRESOLVED: "A step of HBVM is too long: its estimated error exceeds "
    "sim.integrator.largest_error times the bodies' velocity; take a smaller sim.dt, or set "
    "sim.integrator.tol for an adaptive step size.",
}

# REBOUND keeps addresses of what is in here.
_kept: list[Any] = []
_tables: dict[tuple[int, int], Any] = {}


def install(simulation: Any, method: HBVM | Gauss) -> None:
    """Set ``method`` as the integrator of a simulation, and its h, if given, as the timestep.

    With ``tol``, as in ``HBVM(k=16, s=8, tol=1e-12)``, the step size is adaptive, for close encounters. A
    symplectic method, such as Gauss, then loses its long-time behaviour; one with k > s conserves the energy.

    Parameters
    ----------
    simulation : rebound.Simulation
        The simulation.
    method : HBVM or Gauss
        As for `integrators.integrate`, with s; without k, k = 2s, with which the energy is conserved to
        rounding as a rule. Without h and tol, as in ``HBVM(s=8)``, the timestep remains ``simulation.dt``;
        with tol, h is the initial step size.

    Raises
    ------
    problems.errors.InputError
        For another method, or one with unsupported options: those of the step size except ``h`` and ``tol``,
        or a ``solver``, since the equations are solved by fixed-point iteration.
    """
    if isinstance(method, Gauss):
        method = method.as_hbvm()
    if not isinstance(method, HBVM):
        raise InputError(f"install takes HBVM(k=, s=, h=) or Gauss(s=, h=), not {method!r}.")
    if method.s is None:
        raise InputError(f"{method!r} chooses k and s itself, REBOUND's plugin does not: give HBVM(s=8).")
    if given := method.control():
        raise InputError(f"{next(iter(given))}= is not available in REBOUND: leave it out.")
    given_tol = method.tol is not None and (method.h is not None or method.tol != TOLERANCE)
    if method.solver not in ("auto", "fixed_point"):
        raise InputError(
            f"solver={method.solver!r} is not available in REBOUND, where steps are solved by fixed-point "
            "iteration: leave it out."
        )
    simulation.integrator = NAME
    options: Any = simulation.integrator  # not the name, but what holds its options
    options.k, options.s = method.k or 2 * method.s, method.s
    options.tol = method.tol if given_tol else 0.0
    if method.h is not None:
        simulation.dt = method.h


def _table(k: int, s: int) -> int:
    """Return the address of the tables of HBVM(k, s), or 0 if there is no such method."""
    try:
        table = _tables.get((k, s))
        if table is None:  # of two threads that make it, both go on with the one that is kept
            table = _tables.setdefault((k, s), _make_table(k, s))
        return table.ctypes.data
    except InputError:
        return 0


def _fail(simulation: int, code: int) -> None:
    """Tell REBOUND when and why a step failed."""
    t, dt = (
        (ctypes.c_double * layout.SIMULATION).from_address(simulation)[i] for i in (layout.TIME, layout.DT)
    )
    reason = code == layout.DIVERGED and _not_finite(simulation)
    message = f"{reason or MESSAGES[code]} This was at t = {t!r}, dt = {dt!r}."
    rebound.clibrebound.reb_simulation_error(ctypes.c_void_p(simulation), ctypes.c_char_p(message.encode()))


def _not_finite(simulation: int) -> str | None:
    """Return which particle has a mass, place, velocity or force that is no number; ``None`` if none has."""
    sim = ctypes.cast(simulation, ctypes.POINTER(rebound.Simulation)).contents
    for names in (("m", "x", "y", "z", "vx", "vy", "vz"), ("ax", "ay", "az")):  # forces follow from the rest
        for i in range(sim.N):
            for name in names:
                value = getattr(sim.particles[i], name)
                if not np.isfinite(value):
                    return (
                        f"Particle {i} has {name} = {value!r}, which must be a finite number; set it anew, "
                        f"or remove the particle with sim.remove({i})."
                    )
    return None


def _make_table(k: int, s: int) -> np.ndarray:
    t = tables(k, s)
    vectors = (t.nodes, t.weights, t.position_weights)
    to_legendre = (legendre(t.nodes.hi, min(k, MODES)) * t.weights.hi[:, None]).T
    return np.ascontiguousarray(
        np.vstack(
            [
                *(part for vector in vectors for part in (vector.hi, vector.lo)),
                _product(t.double_integrals, t.projection),
                _product(t.integrals, t.projection),
                to_legendre,
            ]
        )
    )


def _product(left: Any, right: Any) -> np.ndarray:
    wide = [(table.hi.astype(np.longdouble) + table.lo) for table in (left, right)]
    return np.asarray(wide[0] @ wide[1], dtype=np.float64)


def _create() -> int:
    """Return the address of a new state, HBVM(8, 8), in memory of C's."""
    calloc = ctypes.CDLL(None).calloc
    calloc.argtypes, calloc.restype = [ctypes.c_size_t] * 2, ctypes.c_void_p
    address = calloc(layout.WORDS, 8)
    state = (ctypes.c_int64 * layout.WORDS).from_address(address)
    state[layout.K], state[layout.S] = 8, 8
    ctypes.c_double.from_address(address + 8 * layout.LARGEST_ERROR).value = layout.LARGEST
    return address


def _address(function: Any) -> Any:
    return ctypes.cast(function, ctypes.c_void_p).value


def _link() -> None:
    """Give compiled code the addresses of what it calls."""
    library, integer = rebound.clibrebound, ctypes.c_int64
    called = {
        "tables": ctypes.CFUNCTYPE(integer, integer, integer)(_table),
        "fail": ctypes.CFUNCTYPE(None, integer, integer)(_fail),
        "update_acceleration": library.reb_simulation_update_acceleration,
        "megno_rate": library.reb_tools_megno_deltad_delta,
        "megno_update": library.reb_tools_megno_update,
    }
    _kept.append(called)
    for name, function in called.items():
        llvm.add_symbol(f"hbvm_rebound_{name}", _address(function))


def _native(callback: str) -> int:
    """Return the address of a function that REBOUND calls, compiled, or compiled before and kept."""

    def make() -> tuple[str, bytes]:
        from integrators.plugins.rebound import step  # imports numba

        return " ", step.build(callback)

    files = native.sources("integrators.plugins.rebound.step")
    return native.obtain(store.key("rebound", callback, files, layout.IDENTITY), make).address


def _register() -> None:
    """Register the integrator; REBOUND does not forget it, so once in a process."""
    library = rebound.clibrebound
    descriptor = rebound.binarydata_field_descriptor.BinarydataFieldDescriptor
    fields = (descriptor * (len(FIELDS) + 1))()
    for field, (text, kind, name, offset, count) in zip(fields, FIELDS, strict=False):
        field.documentation = text.encode()
        field.dtype = kind
        field.name = name.encode()
        field.offset = 8 * offset
        if count is not None:
            field.offset_N, field.element_size = 8 * count, 8
    create = ctypes.CFUNCTYPE(ctypes.c_void_p)(_create)
    integrator = rebound.integrator.Integrator()
    integrator.documentation = DOCUMENTATION.encode()
    integrator.create = _address(create)
    integrator.step, integrator.free = map(_native, ("step", "free"))
    integrator.did_add_particle, integrator.will_remove_particle = map(_native, ("added", "removed"))
    integrator.field_descriptor_list = ctypes.cast(
        fields, rebound.binarydata_field_descriptor.BinarydataFieldDescriptorList
    )
    _kept.extend([fields, integrator, create])
    register = library.reb_integrator_register
    register.argtypes, register.restype = [rebound.integrator.Integrator, ctypes.c_char_p], None
    register(integrator, NAME.encode())


_link()
_register()
