"""Source code of a traced system for NumPy, numba, JAX and heyoka.

All receive the same operations in the same order, except that JAX reorders long sums: an indexed sum that
remains a loop becomes one reduction over an array.
"""

import hashlib
import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from problems import limits
from problems.derive.function import Function
from problems.derive.jacobian import Jacobian
from problems.errors import InputError, MissingLibraryError, shown, unknown
from problems.graph.functions import FUNCTIONS, SLOW
from problems.graph.nodes import reachable
from problems.graph.tables import interpolated
from problems.systems.base import System
from problems.systems.code_digest import code_digest
from problems.systems.opaque import Opaque
from problems.targets import cache
from problems.targets.array_text import jax_text, numpy_text
from problems.targets.heyoka_text import heyoka_text
from problems.targets.numba_text import numba_text, numba_text_of_part
from problems.targets.plan import SMALL, make_plan, unrolled

_WRITERS = {"numpy": numpy_text, "numba": numba_text, "jax": jax_text, "heyoka": heyoka_text}
BACKENDS = tuple(_WRITERS)
LONG, PER_SECOND = 3000, 600  # operations of a field of which its writer is told; compiled in a second, about
_LOOPS = "take a method that compiles loops, as HBVM, Gauss and those of SciPy do"
_CALLED = sorted({f.numba.partition("(")[0] for f in FUNCTIONS.values()} - {""})
_ARRAYS = [name for name in _CALLED if name == "floor" or not hasattr(math, name)]  # math.floor is an integer
_MATHEMATICS = {name: getattr(np if name in _ARRAYS else math, name) for name in _CALLED}
_NUMBA_HEAD = f"""from math import {", ".join(name for name in _CALLED if name not in _ARRAYS)}

import numba
import numpy as np
from numpy import {", ".join(_ARRAYS)}

from problems.targets.called import release, room, table, where

"""


@dataclass(frozen=True)
class Source:
    """Generated source.

    Attributes
    ----------
    text : str
        One function, preceded by its index tables (``TABLE_0 = np.array(...)``)
        where an indexed sum is a loop over a list.
    name : str
        The function's name.
    sha256 : str
        Hash of the text.
    cost : int
        Additions that take as long to compile.
    """

    text: str
    name: str
    sha256: str
    cost: int = 0


Quantity = str | Function | Jacobian
"""One of a system's functions, a Jacobian, or one of the names that `System.function` knows."""

_texts: WeakKeyDictionary[System, dict[tuple[Function, str, int | None], Source]] = WeakKeyDictionary()
_compiled: dict[tuple[str, str], Any] = {}


def compiled(kind: str, emitted: Source, make: Callable[[], Any]) -> Any:
    """Return what ``make`` compiles of a text, once in a process for each kind and each text."""
    key = (kind, emitted.sha256)
    if key not in _compiled:
        _compiled[key] = make()
    return _compiled[key]


def source(system: System, quantity: Quantity, backend: str, *, limit: int | None = SMALL) -> Source:
    """Return the source of one of a system's functions.

    Parameters
    ----------
    system : System
        The traced system.
    quantity : str, Function or Jacobian
        A function of the system, such as ``system.invariants["energy"]``, or what `System.jacobian`
        returns; ``"field"``, ``"force"``, ``"velocity_scale"`` and ``"hamiltonian"`` by name.
    backend : {"numpy", "numba", "jax", "heyoka"}
        numba: ``def name(t, y, par, out)`` on scalars, with the functions of
        `math` as globals; works unchanged on lanes. numpy: the same signature
        on arrays. jax: ``def name(t, y, par)``. heyoka: ``def name(t, y, par, hy)``.
    limit : int or None
        Largest number of operations of an indexed sum that is unrolled; ``None``: all (always for heyoka), 0:
        none.

    Raises
    ------
    problems.errors.InputError
        For an unknown backend, a function that the system does not have, or more operations than
        `problems.limits` allow where all loops are written out.
    """
    if backend not in _WRITERS:
        raise unknown("backend", backend, BACKENDS)
    if backend == "heyoka":
        limit = None
    function = _function(system, quantity)
    texts = _texts.setdefault(system, {})
    key = (function, backend, limit)
    if key not in texts:
        name = re.sub(r"\W+", "_", f"{system.name}_{function.name}")
        texts[key] = _written(function, name if name.isidentifier() else f"_{name}", backend, limit)
    return texts[key]


def _function(system: System, quantity: Quantity) -> Function:
    if not isinstance(system, System):
        raise InputError(f"a system is needed, such as problem.system, not {shown(system)}.")
    match quantity:
        case Function():
            return quantity
        case Jacobian():
            return quantity.function
    return system.function(quantity)


def _written(function: Function, name: str, backend: str, limit: int | None) -> Source:
    if limit is None:
        limits.check(f"the {function.name} for {backend}", "UNROLLED", unrolled(function), _LOOPS)
    plan = make_plan(function, limit=limit)
    text = _WRITERS[backend](plan, name)
    return Source(text, name, hashlib.sha256(text.encode()).hexdigest(), plan.cost)


def fingerprint(system: System) -> str:
    """Return the SHA-256 of a system's field: its structure, not its parameters' values.

    For an `Opaque` system it is that of its function's code and of the values that the function uses.
    """
    if isinstance(system, Opaque):
        return code_digest(system.f, system.dim, system.name)
    emitted = source(system, "field", "numba")
    body = emitted.text.replace(emitted.name, "field")
    head = f"{system.kind} {system.dim} {system.dof}\n"
    return hashlib.sha256((head + body).encode()).hexdigest()


def _executed(emitted: Source, namespace: dict[str, Any]) -> Callable[..., Any]:
    code = compile(emitted.text, f"<{emitted.name}>", "exec")
    exec(code, namespace)  # noqa: S102 -- text made by this package from a graph, never from the user's text
    return namespace[emitted.name]


def numpy(system: System, quantity: Quantity, *, limit: int | None = SMALL) -> Callable[..., np.ndarray]:
    """Return ``f(t, y, par) -> ndarray`` on numpy arrays.

    ``y`` is (dim,) or (dim, n), the result (m,) or (m, n), of long doubles if ``y`` is of these.
    Division by zero and the like give inf and nan, in silence, as in compiled code. ``limit`` as in `source`.
    """
    if isinstance(system, Opaque) and quantity == "field":
        return partial(_opaque_on_arrays, system)
    function = _function(system, quantity)
    return _on_arrays(source(system, function, "numpy", limit=limit), len(function.outputs))


def numpy_of(function: Function, name: str, *, limit: int | None = SMALL) -> Callable[..., np.ndarray]:
    """Return a further function of a system, such as one of `System.trace`, as `numpy` does."""
    return _on_arrays(_written(function, name, "numpy", limit), len(function.outputs))


def numba_of(function: Function, name: str) -> tuple[str, Callable[..., Any]]:
    """Return the source of such a function for numba, and it as a Python function that numba can compile."""
    emitted = _written(function, name, "numba", SMALL)
    from problems.targets import called  # which loads numba

    namespace: dict[str, Any] = {"np": np, **vars(called), **_MATHEMATICS}
    return emitted.text, _executed(emitted, namespace)


def numba_of_part(system: System, quantity: Quantity) -> tuple[str, Callable[..., Any]] | None:
    """Return the source of ``f(t, y, par, out, first, last)``, and it as a function that numba can compile.

    It sets some of the outputs: the same numbers as all. ``None`` if the function is no loop over neighbours.
    """
    function = _function(system, quantity)
    text = numba_text_of_part(make_plan(function, limit=SMALL), "part")
    if text is None:
        return None
    from problems.targets import called  # which loads numba

    namespace: dict[str, Any] = {"np": np, **vars(called), **_MATHEMATICS}
    return text, _executed(Source(text, "part", "", 0), namespace)


def _opaque_on_arrays(system: Opaque, t: Any, y: Any, par: Any) -> np.ndarray:
    states = np.asarray(y, dtype=np.float64)
    columns = np.ascontiguousarray(np.atleast_2d(states.T))
    out = np.empty_like(columns)
    times = np.broadcast_to(np.asarray(t, dtype=np.float64), len(columns))
    with np.errstate(all="ignore"):
        for time, state, row in zip(times.tolist(), columns, out, strict=True):
            system.evaluate(time, state, np.asarray(par, dtype=np.float64), row)
    return out[0] if states.ndim == 1 else np.ascontiguousarray(out.T)


def _on_arrays(emitted: Source, n_out: int) -> Callable[..., np.ndarray]:
    names = {"np": np, "table": partial(interpolated, np), **_SPECIAL}
    inner = compiled("numpy", emitted, lambda: _executed(emitted, names))

    def evaluate(t: Any, y: Any, par: Any) -> np.ndarray:
        y = np.asarray(y)
        dtype = np.longdouble if y.dtype == np.longdouble else np.float64
        y, par = np.asarray(y, dtype), np.asarray(par, dtype)
        if par.ndim == 1 and y.ndim == 2:
            par = par[:, np.newaxis]
        out = np.empty((n_out, *y.shape[1:]), dtype)
        with np.errstate(all="ignore"):
            inner(t, y, par, out)
        return out

    evaluate.__name__ = emitted.name
    return evaluate


def _special(name: str) -> Callable[[Any], Any]:
    def function(x: Any) -> Any:
        from scipy import special  # which takes its time to be imported

        return getattr(special, name)(x)

    return function


_SPECIAL = {f.numpy: _special(f.numpy) for f in FUNCTIONS.values() if "." not in f.numpy}


def numba(system: System, quantity: Quantity, *, limit: int | None = SMALL) -> Any:
    """Return a numba function ``f(t, y, par, out)`` on arrays, cached on disk.

    No fastmath: no reordering, no contraction. ``y``, ``par`` and ``out`` must not
    overlap. ``limit`` as in `source`. The field of an `Opaque` system is a plain Python
    function.
    """
    if isinstance(system, Opaque) and quantity == "field":
        return system.evaluate
    function = _function(system, quantity)
    cost = compilable(system, function)
    emitted = source(system, function, "numba", limit=limit)

    def make() -> Any:
        if cost >= LONG:
            warnings.warn(
                f"the {function.name} of {system.name} is {cost:,} operations written out, compiled "
                f"for about {cost / PER_SECOND:.0f} s; write loops as m.sum(lambda i: q[i]**2, range(n)) or "
                "m.each(lambda i: ..., range(n)), which takes about one.",
                stacklevel=4,
            )
        cut = emitted.text.index(f"def {emitted.name}(")
        decorator = '@numba.njit(cache=True, error_model="numpy")\n'
        text = _NUMBA_HEAD + emitted.text[:cut] + "\n" + decorator + emitted.text[cut:]
        return getattr(cache.module(text, emitted.name), emitted.name)

    return compiled("numba", emitted, make)


def compilable(system: System, quantity: Quantity) -> int:
    """Return the operations of a function; refuse one that would be compiled for minutes.

    See `problems.limits`. Operations in a loop count once; a sine or an exponential as `SLOW`.

    Raises
    ------
    problems.errors.InputError
        For too many operations, or too many that wait for one another.
    """
    function = _function(system, quantity)
    nodes = reachable(function.roots)
    cost = source(system, function, "numba").cost
    name = f"the {function.name} of {system.name}"
    limits.check(f"{name}, with each sine or exponential as {SLOW},", "OPERATIONS", cost, limits.WRITTEN_OUT)
    depth: dict[int, int] = {}
    for node in nodes:  # arguments come first
        depth[node.id] = 1 + max((depth[arg.id] for arg in node.args), default=0)
    limits.check(name, "DEPTH", max(depth.values(), default=0), "nest fewer, or write long sums with m.sum")
    return cost


def jax(system: System, quantity: Quantity, *, limit: int | None = SMALL) -> Callable[..., Any]:
    """Return ``f(t, y, par)`` on JAX arrays; y is (dim,); switches JAX to double precision.

    ``limit`` as in `source`.

    Raises
    ------
    problems.errors.MissingLibraryError
        If JAX is not installed.
    """
    try:
        import jax as library
        import jax.numpy as jnp
    except ImportError as error:
        raise _missing("jax") from error
    library.config.update("jax_enable_x64", True)
    emitted = source(system, quantity, "jax", limit=limit)
    special = {name: getattr(library.scipy.special, name) for name in _SPECIAL}
    namespace = {"np": np, "jnp": jnp, "table": partial(interpolated, jnp), **special}
    return compiled("jax", emitted, lambda: _executed(emitted, namespace))


def heyoka(system: System, quantity: Quantity = "field") -> list[Any]:
    """Return heyoka expressions: pairs of variable and right-hand side for ``"field"``.

    Variables are ``q0.., p0..`` (``y0..`` for a vector field), parameters
    ``hy.par[i]``, time ``hy.time``. For other functions of the system, the list
    of expressions.

    Raises
    ------
    problems.errors.MissingLibraryError
        If heyoka is not installed.
    """
    variables, expressions = _for_heyoka(system, source(system, quantity, "heyoka"))
    right_hand_side = quantity == "field" or quantity is system.field
    return list(zip(variables, expressions, strict=True)) if right_hand_side else expressions


def heyoka_of(system: System, function: Function) -> Any:
    """Return a function of a system's state that is none of its own, such as one of `System.trace`."""
    return _for_heyoka(system, _written(function, "function", "heyoka", None))[1][0]


def heyoka_variables(system: System) -> list[Any]:
    """Return the variables of a system's state as heyoka's expressions, see `heyoka`."""
    width = len(str(system.dim))
    if system.dof is None:
        names = [f"y{i:0{width}d}" for i in range(system.dim)]
    else:
        names = [f"{x}{i:0{width}d}" for x in "qp" for i in range(system.dof)]
    made = _heyoka().make_vars(*names)
    return list(made) if len(names) > 1 else [made]


def _heyoka() -> Any:
    try:
        import heyoka as hy
    except ImportError as error:
        raise _missing("heyoka") from error
    return hy


def _for_heyoka(system: System, emitted: Source) -> tuple[list[Any], list[Any]]:
    """Return a system's variables, and a function of them as expressions."""
    hy, variables = _heyoka(), heyoka_variables(system)
    expressions = _executed(emitted, {})(hy.time, variables, hy.par, hy)
    return variables, [e if isinstance(e, hy.expression) else hy.expression(e) for e in expressions]


def _missing(library: str) -> MissingLibraryError:
    return MissingLibraryError(
        f"{library} is not installed; install it with: pip install 'hbvm-bench[peers]'."
    )


__all__ = [
    "BACKENDS",
    "SMALL",
    "Quantity",
    "Source",
    "compilable",
    "compiled",
    "fingerprint",
    "heyoka",
    "heyoka_of",
    "jax",
    "numba",
    "numba_of",
    "numpy",
    "numpy_of",
    "source",
]
