"""What makes two integrations the same: problem, method, grid, and the sources and versions of both.

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
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

import integrators.registry
import problems.registry
from hbvm_bench.campaign import own
from hbvm_bench.campaign.file import Case, Checks
from hbvm_bench.campaign.spec import Spec, parse_spec
from integrators.kernel.native import store as kept
from integrators.protocol import MethodBase
from problems import targets
from problems.errors import InputError, unknown
from problems.problem import Problem

OWN_PACKAGES = ("problems", "integrators", "hbvm_bench")
KERNEL = "integrators.kernel"
INTEGRATES = "hbvm_bench.measure.raw"  # what a worker process integrates a case with
CHAOS = "hbvm_bench.measure.chaos"  # and what it computes indicators of chaos with, where these are asked for
# They say, name and keep what is run; all that an integration can depend on of it is in the key. A
# reference is what it is compared with when it is read.
BOOKKEEPING = (
    *("hbvm_bench.campaign.", "hbvm_bench.store.", "hbvm_bench.reference."),
    *("integrators.plain", "problems.picture"),
)
TOLERANCES = ("tol", "rtol", "epsilon")  # a method that has one takes h for its first step alone
# A library's numbers also depend on what it computes with.
COMPUTES_WITH = {
    "hbvm-bench": ("numpy", "numba", "llvmlite"),
    "diffrax": ("diffrax", "jax", "jaxlib", "equinox", "lineax", "optimistix"),
    "scipy": ("scipy", "numpy", "numba"),
    "scikit-sundae": ("scikit-sundae", "numpy", "numba"),
    "pyhamsys": ("pyhamsys", "numpy", "numba"),
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
    problem = make_problem(case.problem)
    method = make_method(case.method)
    case.grid.times(problem)
    # not repr(method), which is a third party's own
    text = str(Spec(parse_spec(case.method).name, method.options()))
    canonical = msgspec.structs.replace(case, problem=repr(problem), method=text)
    key = case_key(canonical, problem, method)
    text = json.dumps(key, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return Resolved(canonical, problem, method, hashlib.sha256(text.encode()).hexdigest(), key)


@lru_cache(maxsize=64)
def make_problem(text: str) -> Problem:
    """Make the problem that ``text`` specifies; the last ones are kept, for a campaign has them often.

    No user's code is run: of a problem of the user's own the formula must be known (`own`).
    """
    spec = parse_spec(text)
    return own.find(spec) or problems.load(spec.name, **spec.arguments)


def typed_problem(text: str) -> Problem:
    """Make the problem that a user typed; if it is one of a Python file, the file is run."""
    return own.read(text) if own.is_file(text) else make_problem(text)


def make_method(text: str) -> MethodBase:
    """Make the method that ``text`` specifies; ``peers.alone:Taylor(...)`` is one of a study's own."""
    spec = parse_spec(text)
    try:
        if ":" in spec.name:
            return of_study(spec.name, "METHODS")(**spec.arguments)
        return integrators.registry.create(spec.name, **spec.arguments)
    except (InputError, ImportError) as error:
        raise InputError(f"{spec}: {error}") from None


def of_study(place: str, table: str) -> Any:
    """Return what a module of `hbvm_bench.studies` offers: ``"paper.report:compute"`` of a table in it.

    Raises
    ------
    problems.errors.InputError
        If there is no such module with this table, or no such name in it.
    """
    study, _, name = place.rpartition(":")
    try:
        known = getattr(import_module(f"hbvm_bench.studies.{study}"), table)
    except (ModuleNotFoundError, AttributeError):
        raise InputError(f"there is no study {study!r} with {table.lower()} of its own.") from None
    if name not in known:
        raise unknown(f"name in the {table.lower()} of {study}", name, known)
    return known[name]


def case_key(case: Case, problem: Problem, method: MethodBase) -> dict[str, Any]:
    """Return everything the numbers of a case depend on, as JSON values.

    Notes and settings labels are left out: they are words about the case.
    """
    grid = case.grid.times(problem, fixed_step(method))
    return (
        {
            "problem": case.problem,
            "field": targets.fingerprint(problem.system),
            "start": [value.hex() for value in (problem.t0, problem.t_end, *problem.y0.tolist())],
            "parameters": [value.hex() for value in problem.par.tolist()],
            "method": type(method).__name__,
            "options": {name: repr(value) for name, value in method.options(defaults=True).items()},
            "grid": hashlib.sha256(grid.tobytes()).hexdigest(),
            "versions": versions_of(method),
            "source": source_digest(method, case),
        }
        | {
            # a case without them keeps the id it had
            name: msgspec.to_builtins(asked)
            for name, asked in (("checks", case.checks), ("ensemble", case.ensemble))
            if asked not in (None, Checks())
        }
        | ({"own_steps": True} if case.grid.at_steps else {})  # the key that stored cases have
    )


def versions_of(method: MethodBase) -> dict[str, str]:
    """Return the versions of Python and of the libraries that a method's numbers depend on."""
    names = COMPUTES_WITH.get(method.library.lower(), (method.library,))
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


def of_method(method: MethodBase) -> dict[str, Any]:
    """Return what a record says of a method: its role, library and order."""
    role = "ours" if is_ours(method) else "peer"
    return {"role": role, "library": method.library, "order": method.order}


def is_ours(method: MethodBase) -> bool:
    """Whether this project, and not a peer, does the work of the method."""
    return method.library.lower() == "hbvm-bench"


def source_digest(method: MethodBase, case: Case) -> str:
    """Return the sha256 of the sources that decide about an integration.

    They are those of the method, of the problem, and of `INTEGRATES`, and what these
    import, at their heads or anywhere below, of our packages and of the method's and the problem's own. So
    a row of a peer is not stale because the kernel changed, nor one of ours because of a peer,
    nor any because of a reference, a metric, a fitted error growth, how times are taken, or a report.
    Comments, docstrings, the layout and what a problem's decorator says do not count. A problem of the user's
    own has no source: its name holds the digest of its formula.
    """
    spec = parse_spec(case.problem)
    made_in = [] if own.find(spec) else [problems.registry.factory(spec.name).__module__]
    asked = [CHAOS] if case.checks.chaos else []
    return digest_of((INTEGRATES, type(method).__module__, *made_in, *asked))


@cache
def digest_of(modules: tuple[str, ...]) -> str:
    """Return the sha256 of the `sources` of modules."""
    return hashlib.sha256(json.dumps(sources(modules), sort_keys=True).encode()).hexdigest()


@cache
def kernel_digest() -> str:
    """Return the sha256 of the kernel's sources; comments, docstrings and the layout do not count."""
    folder = Path(str(files(KERNEL)))
    places = (file.relative_to(folder).with_suffix("") for file in folder.rglob("*.py"))
    named = {".".join((KERNEL, *place.parts)).removesuffix(".__init__") for place in places}
    kernel = {name: digest for name, digest in sources(named).items() if name in named}
    return hashlib.sha256(json.dumps(kernel, sort_keys=True).encode()).hexdigest()


def sources(modules: Iterable[str]) -> dict[str, str]:
    """Return the digests of modules, and of what they import of our packages and theirs, by name."""
    left = list(modules)
    packages = {*OWN_PACKAGES, *(name.partition(".")[0] for name in left)}
    digests: dict[str, str] = {}
    while left:
        name = left.pop()
        if name in digests or name.startswith(BOOKKEEPING) or (path := _file_of(name)) is None:
            continue
        digests[name], imported = _read(name, path)
        left += [other for other in imported if other.partition(".")[0] in packages]
    return digests


@cache
def _file_of(module: str) -> Path | None:
    """Return a module's file; its outermost package has been imported."""
    package, *rest = module.split(".")
    top = sys.modules.get(package)
    if not hasattr(top, "__path__"):
        file = None if rest else getattr(top, "__file__", None)
        return Path(file) if file else None
    bases = [Path(place, *rest) for place in getattr(top, "__path__", ())]
    paths = [path for base in bases for path in (base / "__init__.py", base.with_name(f"{base.name}.py"))]
    return next((path for path in paths if path.is_file()), None)


def _read(module: str, path: Path) -> tuple[str, list[str]]:
    """Return the digest of a file's code and the modules that it names; kept by its content."""
    content = path.read_bytes()
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    rule = Path(__file__).read_bytes()  # digests that another version of this module made are of no use
    key = kept.key("source", rule, platform.python_version(), package, content)
    if (known := kept.get(key)) is not None:
        return json.loads(known)
    try:
        tree = ast.parse(content)
    except (SyntaxError, ValueError):  # a third party's, compiled
        return hashlib.sha256(content).hexdigest(), []
    imported = _imported(tree, package)
    for node in ast.walk(tree):
        if isinstance(body := getattr(node, "body", None), list):
            body[:] = [part for part in body if not _is_text(part)]
        if isinstance(node, ast.FunctionDef):  # what a problem says of itself is words too
            node.decorator_list = [part for part in node.decorator_list if _called(part) != "entry"]
    result = hashlib.sha256(ast.dump(tree, annotate_fields=False).encode()).hexdigest(), sorted(imported)
    kept.put(key, json.dumps(result).encode())
    return result


def _is_text(node: ast.AST) -> bool:
    """Whether a statement is a string alone: the docstring of what it stands in, or of what is before it."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _called(node: ast.expr) -> str:
    return getattr(node.func, "id", "") if isinstance(node, ast.Call) else ""


def _imported(tree: ast.Module, package: str) -> set[str]:
    """Return the modules, and what may be modules, that the imports of a file in a package name."""
    names: set[str] = set()
    left: list[Any] = [tree]
    while left:
        node = left.pop()
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            origin = ".".join([*above, *([node.module] if node.module else [])])
            names |= {origin} | {f"{origin}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Assign):
            made = node.value
            if isinstance(made, ast.Call) and _called(made) == "Engine":  # in `integrators.kernel.engines`
                names |= {f"{package}.{ast.literal_eval(made.args[0])}"}
        elif not (isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"):
            for blocks in ("body", "orelse", "finalbody", "handlers", "cases"):  # statements only: quick
                block = getattr(node, blocks, ())
                left += block if isinstance(block, list) else ()
    return names
