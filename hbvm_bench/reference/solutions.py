"""Trusted solutions: computed once in extended arithmetic, stored as text with their provenance.

A reference belongs to the exact doubles a problem starts from. `hbvm_bench.reference.trusted` makes
it, from the same traced vector field as everything else, by two methods that share nothing more.
"""

import ast
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Context, Decimal
from functools import cached_property, lru_cache, partial
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from problems import targets
from problems.errors import InputError, MissingLibraryError
from problems.problem import Problem
from problems.systems.base import System

Array = NDArray[np.float64]

TOLERANCE = "1e-28"
UNIT_ROUNDOFF = 2.0**-53
"""The largest relative change of a number that is rounded to a double."""
LONG = "long"  # the folder of those for long spans, whose two computations agree on fewer digits


@dataclass(frozen=True)
class Reference:
    """A trusted solution, each number as an unevaluated sum of two doubles.

    Attributes
    ----------
    t : ndarray, shape (n,)
        The times.
    high, low : ndarray, shape (n, dim)
        The states are ``high + low``.
    provenance : dict of str
        What computed it, and what a second computation says.
    condition : ndarray, shape (n,) or (0,)
        Condition number of the positions at each time, where it is known; see
        `hbvm_bench.reference.condition`.
    """

    t: Array
    high: Array
    low: Array
    provenance: dict[str, str]
    condition: Array = field(default_factory=partial(np.empty, 0))

    def condition_at(self, time: float) -> float | None:
        """Return the condition number of the positions at one of its times; ``None`` where it has none."""
        there = np.flatnonzero(self.t == time)
        return float(self.condition[there[0]]) if self.condition.size and there.size else None


class ReferenceFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, dict=True):
    """A stored reference as it stands in its file.

    Attributes
    ----------
    problem : str
        The problem as it prints.
    start, parameters : list of str
        ``t0`` and the initial state, and the parameters: the doubles in hexadecimal.
    provenance : dict of str
        What computed it, and what a second computation says.
    t : list of str
        The times, doubles in hexadecimal.
    y : list of list of str
        The states in decimal.
    condition : list of float
        Condition number of the positions at each time; empty where it is not known.
    """

    problem: str
    start: list[str]
    parameters: list[str]
    provenance: dict[str, str]
    t: list[str]
    y: list[list[str]]
    condition: list[float] = []

    @cached_property
    def reference(self) -> Reference:
        """Its states as pairs of doubles."""
        exact = [[Decimal(value) for value in row] for row in self.y]
        high = np.array([[float(value) for value in row] for row in exact])
        low = np.array([[float(_CONTEXT.subtract(v, Decimal(float(v)))) for v in row] for row in exact])
        times = np.array([float.fromhex(t) for t in self.t])
        return Reference(times, high, low, self.provenance, np.array(self.condition))

    @cached_property
    def digest(self) -> str:
        """The SHA-256 of its times and states."""
        return hashlib.sha256(msgspec.json.encode([self.t, self.y])).hexdigest()

    @property
    def key(self) -> tuple[str, ...]:
        """What `key_of` says of its problem."""
        end = float(self.provenance["t_end"]).hex()
        return (*self.start, *self.parameters, self.provenance["field"], end)


References = Mapping[tuple[str, ...], ReferenceFile]
"""References that do not come with the package, by the keys of their problems."""
NONE: References = MappingProxyType({})


def folder() -> Path:
    """Return where the references that come with the package lie."""
    return Path(str(files("hbvm_bench.reference") / "data"))


def find(problem: Problem, made: References = NONE) -> Reference | None:
    """Return the reference of a problem, or ``None``.

    Parameters
    ----------
    problem : Problem
        Matched by its initial state and its parameters, bit for bit, and its name. Of several
        references the one that has the problem's end time is returned, or else the first.
    made : mapping, optional
        References that do not come with the package. One of these is preferred: it has this very span and
        formula.
    """
    file = find_file(problem, made)
    return None if file is None else file.reference


def find_file(problem: Problem, made: References = NONE) -> ReferenceFile | None:
    """Return the reference of a problem with all its digits, or ``None``; see `find`."""
    if made and (file := made.get(key_of(problem))) is not None:
        return file
    wanted, end = (start(problem), hexadecimal(problem.par)), float(problem.t_end).hex()
    stored = _of_name(problem.name or "")
    fitting = [file_ for file_ in stored if (file_.start, file_.parameters) == wanted]
    return next((file_ for file_ in fitting if end in file_.t), fitting[0] if fitting else None)


def decode(text: str) -> ReferenceFile:
    """Return a reference from its text; see `encode`.

    Raises
    ------
    ValueError, LookupError
        If it is none.
    """
    file = msgspec.json.decode(text, type=ReferenceFile)
    if len(file.reference.t) != len(file.y) or len(file.condition) not in (0, len(file.y)):
        raise ValueError(
            "a reference must have one state, and no or one condition number, for each of its times"
        )
    return file


def key_of(problem: Problem) -> tuple[str, ...]:
    """Return what a reference that was made for a problem belongs to: start, parameters, formula and end."""
    end = float(problem.t_end).hex()
    return (*start(problem), *hexadecimal(problem.par), targets.fingerprint(problem.system), end)


@lru_cache(maxsize=64)
def _of_name(name: str) -> list[ReferenceFile]:
    """Return the references that come with the package for problems of a name."""
    if not name.isidentifier():
        return []
    places = (folder(), folder() / LONG)
    return [read(path) for place in places for path in sorted(place.glob(f"{name}*.json"))]


def file_from(
    problem: Problem,
    times: Array,
    states: list[list[str]],
    provenance: dict[str, str],
    condition: Array | None = None,
) -> ReferenceFile:
    """Return the reference of a problem: states as text at some times, how made, and their condition."""
    return ReferenceFile(
        problem=repr(problem),
        start=start(problem),
        parameters=hexadecimal(problem.par),
        provenance=provenance
        | {"field": targets.fingerprint(problem.system), "t_end": repr(float(problem.t_end))},
        t=hexadecimal(times),
        y=states,
        condition=[] if condition is None else [float(f"{value:.2g}") for value in condition.tolist()],
    )


def of_end(problem: Problem, end: Sequence[float]) -> ReferenceFile:
    """Return the reference of a problem of which only the end is known.

    Raises
    ------
    problems.errors.InputError
        If ``end`` is no state of the problem.
    """
    if len(end) != problem.system.dim or not np.isfinite(end).all():
        raise InputError(f"end={list(end)!r} of {problem!r} must be {problem.system.dim} finite numbers.")
    states = [[repr(float(value)) for value in end]]
    return file_from(
        problem, np.array([problem.t_end]), states, {"method": "the end state that the campaign gives"}
    )


def difference(stored: ReferenceFile, fresh: ReferenceFile) -> Decimal:
    """Return the largest difference of any component of two references of one problem."""
    if (stored.start, stored.parameters, stored.t) != (fresh.start, fresh.parameters, fresh.t):
        raise InputError(f"{stored.problem} and {fresh.problem} are references of different problems.")
    pairs = zip(stored.y, fresh.y, strict=True)
    return max(
        abs(_CONTEXT.subtract(Decimal(a), Decimal(b)))
        for row, other in pairs
        for a, b in zip(row, other, strict=True)
    )


def encode(stored: ReferenceFile) -> str:
    """Return the text of a reference file, one state a line."""
    order = ("problem", "provenance", "start", "parameters", "t", *["condition"] * bool(stored.condition))
    lines = [f'"{key}": {_text(getattr(stored, key))}' for key in order]
    rows = ",\n".join(f"  {_text(row)}" for row in stored.y)
    return "{" + ",\n".join([*lines, f'"y": [\n{rows}\n]']) + "}\n"


_CONTEXT = Context(prec=60)


def _text(value: object) -> str:
    return msgspec.json.encode(value).decode()


def hexadecimal(values: Array) -> list[str]:
    """Return doubles as text that loses nothing."""
    return [value.hex() for value in np.asarray(values, float).tolist()]


def start(problem: Problem) -> list[str]:
    """Return the initial time and state of a problem, as in a file."""
    return [float(problem.t0).hex(), *hexadecimal(problem.y0)]


def read(path: Path) -> ReferenceFile:
    """Return a stored reference with all its digits."""
    return msgspec.json.decode(path.read_bytes(), type=ReferenceFile)


def taylor(problem: Problem, times: Array, tolerance: str, precision: str = "real128") -> list[list[Decimal]]:
    """Return the states at given times by heyoka's Taylor method.

    Parameters
    ----------
    problem : Problem
        What to integrate; every number enters as the exact double.
    times : ndarray, shape (n,)
        Times from ``t0`` on.
    tolerance : str
        Decimal text.
    precision : {"real128", "longdouble"}
        Arithmetic: 113 or 64 bits.

    Raises
    ------
    problems.errors.MissingLibraryError
        Without heyoka.
    problems.errors.InputError
        If the computation does not reach the last time.
    """
    integrator, real = taylor_integrator(problem, tolerance, precision)
    outcome = integrator.propagate_grid(np.array([real(float(time)) for time in times]))
    states = outcome[-1]
    if len(states) != len(times):
        raise InputError(f"the reference of {problem!r} stopped before its end time: {outcome[0]}.")
    return [[Decimal(str(value)) for value in row] for row in states]


def taylor_integrator(problem: Problem, tolerance: str, precision: str = "real128") -> tuple[Any, Any]:
    """Return heyoka's integrator of a problem, at its start, and the type of its numbers; see `taylor`."""
    try:
        import heyoka as hy
    except ImportError:
        raise MissingLibraryError(
            "a reference needs heyoka; install it with: pip install 'hbvm-bench[peers]'."
        ) from None
    real = hy.real128 if precision == "real128" else np.longdouble
    integrator = hy.taylor_adaptive(
        _expressions(problem.system, hy, real),
        np.array([real(value) for value in problem.y0.tolist()]),
        time=real(float(problem.t0)),
        fp_type=real,
        tol=real(tolerance),
        high_accuracy=True,
        compact_mode=problem.system.dim > 40,
    )
    used = len(integrator.pars)  # up to the last parameter that the formulas contain
    integrator.pars[:] = np.array([real(value) for value in problem.par.tolist()[:used]])
    return integrator, real


class _Numbers(ast.NodeTransformer):
    """Turns literals into numbers of the arithmetic in use."""

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        if not isinstance(node.value, float):
            return node
        return ast.Call(ast.Name("number", ast.Load()), [node], [])


def _expressions(system: System, hy: Any, real: Any) -> list[Any]:
    """Return heyoka's expressions with literals in full precision.

    With double literals heyoka would turn a division by 3 into a multiplication
    by the double next to 1/3, whatever the precision of the integration.
    """
    source = targets.source(system, "field", "heyoka")
    tree = ast.fix_missing_locations(_Numbers().visit(ast.parse(source.text)))
    namespace: dict[str, Any] = {"number": lambda value: hy.expression(real(value))}
    exec(compile(tree, "<field>", "exec"), namespace)  # noqa: S102 -- emitted from a graph
    variables = [variable for variable, _ in targets.heyoka(system)]
    derivatives = namespace[source.name](hy.time, variables, hy.par, hy)
    derivatives = [e if isinstance(e, hy.expression) else hy.expression(real(e)) for e in derivatives]
    return list(zip(variables, derivatives, strict=True))
