"""What makes two integrations the same: problem, method, grid, and what is installed.

The id of a case is the sha256 of canonical JSON of all this. A rerun therefore
does only what is missing or stale, and two stores can be merged by id.
"""

import hashlib
import json
import platform
import sys
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

import integrators.registry
import problems.registry
from hbvm_bench.campaign import folder, own
from hbvm_bench.campaign.file import Case, Checks
from hbvm_bench.campaign.spec import Spec, parse_spec
from integrators.protocol import MethodBase
from problems import targets
from problems.errors import InputError, unknown
from problems.problem import Problem

OWN = ("problems", "integrators", "hbvm_bench")
MEASURING = ("problems", "integrators", "hbvm_bench.measure")
"""What the numbers of a case come from."""
JUDGING = ("drift.py", "measured.py", "metrics.py", "reading.py")
"""But for these: what they compute from the arrays of a case, they compute whenever it is read."""
KERNEL = "integrators.kernel"
TOLERANCES = ("tol", "rtol", "epsilon")  # a method that has one takes h for its first step alone


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
    times : ndarray
        The sampling times.
    beside : own.Beside
        What must be known of the problem beside its text.
    """

    case: Case
    problem: Problem
    method: MethodBase
    id: str
    times: NDArray[np.float64]
    beside: own.Beside


def resolve(case: Case, known: own.Known = own.NOTHING) -> Resolved:
    """Check the names and options of a case and give it its id.

    Raises
    ------
    problems.errors.InputError
        For an unknown name or option, with the nearest names, or a value that
        the problem or the method refuses.
    """
    problem = make_problem(case.problem, known)
    method = make_method(case.method)
    times = case.grid.times(problem, fixed_step(method), known.references)
    # not repr(method), which is a third party's own
    text = str(Spec(parse_spec(case.method).name, method.options()))
    canonical = msgspec.structs.replace(case, problem=repr(problem), method=text)
    key = case_key(canonical, problem, method, times)
    text = json.dumps(key, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    number = hashlib.sha256(text.encode()).hexdigest()
    return Resolved(canonical, problem, method, number, times, known.beside(problem))


def make_problem(text: str, known: own.Known = own.NOTHING) -> Problem:
    """Make the problem that ``text`` specifies; of one of the user's own the formula must be ``known``."""
    return known.problem(parse_spec(text)) or _registered(text)


@lru_cache(maxsize=64)  # a campaign has them often
def _registered(text: str) -> Problem:
    spec = parse_spec(text)
    return problems.load(spec.name, **spec.arguments)


def printed(text: str) -> str:
    """Return the problem that ``text`` specifies as cases and records have it: as it prints."""
    spec = parse_spec(text)
    return str(spec) if own.is_own(spec) else repr(_registered(text))


def typed_problem(text: str) -> Problem:
    """Make the problem that a user typed; if it is one of a Python file, the file is run."""
    return own.read(text) if own.is_file(text) else make_problem(text)


def make_method(text: str) -> MethodBase:
    """Make the method that ``text`` specifies; ``peers.alone:Taylor(...)`` is one of a study's own."""
    spec = parse_spec(text)
    try:
        if ":" in spec.name:
            return _of_study(spec.name)(**spec.arguments)
        return integrators.registry.create(spec.name, **spec.arguments)
    except (InputError, ImportError) as error:
        raise InputError(f"{spec}: {error}") from None


def _of_study(place: str) -> type[MethodBase]:
    """Return a method of a module of `hbvm_bench.studies`, as ``"peers.alone:Taylor"``."""
    study, _, name = place.rpartition(":")
    try:
        known = import_module(f"hbvm_bench.studies.{study}").METHODS
    except (ModuleNotFoundError, AttributeError):
        raise InputError(f"there is no study {study!r} with methods of its own.") from None
    if name not in known:
        raise unknown(f"name in the methods of {study}", name, known)
    return known[name]


def case_key(case: Case, problem: Problem, method: MethodBase, times: NDArray[np.float64]) -> dict[str, Any]:
    """Return everything the numbers of a case depend on, as JSON values.

    Notes and settings labels are left out: they are words about the case.
    """
    return (
        {
            "problem": case.problem,
            "field": targets.fingerprint(problem.system),
            "start": [value.hex() for value in (problem.t0, problem.t_end, *problem.y0.tolist())],
            "parameters": [value.hex() for value in problem.par.tolist()],
            "method": f"{type(method).__module__}.{type(method).__name__}",
            "options": {name: repr(value) for name, value in method.options(defaults=True).items()},
            "grid": hashlib.sha256(times.tobytes()).hexdigest(),
            "versions": versions_of(method),
            "source": source_digest(method, case),
        }
        | {
            # a case without them keeps the id it had
            name: msgspec.structs.asdict(asked)  # with defaults, which msgspec tells by the object
            for name, asked in (("checks", case.checks), ("ensemble", case.ensemble))
            if asked not in (None, Checks())
        }
        | ({"at_steps": True} if case.grid.at_steps else {})
    )


def versions_of(method: MethodBase) -> dict[str, str]:
    """Return the versions of Python and of the libraries that a method's numbers depend on."""
    names = (method.library, *method.computes_with)
    return {"python": platform.python_version()} | {name: version_of(name) for name in names}


@cache
def version_of(library: str) -> str:
    """Return the installed version of a library, or ``"not installed"``."""
    try:
        return version(library.lower())
    except PackageNotFoundError:
        return "not installed"


def fixed_step(method: MethodBase) -> float | None:
    """Return the length that all steps of a method have; ``None`` where it chooses its steps."""
    tolerances = (getattr(method, name, None) for name in TOLERANCES)
    return None if any(tolerances) else getattr(method, "h", None)


def is_ours(method: MethodBase) -> bool:
    """Whether this project, and not a peer, does the work of the method."""
    return method.library.lower() == "hbvm-bench"


def source_digest(method: MethodBase, case: Case) -> str:
    """Return the sha256 of the sources that decide about an integration.

    They are `installed`, and the files of a method and a problem that another distribution brings. A problem
    of the user's own has no source: its name holds the digest of its formula.
    """
    spec = parse_spec(case.problem)
    made_in = [] if own.is_own(spec) else [problems.registry.factory(spec.name).__module__]
    theirs = [name for name in (type(method).__module__, *made_in) if name.partition(".")[0] not in OWN]
    whole = hashlib.sha256(installed().encode())
    for name in theirs:
        if file := getattr(sys.modules[name], "__file__", None):
            whole.update(Path(file).read_bytes())
    return whole.hexdigest()


@cache
def installed() -> str:
    """Return the sha256 of the Python files of `MEASURING`, whose edit makes every result stale."""
    whole = hashlib.sha256(version_of("hbvm-bench").encode())
    for package in MEASURING:
        whole.update(folder.digest(Path(str(files(package))), JUDGING).encode())
    return whole.hexdigest()


@cache
def kernel_digest() -> str:
    """Return the sha256 of the kernel's sources."""
    return folder.digest(Path(str(files(KERNEL))))
