"""What makes two runs of a case the same: names, options, versions, sources.

The id of a case is the sha256 of canonical JSON of all this. A rerun therefore
does only what is missing or stale, and two stores can be merged by id.
"""

import hashlib
import inspect
import json
import platform
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

import integrators.registry
import problems
from hbvm_bench import reference
from hbvm_bench.campaign import Case, Checks
from hbvm_bench.spec import Spec, parse_spec
from integrators.protocol import MethodBase
from problems.errors import InputError
from problems.problem import Problem

OWN_PACKAGES = ("problems", "integrators")
# The modules of this package whose change changes a measured number.
MEASURING_MODULES = (
    *("worker.py", "measure.py", "reference.py", "metrics.py", "quantities.py", "timing.py"),
    *("checks.py", "drift.py", "ensemble.py", "laws.py", "solve.py", "starts.py"),
)
# The other direction, the conformance kit: no case runs them.
UNUSED = ("integrators/plugins/", "integrators/testing.py", "integrators/exercises.py")
# A row of a peer is not stale because our kernel changed, nor ours because of a peer.
UNUSED_BY_OURS = ("integrators/peers/",)
UNUSED_BY_PEERS = (
    "integrators/kernel/",
    *(
        f"integrators/{name}.py"
        for name in ("automatic", "gauss", "hbvm", "legendre", "line_integral", "tableau")
    ),
)
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
        "source": source_digest(method),
        "method_source": _module_digest(type(method)),
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


def source_digest(method: MethodBase) -> str:
    """Return the sha256 of our own sources that decide about the measured numbers of a method."""
    return _digest_without(UNUSED_BY_PEERS if _is_peer(method) else UNUSED_BY_OURS if is_ours(method) else ())


def _is_peer(method: MethodBase) -> bool:
    return type(method).__module__.startswith("integrators.peers.")


@cache
def _digest_without(unused: tuple[str, ...]) -> str:
    digest = hashlib.sha256()
    for name, path in sources(unused):
        digest.update(f"{name}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def sources(unused: tuple[str, ...]) -> list[tuple[str, Path]]:
    """Return the files that decide about measured numbers, by name, without those that begin as given."""
    paths: list[tuple[str, Path]] = []
    for package in OWN_PACKAGES:
        root = Path(str(files(package)))
        paths += [(f"{package}/{p.relative_to(root).as_posix()}", p) for p in root.rglob("*.py")]
    here = Path(str(files("hbvm_bench")))
    paths += [(f"hbvm_bench/{name}", here / name) for name in MEASURING_MODULES]
    return sorted(item for item in paths if not item[0].startswith((*UNUSED, *unused)))


def _reference_digest(problem: Problem) -> str:
    stored = reference.find_file(problem)
    if stored is None:
        return ""
    return hashlib.sha256(msgspec.json.encode([stored.t, stored.y])).hexdigest()


@cache
def _module_digest(cls: type) -> str:
    # a third party's method is not covered by source_digest
    try:
        return hashlib.sha256(Path(inspect.getfile(cls)).read_bytes()).hexdigest()
    except (OSError, TypeError):
        return ""


@cache
def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"
