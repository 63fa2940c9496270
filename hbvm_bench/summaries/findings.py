"""What an analysis of a formula or a problem gives, and which engine accepts it, and why not."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

import integrators.registry
import problems
from hbvm_bench.campaign import own
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.summaries.table import Table
from integrators.methods.automatic import exact_k
from integrators.peers.rebound.whfast512 import NO_AVX512
from integrators.protocol import MethodBase
from problems import targets
from problems.analysis import structure
from problems.catalogue import expression
from problems.errors import InputError, unknown
from problems.problem import Problem
from problems.systems.base import System
from problems.targets.latex import latex

SHORTEST = 3
"""Letters that a formula's only name may have: q, p10."""

DEGREES = (1, 2, 3, 4, 5)  # of the methods for which k is given
KINDS = {
    "hamiltonian": "canonical, q' = dH/dp, p' = -dH/dq",
    "poisson": "Poisson, y' = B(y) grad H(y)",
    "vector_field": "first-order system, y' = f(t, y)",
}

LIBRARIES = ("numpy", "numba", "jax", "heyoka")
BODIES, FORCES = "REBOUND's bodies", "REBOUND's forces"
# Values for what a method must be given: whether it accepts a problem does not depend on them.
_NUMBERS = {"h": 1e-3, "k": 4, "s": 2, "tol": 1e-10, "rtol": 1e-10, "atol": 1e-10}
_REQUIRED: dict[str, Any] = {**_NUMBERS, "invariants": ("energy",)}


@dataclasses.dataclass(frozen=True)
class Findings:
    """What was found."""

    name: str  # the formula, or the problem as it prints
    formula: str  # the energy as LaTeX; empty where there is none, or none that can be read
    kind: str  # ``"hamiltonian"``, ``"poisson"`` or ``"vector_field"``
    dimension: int  # length of the state
    separable: bool  # whether H = sum c_i p_i^2/2 + V(q, t)
    degree: int | None  # of the energy as a polynomial in the state; ``None`` if it is none
    exact: tuple[tuple[int, int], ...]  # pairs s, k: HBVM(k, s) conserves the energy, a polynomial, exactly
    cyclic: tuple[str, ...]  # positions that do not occur: their momenta are constant
    depends_on_time: bool  # whether the time occurs, so that the energy is not conserved
    invariants: tuple[str, ...]
    guards: tuple[str, ...]  # what stays exactly 0
    parameters: dict[str, Any]
    engines: dict[str, str | None]  # ``None`` for each engine that accepts it, otherwise the reason


def inspect(text: str, parameters: str = "") -> Findings:
    """Return what is found about a formula, ``"p^2/2 - cos(q)"``, or a problem, ``"kepler(e=0.9)"``.

    ``parameters`` are the values of the other names in a formula: ``"k=2, m=0.5"``.

    Raises
    ------
    problems.errors.InputError
        If it is neither.
    """
    problem = _problem(text)
    if problem is not None:
        if parameters:
            raise InputError(f"parameters belong to formulas; write them into the call: {text!r}.")
        return _describe(repr(problem), problem)
    system = expression.hamiltonian(text, parameters=expression.assignments(parameters))
    zeros = [0.5] * (system.dim // 2)  # no start is needed: engines are asked about the system
    return _describe(text.strip(), Problem(system, q0=zeros, p0=zeros, t_end=1.0))


def _problem(text: str) -> Problem | None:
    """Return the problem that a text names, or ``None`` if it is a formula."""
    if own.is_file(text):
        return own.read(text)
    try:
        name = parse_spec(text).name
    except InputError:
        name = text.partition("(")[0].strip()
    else:
        # A bare word or a call of one is a misspelt problem rather than a formula: q and p1 are shorter.
        if len(name) > SHORTEST and name not in problems.names():
            raise unknown("problem", name, problems.names())
    return make_problem(text) if name in problems.names() else None


def _describe(name: str, problem: Problem) -> Findings:
    system = problem.system
    energy = system.energy is not None
    degree = structure.degree(system, problem.par) if energy else None
    try:
        formula = latex(system) if energy else ""
    except InputError:
        formula = ""
    cyclic = structure.cyclic(system) if system.dof is not None else []
    values = system.unpack(problem.par)
    return Findings(
        name=name,
        formula=formula,
        kind=system.kind,
        dimension=system.dim,
        separable=system.separable,
        degree=degree,
        exact=() if degree is None else tuple((s, exact_k(degree, s)) for s in DEGREES),
        cyclic=tuple("q" if system.dof == 1 else f"q{place + 1}" for place in cyclic),
        depends_on_time=structure.depends_on_time(system),
        invariants=tuple(system.invariants),
        guards=tuple(system.guards),
        parameters={key: v.tolist() if isinstance(v, np.ndarray) else v for key, v in values.items()},
        engines=reasons(problem),
    )


def lines(findings: Findings) -> list[tuple[str, str]]:
    """Return the findings as pairs of a heading and a sentence."""
    canonical = findings.kind == "hamiltonian"
    freedom = f"{findings.dimension // 2} degrees of freedom, " if canonical else ""
    momenta = ", ".join(f"{name.replace('q', 'p')} is constant" for name in findings.cyclic)
    cyclic = f"{', '.join(findings.cyclic)}: {momenta}" if momenta else "none"
    separable = (
        "yes: H = sum of c p^2/2 + V(q), the second-order form applies"
        if findings.separable
        else "no: the first-order form applies"
    )
    accepted = ", ".join(name for name, reason in findings.engines.items() if reason is None)
    rows = [
        ("system", f"{KINDS[findings.kind]}; {freedom}{findings.dimension} unknowns"),
        ("H", findings.formula),
        ("parameters", ", ".join(f"{name} = {value!r}" for name, value in findings.parameters.items())),
        ("separable", separable if canonical else ""),
        ("polynomial", _polynomial(findings) if findings.kind != "vector_field" else ""),
        ("cyclic coordinates", cyclic if canonical else ""),
        ("time", "occurs: the energy is not conserved" if findings.depends_on_time else "does not occur"),
        ("invariants", ", ".join(findings.invariants) or "none known"),
        ("stays 0 by symmetry", ", ".join(findings.guards)),
        ("engines", accepted),
        *(
            ("not for", f"{name}: {reason}")
            for name, reason in findings.engines.items()
            if reason is not None
        ),
    ]
    return [row for row in rows if row[1]]


def _polynomial(findings: Findings) -> str:
    if findings.degree is None:
        return "not polynomial: the energy is conserved to round-off once k is large enough, never exactly"
    pairs = ", ".join(f"k = {k} for s = {s}" for s, k in findings.exact)
    return f"degree {findings.degree}: HBVM(k, s) conserves the energy exactly from {pairs}"


def reasons(problem: Problem) -> dict[str, str | None]:
    """Return for each engine ``None`` if it accepts the problem, otherwise the reason.

    First what the vector field is emitted to, then how REBOUND takes it, then the methods by name.
    """
    system, why = problem.system, "it is not a system of bodies with Newton's attraction."
    return {
        **{name: _emitted(problem, name) for name in LIBRARIES},
        BODIES: why if system.bodies is None else None,
        FORCES: _forces(system),
        **{name: _accepted(problem, name) for name in integrators.registry.names()},
    }


def _accepted(problem: Problem, name: str) -> str | None:
    try:
        return _instance(integrators.registry.get(name)).accepts(problem)
    except InputError as error:  # a library that is missing among them
        return str(error)


def _instance(cls: type[MethodBase]) -> MethodBase:
    required = [field.name for field in dataclasses.fields(cls) if field.default is dataclasses.MISSING]
    for option in required:
        if option not in _REQUIRED:
            raise InputError(f"its option {option!r} has to be given.")
    given = {option: _REQUIRED[option] for option in required}
    try:
        return cls(**given)
    except InputError:  # one of two, such as a step or a tolerance, is left to the user
        return cls(h=1e-3, **given)  # type: ignore[call-arg]


def _emitted(problem: Problem, library: str) -> str | None:
    try:
        targets.source(problem.system, "field", library)
    except InputError as error:
        return str(error)
    return None


def _forces(system: System) -> str | None:
    if system.kind != "hamiltonian":
        return "it has no positions and momenta."
    if not system.separable:
        return "it is not separable: q'' is not a function of q alone."
    return None


def matrix(names: Sequence[str] = ()) -> dict[str, dict[str, str | None]]:
    """Return the reasons of problems at their defaults; of all of them without names."""
    return {name: reasons(problems.load(name)) for name in (names or problems.names())}


def engines(names: Sequence[str] = (), *, any_processor: bool = False) -> tuple[Table, list[str]]:
    """Return the matrix as a table, ✓ or the number of a reason, with the reasons in that order.

    With ``any_processor`` a lack of this processor is no reason, so that the table is the same everywhere.
    """
    rows = matrix(names)
    if any_processor:
        rows = {
            name: {engine: None if why == NO_AVX512 else why for engine, why in row.items()}
            for name, row in rows.items()
        }
    listed = list(dict.fromkeys(reason for row in rows.values() for reason in row.values() if reason))
    signs = {None: "✓"} | {reason: str(number) for number, reason in enumerate(listed, 1)}
    cells = [(name, *(signs[reason] for reason in row.values())) for name, row in rows.items()]
    head = ("problem", *next(iter(rows.values())))
    return Table("", head, cells, words=range(len(head))), listed
