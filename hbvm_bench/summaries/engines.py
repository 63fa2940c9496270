"""Which engine accepts which problem, and why not."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import integrators.registry
import problems
from hbvm_bench.summaries.table import Table
from integrators.protocol import MethodBase
from problems import emit
from problems.errors import InputError
from problems.problem import Problem

LIBRARIES = ("numpy", "numba", "jax", "heyoka")
BODIES, FORCES = "REBOUND's bodies", "REBOUND's forces"
# Values for what a method must be given: whether it accepts a problem does not depend on them.
_NUMBERS = {"h": 1e-3, "k": 4, "s": 2, "tol": 1e-10, "rtol": 1e-10, "atol": 1e-10}
_REQUIRED: dict[str, Any] = {**_NUMBERS, "invariants": ("energy",)}


def reasons(problem: Problem) -> dict[str, str | None]:
    """Return for each engine ``None`` if it accepts the problem, otherwise the reason.

    Parameters
    ----------
    problem : Problem
        The system and its parameters decide.

    Returns
    -------
    dict
        First what the vector field is emitted to, then how REBOUND takes it,
        then the methods by name.
    """
    found: dict[str, str | None] = {name: _emitted(problem, name) for name in LIBRARIES}
    found[BODIES] = _bodies(problem)
    found[FORCES] = _forces(problem)
    for name in integrators.registry.names():
        found[name] = method_reason(name, problem)
    return found


def method_reason(name: str, problem: Problem) -> str | None:
    """Return why a method does not accept a problem, or ``None``."""
    try:
        return _instance(integrators.registry.get(name)).accepts(problem)
    except InputError as error:  # a library that is missing among them
        return str(error)


def _instance(cls: type[MethodBase]) -> MethodBase:
    required = [field.name for field in dataclasses.fields(cls) if field.default is dataclasses.MISSING]
    for option in required:
        if option not in _REQUIRED:
            raise InputError(f"it has to be told its option {option!r} first.")
    given = {option: _REQUIRED[option] for option in required}
    try:
        return cls(**given)
    except InputError:  # one of two, such as a step or a tolerance, is left to the user
        return cls(h=1e-3, **given)  # type: ignore[call-arg]


def _emitted(problem: Problem, library: str) -> str | None:
    try:
        emit.source(problem.system, "field", library)
    except InputError as error:
        return str(error)
    return None


def _bodies(problem: Problem) -> str | None:
    if problem.system.bodies is not None:
        return None
    return "it is not a system of bodies with Newton's attraction."


def _forces(problem: Problem) -> str | None:
    system = problem.system
    if system.kind != "hamiltonian":
        return "it has no positions and momenta."
    if not system.separable:
        return "it is not separable: q'' is not a function of q alone."
    return None


def matrix(names: Sequence[str] = ()) -> tuple[list[str], dict[str, dict[str, str | None]]]:
    """Return the engines, and for each problem the reasons.

    Parameters
    ----------
    names : sequence of str
        Problems by name, at their defaults; all of them when empty.
    """
    rows = {name: reasons(problems.load(name)) for name in (names or problems.names())}
    engines = list(next(iter(rows.values()))) if rows else []
    return engines, rows


def table(names: Sequence[str] = ()) -> tuple[Table, list[str]]:
    """Return the matrix as a table, ✓ or the number of a reason, with the reasons in that order."""
    engines, rows = matrix(names)
    listed = list(dict.fromkeys(reason for row in rows.values() for reason in row.values() if reason))
    cells = [
        (name, *("✓" if row[one] is None else str(listed.index(row[one] or "") + 1) for one in engines))
        for name, row in rows.items()
    ]
    return Table("", ("problem", *engines), cells, words=range(len(engines) + 1)), listed
