"""A campaign: a TOML file of problems and methods, and the cases it stands for."""

import math
import re
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, get_args, get_type_hints

import msgspec

from hbvm_bench.campaign.entries import (
    FILE_NAME,
    Checks,
    Ensemble,
    EnsembleEntry,
    Goal,
    Limits,
    MethodEntry,
    Page,
    ProblemEntry,
    Settings,
    TimingPlan,
)
from hbvm_bench.campaign.grid import Grid
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.campaign.sweep import PLACEHOLDER, Scalar, combinations, fill, names
from problems import limits
from problems.errors import InputError, unknown

STUDY = "study.toml"
"""The campaign's file in the folder of a study."""


class Campaign(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """What a campaign file says; see the files in ``hbvm_bench/studies``.

    Attributes
    ----------
    name, title, description : str
        The name is a file name; the other two are for readers.
    problems : list of str or ProblemEntry
        Problems as they print, or grids of them.
    methods : list of MethodEntry
        Every method runs on every problem, unless the entry says ``only`` where.
    ensembles : list of EnsembleEntry
        Many trajectories at once, beside the rest.
    goals : list of Goal
        What is asked for, declared before the run.
    grid, limits, timing, checks
        Shared by all cases.
    page : Page
        What its report keeps.
    computes : str
        What is computed beside the cases, such as ``"./blocks.py:tasks"``: a function that returns
        `hbvm_bench.measure.computation.Task`; see `hbvm_bench.campaign.folder`.
    quick : bool
        Whether only those settings are run that are marked for a quick run.
    """

    name: str
    problems: list[str | ProblemEntry] = []
    methods: list[MethodEntry] = []
    ensembles: list[EnsembleEntry] = []
    goals: list[Goal] = []
    title: str = ""
    description: str = ""
    grid: Grid = Grid()
    limits: Limits = Limits()
    timing: TimingPlan = TimingPlan()
    checks: Checks = Checks()
    page: Page = Page()
    computes: str = ""
    quick: bool = False

    def __post_init__(self) -> None:
        if not re.fullmatch(FILE_NAME, self.name):
            raise InputError(
                f"campaign name {self.name!r} must be a file name of letters, digits, '.', '_' and '-'."
            )

        if bool(self.problems) != bool(self.methods) or not (self.problems or self.ensembles):
            missing = "methods" if self.problems else "problems"
            raise InputError(f"campaign {self.name!r} has no {missing}; give at least one.")
        known = {name_of(entry) for entry in self.entries()}
        many = {name_of(item.entry) for item in self.ensembles}
        for entries, there in ((self.methods, known), (self.goals, known | many)):
            for name in (name for item in entries for name in item.only):
                if name not in there:
                    raise unknown("problem of the campaign", name, there)

    def entries(self) -> list[ProblemEntry]:
        """Return the problems' entries; one that is a text alone has neither values nor a sweep."""
        return [
            entry if isinstance(entry, ProblemEntry) else ProblemEntry(use=entry) for entry in self.problems
        ]

    def cases(self) -> list["Case"]:
        """Return the cases, problem by problem, in the order of the file; the ensembles' last."""
        limits.check(f"campaign {self.name!r}", "CASES", self._count(), "give fewer values to its sweeps")
        cases = [
            Case(
                problem=fill(entry.use, values),
                method=text,
                grid=entry.grid or self.grid,
                settings=method.settings,
                note=method.note,
                checks=self.checks,
            )
            for entry in self.entries()
            for values in chosen(entry)
            for method in self.methods
            for text in _settings(method, name_of(entry), values, self.quick)
        ]
        return cases + [
            Case(
                problem=entry.problem,
                method=text,
                settings=method.settings,
                note=method.note,
                ensemble=entry.ensemble,
            )
            for entry in self.ensembles
            for method in entry.methods
            for text in _settings(method, parse_spec(entry.problem).name, {}, self.quick)
        ]

    def _count(self) -> int:
        """Return how many cases there are, without making any."""
        pairs = [
            (entry.sweep, method)
            for entry in self.entries()
            for method in self.methods
            if not method.only or name_of(entry) in method.only
        ] + [({}, method) for entry in self.ensembles for method in entry.methods]
        return sum(
            len(method.texts) * math.prod(map(len, [*sweep.values(), *method.sweep.values()]))
            for sweep, method in pairs
        )


def name_of(entry: ProblemEntry) -> str:
    """Return what a campaign calls a problem."""
    return entry.name or parse_spec(text_of(entry)).name.rpartition(":")[2]


def text_of(entry: ProblemEntry) -> str:
    """Return the text of a problem with something in each placeholder, so that it can be parsed."""
    return PLACEHOLDER.sub("0", entry.use)


def chosen(entry: ProblemEntry) -> list[dict[str, Scalar]]:
    """Return the values of an entry, one dictionary for every combination of its sweep."""
    _all_used(entry.use, entry.sweep)
    return [entry.values | values for values in combinations(entry.sweep)]


def _settings(method: MethodEntry, problem: str, values: Mapping[str, Scalar], quick: bool) -> list[str]:
    if method.only and problem not in method.only:
        return []
    for text in method.texts:
        _all_used(text, method.sweep)
    swept = list(combinations(method.sweep))
    settings = [fill(text, {**values, **values_}) for text in method.texts for values_ in swept]
    return [settings[place] for place in method.quick] if quick and method.quick else settings


def _all_used(text: str, sweep: Mapping[str, object]) -> None:
    for name in sweep.keys() - names(text):
        raise InputError(
            f"{text}: the sweep gives values of {name!r}, which no placeholder {{{name}}} takes."
        )


class Case(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One integration to be measured; plain text, so that it travels to any process or machine.

    Attributes
    ----------
    problem, method : str
        Specifications, see `hbvm_bench.campaign.spec`.
    grid : Grid
        The sampling times.
    settings : str
        See `MethodEntry`.
    note : str
        See `MethodEntry`.
    checks : Checks
        What is looked at beside the trajectory.
    ensemble : Ensemble or None
        Many trajectories instead of one.
    """

    problem: str
    method: str
    grid: Grid = Grid()
    settings: Settings = "chosen"
    note: str = ""
    checks: Checks = Checks()
    ensemble: Ensemble | None = None


def shipped() -> dict[str, Path]:
    """Return the campaign files that come with the package, by name."""
    folder = Path(str(files("hbvm_bench.studies")))
    alone = {path.stem: path for path in folder.glob("*.toml")}
    folders = {path.parent.name: path for path in folder.glob(f"*/{STUDY}")}
    return dict(sorted((alone | folders).items()))


def file_of(name_or_path: str) -> Path:
    """Return where a campaign's file lies: a shipped one, a path ending in ``.toml``, or a folder.

    Raises
    ------
    problems.errors.InputError
        If there is none.
    """
    path = Path(name_or_path)
    if (path / STUDY).is_file():
        return path / STUDY
    if path.suffix == ".toml":
        if not path.is_file():
            raise InputError(f"there is no campaign file {name_or_path!r}.")
        return path
    if name_or_path not in shipped():
        if name_or_path and path.is_dir():
            raise InputError(f"the folder {name_or_path!r} has no {STUDY}.")
        raise unknown("campaign", name_or_path, shipped())
    return shipped()[name_or_path]


def load(name_or_path: str) -> Campaign:
    """Read a campaign: a shipped one, by its name, or a TOML file.

    Raises
    ------
    problems.errors.InputError
        If there is no such campaign, or its file is not a campaign.
    """
    try:
        text = file_of(name_or_path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read the campaign file {name_or_path!r}: {error}.") from None
    return parse(text, name_or_path)


def parse(text: str, source: str = "campaign") -> Campaign:
    """Read a campaign from TOML text; ``source`` names it in error messages."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}: not valid TOML: {error}.") from None
    except RecursionError:
        raise InputError(f"{source}: lists or tables are nested too deep, for a campaign.") from None
    _check_keys(data, Campaign, source)
    try:
        return msgspec.convert(data, Campaign)
    except msgspec.ValidationError as error:
        message = str(error).replace(" - at `$.", ", at `").replace(".,", ",").rstrip(".")
        raise InputError(f"{source}: {message}.") from None


def _check_keys(data: dict[str, Any], struct: type[msgspec.Struct], source: str) -> None:
    kinds = get_type_hints(struct)
    for key, value in data.items():
        if key not in kinds:
            raise InputError(f"{source}: {unknown('key', key, kinds)}")
        if key == "settings" and value not in get_args(Settings):
            raise InputError(f"{source}: {unknown('settings', str(value), get_args(Settings))}")
        inner = _struct_in(kinds[key])
        for item in value if isinstance(value, list) else [value]:
            if inner is not None and isinstance(item, dict):
                _check_keys(item, inner, source)


def _struct_in(kind: Any) -> type[msgspec.Struct] | None:
    """Return the struct that a type is or has in it."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        return kind
    return next(filter(None, map(_struct_in, get_args(kind))), None)
