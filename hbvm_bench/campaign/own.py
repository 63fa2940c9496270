"""Problems of the user's own: functions in Python files, run once and kept as the formulas they give.

``mine.py:swing(g=1.1)`` is a function of a file (or a `Problem` there). Its code is run where a user
asked for it and nowhere else: what it returns is kept, with the start and all numbers, as data named
by a digest, and the problem is then called ``mine.py@3f2a1c9e:swing(g=1.1)``. Processes that do the
cases, other machines and whoever reads a report get these data, not the file.
"""

import hashlib
import importlib
import importlib.util
import inspect
import json
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import msgspec
import numpy as np
from msgspec.structs import replace

from hbvm_bench.campaign.entries import ProblemEntry
from hbvm_bench.campaign.file import Campaign, chosen, name_of, text_of
from hbvm_bench.campaign.spec import Spec, file_of, parse_spec
from hbvm_bench.campaign.sweep import fill
from hbvm_bench.reference import solutions
from integrators.solution.plain import packed_problem, unpacked_problem
from problems.checks import Arguments
from problems.errors import InputError, shown, unknown
from problems.problem import Problem

DIGITS = 8  # of a digest, in a problem's name
KEPT = "@"


class _Place(NamedTuple):
    """Where a problem is written: ``mine.py``, ``3f2a1c9e``, ``swing``."""

    file: str
    digest: str
    function: str

    @classmethod
    def from_spec(cls, spec: Spec) -> "_Place":
        file, _, function = spec.name.rpartition(":")
        name, _, digest = (file, "", "") if file.endswith(".py") else file.rpartition(KEPT)
        return cls(name, digest, function)


class Beside(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What must be known of a problem beside its text: JSON, empty where nothing must.

    Attributes
    ----------
    formula : str
        Of a problem of the user's own.
    reference : str
        A reference that does not come with the package.
    """

    formula: str = ""
    reference: str = ""


@dataclass(frozen=True)
class Known:
    """What is known of problems beside their texts, for whoever makes them or looks for their references.

    Attributes
    ----------
    formulas : mapping of str to str
        Of problems of the user's own: JSON, by the text that the problem prints as.
    references : mapping
        Those that do not come with the package; see `hbvm_bench.reference.solutions.find`.
    """

    formulas: Mapping[str, str] = field(default_factory=dict)
    references: solutions.References = field(default_factory=dict)

    def __or__(self, other: "Known") -> "Known":
        return Known({**self.formulas, **other.formulas}, {**self.references, **other.references})

    def beside(self, problem: Problem) -> Beside:
        """Return what another process needs for a problem."""
        file = self.references.get(solutions.key_of(problem)) if self.references else None
        return Beside(
            formula=self.formulas.get(repr(problem), ""),
            reference="" if file is None else solutions.encode(file),
        )

    def problem(self, spec: Spec) -> Problem | None:
        """Return a problem of the user's own; ``None`` for a text that is no file's.

        Raises
        ------
        problems.errors.InputError
            If its formula is not known: no code is run for it.
        """
        if not is_own(spec):
            return None
        if text := self.formulas.get(str(spec)):
            return _unpacked(text)
        why = "its formula should lie beside the results of its run, and does not"
        why = why if _Place.from_spec(spec).digest else "no Python file is run here"
        raise InputError(f"the problem {shown(str(spec))} is not known: {why}.")


NOTHING = Known()


def known_from(beside: Beside) -> Known:
    """Return what another process knew of a problem.

    Raises
    ------
    ValueError, TypeError, LookupError
        If it is damaged.
    """
    formulas, references = {}, {}
    if beside.formula:
        formulas[repr(_unpacked(beside.formula))] = beside.formula
    if beside.reference:
        file = solutions.decode(beside.reference)
        references[file.key] = file
    return Known(formulas, references)


def is_own(spec: Spec) -> bool:
    """Whether a problem is one of a Python file, and not of a registry."""
    return bool(_Place.from_spec(spec).file)


def read(text: str) -> Problem:
    """Run the Python file of a problem, such as ``mine.py:swing(g=1.1)``, and return the problem.

    Raises
    ------
    problems.errors.InputError
        If there is no such file, name or argument, if the file raises, or gives no problem.
    """
    return _Files(None).problem(parse_spec(text))


def is_file(text: str) -> bool:
    """Whether a text names a problem in a Python file, which has to be run."""
    return file_of(text).endswith(".py")


def opened(campaign: Campaign, folder: Path | None, tell: Callable[[str], None]) -> tuple[Campaign, Known]:
    """Return a campaign whose problems from Python files are kept as formulas, and these; the files are run.

    The Python files must lie in ``folder``, beside the campaign's, or without one anywhere; ``tell``
    is called with the name of each before it is run.

    Raises
    ------
    problems.errors.InputError
        As of `read`, and for a problem that is no formula.
    """
    files = _Files(folder)
    texts = [text_of(entry) for entry in campaign.entries()] + [
        ensemble.problem for ensemble in campaign.ensembles
    ]
    asked = dict.fromkeys(file_of(text) for text in texts if is_file(text))
    for file in asked:
        files.path(file)
        tell(file)
    if not asked:
        return campaign, NOTHING
    kept = replace(
        campaign,
        problems=[ensemble for entry in campaign.entries() for ensemble in _kept(entry, files)],
        ensembles=[
            replace(ensemble, problem=files.kept(ensemble.problem)) if is_file(ensemble.problem) else ensemble
            for ensemble in campaign.ensembles
        ],
    )
    return kept, Known(files.formulas)


def _kept(entry: ProblemEntry, files: "_Files") -> list[ProblemEntry]:
    """Return an entry with its problem kept: one entry for each of its sweep's combinations."""
    if not is_file(text_of(entry)):
        return [entry]
    return [
        replace(entry, use=files.kept(fill(entry.use, values)), values=values, sweep={}, name=name_of(entry))
        for values in chosen(entry)
    ]


class _Files:
    """Python files, each of which is run once; they must lie in ``folder``, if there is one."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self.modules: dict[Path, ModuleType] = {}
        self.formulas: dict[str, str] = {}  # of what was kept

    def kept(self, text: str) -> str:
        """Keep the formula of a file's problem, and return what this is called then."""
        spec = parse_spec(text)
        problem, place = self.problem(spec), _Place.from_spec(spec)
        if not problem.system.traced:
            raise InputError(
                f"{spec} is no formula but a function that is called; a run keeps problems as formulas: "
                "write it as a problems.VectorField or a problems.Hamiltonian."
            )
        named = _titled(problem, f"{place.file}{KEPT}{_digest(problem)}:{place.function}", spec.arguments)
        self.formulas[repr(named)] = _packed(named)
        return repr(named)

    def problem(self, spec: Spec) -> Problem:
        """Return the problem that a file gives."""
        place = _Place.from_spec(spec)
        path = self.path(place.file)
        with _importing_from(path.parent):
            if path not in self.modules:
                self.modules[path] = _module(path, place.file)
            problem = _called(spec, place, self.modules[path])
        return _titled(problem, f"{place.file}:{place.function}", spec.arguments)

    def path(self, file: str) -> Path:
        """Return where a file lies, if it may be run."""
        if self.folder is None:
            path = Path(file).expanduser()
        elif Path(file).name != file:
            raise InputError(
                f"{file} does not lie beside the campaign file; a campaign runs only Python files that do, "
                f"by their names alone: {Path(file).name}."
            )
        else:
            path = self.folder / file
            if path.is_file() and path.resolve().parent != self.folder.resolve():
                raise InputError(
                    f"{file} is a link out of the campaign's folder; a campaign runs only Python files in it."
                )
        if not path.is_file():
            where = "" if self.folder is None else " beside the campaign file"
            raise InputError(f"there is no Python file {file!r}{where}.")
        return path.resolve()


@contextmanager
def _importing_from(folder: Path) -> Iterator[None]:
    """Let imports find the modules of a folder, and forget these afterwards: names may be taken twice."""
    before, writes = set(sys.modules), sys.dont_write_bytecode
    sys.path.insert(0, str(folder))
    sys.dont_write_bytecode = True  # nothing is left in the user's folder
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(str(folder))
        sys.dont_write_bytecode = writes
        for name in sys.modules.keys() - before:
            origin = getattr(sys.modules[name], "__file__", None)
            if origin and folder in Path(origin).parents:
                del sys.modules[name]


def _module(path: Path, file: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with _one_sentence(path, f"{file} cannot be run"):
        spec.loader.exec_module(module)
    return module


def _called(spec: Spec, place: _Place, module: ModuleType) -> Problem:
    """Return what a name of a module is or, as a function, gives."""
    place_name = f"{place.file}:{place.function}"
    if not hasattr(module, place.function) or place.function.startswith("_"):
        named = vars(module).items()
        known = {key for key, item in named if isinstance(item, Problem) or _is_function(item, module)}
        raise unknown(f"problem of {place.file}", place.function, known)
    target = getattr(module, place.function)
    if isinstance(target, Problem):
        if spec.arguments:
            raise InputError(f"{place_name} is a problem and takes no arguments; write {place_name}.")
        return target
    if not callable(target):
        raise InputError(
            f"{place_name} is {shown(target)}, neither a problem nor a function that returns one."
        )
    if not hasattr(target, "entry"):  # which checks its own
        try:
            signature = inspect.signature(target)
        except (TypeError, ValueError):
            raise InputError(
                f"{place_name} does not tell its arguments; wrap it in a function of yours."
            ) from None
        if not any(
            item.kind in (item.VAR_POSITIONAL, item.VAR_KEYWORD) for item in signature.parameters.values()
        ):
            Arguments(place_name, signature).check_names((), spec.arguments)
    with _one_sentence(Path(str(module.__file__)), f"{spec} cannot be made"):
        problem = target(**spec.arguments)
    if not isinstance(problem, Problem):
        raise InputError(f"{place_name} returns {shown(problem)}, not a problems.Problem.")
    return problem


def _is_function(value: object, module: ModuleType) -> bool:
    return inspect.isfunction(value) and value.__module__ == module.__name__ and value.__name__[0] != "_"


@contextmanager
def _one_sentence(path: Path, start: str) -> Iterator[None]:
    """Tell in one sentence, with the line of the file, whatever a user's code raises."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{start}: {error}") from error
    except (Exception, SystemExit) as error:
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == str(path)]
        line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
        words = error.msg if isinstance(error, SyntaxError) else " ".join(str(error).split()).rstrip(".")
        where = "" if line is None else f" in line {line}"
        raise InputError(f"{start}, {type(error).__name__}{where}: {words or 'no message'}.") from error


def _titled(problem: Problem, name: str, arguments: Mapping[str, Any]) -> Problem:
    """Return a problem under the name by which a command line or a campaign has it."""
    return problem.with_metadata(
        name=name,
        title=name.rpartition(":")[2] if problem.title == problem.system.name else problem.title,
        arguments=arguments,
        references=problem.references,
        notes=problem.notes,
    )


def _digest(problem: Problem) -> str:
    """Return some digits of the SHA-256 of all that numbers depend on: no titles, notes or comments."""
    arrays = [None if array is None else array.tolist() for array in (problem.y0, problem.par, problem.times)]
    whole = [type(problem.system).__name__, problem.system.__getstate__(), arrays, problem.t0, problem.t_end]
    return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()[:DIGITS]


def _packed(problem: Problem) -> str:
    arrays: dict[str, np.ndarray] = {}
    plain = packed_problem(problem, arrays)
    return json.dumps({"problem": plain, "arrays": {name: a.tolist() for name, a in arrays.items()}})


@lru_cache(maxsize=64)
def _unpacked(text: str) -> Problem:
    plain = json.loads(text)
    problem = unpacked_problem(plain["problem"], {name: np.array(a) for name, a in plain["arrays"].items()})
    assert problem is not None
    if _Place.from_spec(parse_spec(repr(problem))).digest != _digest(problem):
        raise ValueError("a problem is not the one that its name says")
    return problem
