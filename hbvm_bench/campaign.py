"""A campaign: a TOML file of problems and methods, and the cases it stands for."""

import re
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from problems.errors import InputError, unknown
from problems.problem import Problem

Settings = Literal["default", "recommended", "as published", "outside its domain"]
Role = Literal["ours", "peer"]

Positive = Annotated[float, Meta(gt=0)]
Count = Annotated[int, Meta(ge=1)]


class Grid(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """The sampling times that every case of a campaign shares.

    Attributes
    ----------
    step : float, optional
        Distance of the samples in the problem's unit of time.
    count : int, optional
        Number of equal intervals.

    Without either: the problem's own grid, or else 1000 equal intervals.
    """

    step: Positive | None = None
    count: Count | None = None

    def __post_init__(self) -> None:
        if self.step is not None and self.count is not None:
            raise InputError("a grid has a step or a count, not both.")

    def times(self, problem: Problem) -> NDArray[np.float64]:
        """Return the sampling times from ``t0`` to ``t_end``, both included, shape (n,)."""
        span = problem.t_end - problem.t0
        if self.step is None and self.count is None and problem.times is not None:
            return np.asarray(problem.times, dtype=np.float64)
        if self.step is None:
            count = self.count or 1000
            return problem.t0 + span * np.arange(count + 1) / count
        whole = round(abs(span) / self.step)
        if whole > 10_000_000:
            raise InputError(f"a grid step of {self.step!r} gives {whole} samples; make it larger.")
        times = problem.t0 + np.copysign(self.step, span) * np.arange(whole + 1)
        inside = times[np.abs(times - problem.t0) < abs(span) * (1 - 1e-12)]
        return np.append(inside, problem.t_end)


class Limits(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What one case may use before it is ended and reported.

    Attributes
    ----------
    wall_seconds : float
        Wall time of one process.
    memory_gib : float
        Resident memory of one process, in GiB.
    """

    wall_seconds: Positive = 120.0
    memory_gib: Positive = 4.0


class TimingPlan(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The serial timing pass: every round visits every case once, in a fresh process.

    Attributes
    ----------
    rounds : int
        Rounds over all cases; a machine that changes its speed touches all alike.
    samples : int
        Samples of each case in one round.
    shortest : float
        A sample repeats the integration until it lasts this many seconds.
    budget : float
        Seconds of sampling per case and round; at least one sample is taken.
    """

    rounds: Count = 3
    samples: Count = 2
    shortest: Positive = 0.02
    budget: Positive = 8.0


class MethodEntry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One method of a campaign file.

    Attributes
    ----------
    use : str
        The method as it prints, such as ``"Taylor(tol=1e-15)"``.
    settings : str
        Whether these are the library's defaults, what its authors recommend for
        such a problem, the settings of a published experiment, or a use that the
        method was not made for.
    note : str
        A sentence that the report prints beside the row.
    """

    use: str
    settings: Settings = "recommended"
    note: str = ""


class Campaign(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a campaign file says; see ``hbvm_bench/campaigns/sitnikov.toml`` for one.

    Attributes
    ----------
    name, title, description : str
        The name is a file name; the other two are for readers.
    problems : list of str
        Problems as they print.
    methods : list of MethodEntry
        Every method runs on every problem.
    grid, limits, timing
        Shared by all cases.
    """

    name: str
    problems: Annotated[list[str], Meta(min_length=1)]
    methods: Annotated[list[MethodEntry], Meta(min_length=1)]
    title: str = ""
    description: str = ""
    grid: Grid = Grid()
    limits: Limits = Limits()
    timing: TimingPlan = TimingPlan()

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", self.name):
            raise InputError(
                f"campaign name {self.name!r} must be a file name of letters, digits, '.', '_' and '-'."
            )

    def cases(self) -> list["Case"]:
        """Return the cases, problem by problem, in the order of the file."""
        return [
            Case(
                problem=problem,
                method=entry.use,
                grid=self.grid,
                settings=entry.settings,
                note=entry.note,
            )
            for problem in self.problems
            for entry in self.methods
        ]


class Case(msgspec.Struct, frozen=True, kw_only=True):
    """One integration to be measured; plain text, so that it travels to any process or machine.

    Attributes
    ----------
    problem, method : str
        Specifications, see `hbvm_bench.spec`.
    grid : Grid
        The sampling times.
    settings : str
        See `MethodEntry`.
    note : str
        See `MethodEntry`.
    """

    problem: str
    method: str
    grid: Grid = Grid()
    settings: Settings = "recommended"
    note: str = ""


def shipped() -> dict[str, Path]:
    """Return the campaign files that come with the package, by name."""
    folder = Path(str(files("hbvm_bench") / "campaigns"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load(name_or_path: str) -> Campaign:
    """Read a campaign.

    Parameters
    ----------
    name_or_path : str
        The name of a shipped campaign, or the path of a TOML file.

    Returns
    -------
    Campaign

    Raises
    ------
    problems.errors.InputError
        If there is no such campaign, or its file is not a campaign.
    """
    path = Path(name_or_path)
    if path.suffix == ".toml":
        if not path.is_file():
            raise InputError(f"there is no campaign file {name_or_path!r}.")
    elif name_or_path in shipped():
        path = shipped()[name_or_path]
    else:
        raise unknown("campaign", name_or_path, shipped())
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read the campaign file {name_or_path!r}: {error}.") from None
    return parse(text, name_or_path)


def parse(text: str, source: str = "campaign") -> Campaign:
    """Read a campaign from TOML text; ``source`` names it in error messages."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}: not valid TOML: {error}.") from None
    _check_keys(data, Campaign, source)
    try:
        return msgspec.convert(data, Campaign)
    except msgspec.ValidationError as error:
        what = str(error).replace(" - at `$.", ", at `").replace(".,", ",").rstrip(".")
        raise InputError(f"{source}: {what}.") from None


def _check_keys(data: dict[str, Any], struct: type[msgspec.Struct], source: str) -> None:
    nested = {"grid": Grid, "limits": Limits, "timing": TimingPlan, "methods": MethodEntry}
    for key, value in data.items():
        if key not in struct.__struct_fields__:
            raise InputError(f"{source}: {unknown('key', key, struct.__struct_fields__)}")
        if key == "settings" and value not in get_args(Settings):
            raise InputError(f"{source}: {unknown('settings', str(value), get_args(Settings))}")
        if key in nested:
            for item in value if isinstance(value, list) else [value]:
                if isinstance(item, dict):
                    _check_keys(item, nested[key], source)
