"""What makes two runs of a case the same: names, options, versions, sources.

The id of a case is the sha256 of canonical JSON of all this. A rerun therefore
does only what is missing or stale, and two stores can be merged by id.
"""

import ast
import hashlib
import json
import platform
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

import integrators.registry
import problems.registry
from hbvm_bench import reference
from hbvm_bench.campaign import Case, Checks
from hbvm_bench.spec import Spec, parse_spec
from integrators.protocol import MethodBase
from problems.errors import InputError
from problems.problem import Problem

OWN_PACKAGES = ("problems", "integrators", "hbvm_bench")
WORKER = "hbvm_bench.worker"  # the process that makes the numbers
# A library's numbers also depend on what it computes with.
COMPUTES_WITH = {
    "hbvm-bench": ("numpy", "numba", "llvmlite"),
    "diffrax": ("diffrax", "jax", "jaxlib", "equinox", "lineax", "optimistix"),
    "scipy": ("scipy", "numpy", "numba"),
}


@dataclass(frozen=True)
class Resolved:
    """A case whose names and options have been checked.

    Attributes
    ----------
    case : Case
        With canonical texts.
    problem : Problem
        Made from the case's text.
    method : MethodBase
        Made from the case's text; its library may still be missing.
    id : str
        sha256 in hexadecimal.
    key : dict
        What was hashed.
    """

    case: Case
    problem: Problem
    method: MethodBase
    id: str
    key: dict[str, Any]


def resolve(case: Case) -> Resolved:
    """Check the names and options of a case and give it its id.

    Raises
    ------
    problems.errors.InputError
        For an unknown name or option, with the nearest names, or a value that
        the problem or the method refuses.
    """
    problem = _problem(case.problem)
    method = make_method(case.method)
    case.grid.times(problem)
    # not repr(method), which is a third party's own
    text = str(Spec(parse_spec(case.method).name, method.options()))
    canonical = msgspec.structs.replace(case, problem=repr(problem), method=text)
    key = case_key(canonical, problem, method)
    text = json.dumps(key, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return Resolved(canonical, problem, method, hashlib.sha256(text.encode()).hexdigest(), key)


@lru_cache(maxsize=64)
def _problem(text: str) -> Problem:
    # a campaign has the same few problems again and again, and tracing one takes a while
    return make_problem(text)


def make_problem(text: str) -> Problem:
    """Make the problem that ``text`` specifies."""
    spec = parse_spec(text)
    return problems.load(spec.name, **spec.arguments)


def make_method(text: str) -> MethodBase:
    """Make the method that ``text`` specifies."""
    spec = parse_spec(text)
    try:
        return integrators.registry.create(spec.name, **spec.arguments)
    except (InputError, ImportError) as error:
        raise InputError(f"{spec}: {error}") from None


def case_key(case: Case, problem: Problem, method: MethodBase) -> dict[str, Any]:
    """Return everything the numbers of a case depend on, as JSON values.

    Notes and settings labels are left out: they are words about the case.
    """
    grid = case.grid.times(problem)
    return {
        "problem": case.problem,
        "field": problem.system.fingerprint,
        "start": [value.hex() for value in (problem.t0, problem.t_end, *problem.y0.tolist())],
        "parameters": [value.hex() for value in problem.par.tolist()],
        "method": type(method).__name__,
        "options": {name: repr(value) for name, value in method.options(defaults=True).items()},
        "grid": hashlib.sha256(grid.tobytes()).hexdigest(),
        "versions": versions_of(method),
        "reference": _reference_digest(problem),
        "source": source_digest(method, case),
    } | {
        # a case without them keeps the id it had
        name: msgspec.to_builtins(asked)
        for name, asked in (("checks", case.checks), ("ensemble", case.ensemble))
        if asked not in (None, Checks())
    }


def versions_of(method: MethodBase) -> dict[str, str]:
    """Return the versions of Python and of the libraries that a method's numbers depend on."""
    names = COMPUTES_WITH.get(method.library.lower(), (method.library,))
    return {"python": platform.python_version()} | {name: _version(name) for name in names}


def version_of_library(library: str) -> str:
    """Return the installed version of a method's library, or ``"not installed"``."""
    return _version(library.lower())


def is_ours(method: MethodBase) -> bool:
    """Whether this project, and not a peer, does the work of the method."""
    return method.library.lower() == "hbvm-bench"


def source_digest(method: MethodBase, case: Case) -> str:
    """Return the sha256 of the sources that decide about the measured numbers of a case.

    They are those that the worker process imports: its own, the method's and the problem's, and
    what these import of our packages, at their heads or anywhere below. So a row of a peer is
    not stale because our kernel changed, nor one of ours because of a peer, nor any because of a report.
    """
    problem = problems.registry.factory(parse_spec(case.problem).name)
    return digest_of((WORKER, type(method).__module__, problem.__module__))


@cache
def digest_of(modules: tuple[str, ...]) -> str:
    """Return the sha256 of the `sources` of modules."""
    digest = hashlib.sha256()
    for name, path in sorted(sources(modules).items()):
        digest.update(f"{name}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def sources(modules: Iterable[str]) -> dict[str, Path]:
    """Return the files of modules, and of what they import of our packages, by the modules' names."""
    found: dict[str, Path] = {}
    left = list(modules)
    while left:
        name = left.pop()
        if name not in found and (path := _file_of(name)) is not None:
            found[name] = path
            left += [other for other in _imported(path, name) if other.partition(".")[0] in OWN_PACKAGES]
    return found


@cache
def _file_of(module: str) -> Path | None:
    """Return a module's file; for a third party's it must have been imported."""
    package, *rest = module.split(".")
    if package not in OWN_PACKAGES:
        file = getattr(sys.modules.get(module), "__file__", None)
        return Path(file) if file else None
    base = Path(str(files(package))).joinpath(*rest)
    return next((path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()), None)


@cache
def _imported(path: Path, module: str) -> frozenset[str]:
    """Return the modules, and what may be modules, that a file names in its imports."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found: set[str] = set()
    left: list[Any] = [ast.parse(path.read_bytes())]
    while left:
        node = left.pop()
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            origin = ".".join([*above, *([node.module] if node.module else [])])
            found |= {origin} | {f"{origin}.{alias.name}" for alias in node.names}
        elif not (isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"):
            for blocks in ("body", "orelse", "finalbody", "handlers", "cases"):  # statements only: quick
                block = getattr(node, blocks, ())
                left += block if isinstance(block, list) else ()
    return frozenset(found)


def _reference_digest(problem: Problem) -> str:
    stored = reference.find_file(problem)
    if stored is None:
        return ""
    return hashlib.sha256(msgspec.json.encode([stored.t, stored.y])).hexdigest()


@cache
def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"
