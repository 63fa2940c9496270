"""What the entries of a campaign file say: problems, methods, ensembles, limits, timing, checks."""

import re
from datetime import datetime
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from hbvm_bench.campaign.grid import Count, Grid, Positive
from hbvm_bench.campaign.sweep import Scalar
from problems import limits
from problems.errors import InputError, shown

Enough = Annotated[float, Meta(ge=0.1, le=1e300)]
"""With less no case can begin: an interpreter with NumPy alone takes 0.05 GiB."""
Settings = Literal["chosen", "default", "recommended", "as published", "outside its domain"]
Role = Literal["ours", "peer"]

Accuracy = dict[str, Positive]
FILE_NAME = r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}"


class Limits(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What one case may use before it is ended and reported.

    Attributes
    ----------
    wall_seconds : float
        Wall time of one process, from when the method is compiled.
    memory_gib : float
        Resident memory of one process, in GiB.
    compile_seconds : float
        Wall time until then: a cold cache on a busy machine says nothing about the method.
    """

    wall_seconds: Enough = 120.0
    memory_gib: Enough = 4.0
    compile_seconds: Enough = 900.0


class TimingPlan(msgspec.Struct, frozen=True, kw_only=True):
    """The serial timing pass: one process takes all cases of a problem in turn, alone on the machine.

    Ratios within rounds then say more than seconds do: a machine that changes its speed touches all alike.

    Attributes
    ----------
    rounds : int
        Rounds over all cases, each with one sample of every case. 0: no timing.
    shortest : float
        A sample repeats the integration until it lasts this many seconds.
    budget : float
        Seconds of sampling per case; slow ones take part in fewer rounds.
    order : {"shuffled", "alternating"}
        Of the cases in a round: anew in each, or every other one backwards.
    clock : {"wall", "thread", "process"}
        Of the wall, or CPU time of this thread, or for all threads of this process, in which other work on
        the machine does not count.
    compilations : int
        Fresh processes among which the rounds are shared, for a method may be slower in one than in the next:
        its code lies elsewhere. The first begins with empty caches. Those that choose a setting do not
        compare it.
    front : bool
        Whether a setting that the first compilation shows to be far behind others is not timed again; see
        `hbvm_bench.summaries.front`.
    """

    rounds: Annotated[int, Meta(ge=0, le=10_000)] = 3
    shortest: Positive = 0.02
    budget: Positive = 8.0
    order: Literal["shuffled", "alternating"] = "shuffled"
    clock: Literal["wall", "thread", "process"] = "wall"
    compilations: Annotated[int, Meta(ge=1, le=100)] = 1
    front: bool = False


class Checks(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """What is looked at beside the trajectory itself; each costs further integrations.

    Attributes
    ----------
    starts : int
        Trajectories from which the error growth is found: the problem's own start
        and perturbed ones; see `hbvm_bench.measure.starts`. 0: no growth is fitted.
    reversal : float
        Share of the interval that is integrated there and back again; 0: none.
    chaos : bool
        Whether MEGNO and the largest Lyapunov exponent are computed, by the derivatives of the method's
        steps; of a single trajectory.
    """

    starts: Annotated[int, Meta(ge=0, le=1000)] = 0
    reversal: Annotated[float, Meta(ge=0, le=1)] = 0.0
    chaos: bool = False


class Ensemble(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Many trajectories at once, through a method's batch path where it has one.

    Attributes
    ----------
    count : int
        Trajectories.
    spread : float
        Every number of the start is multiplied by 1 + ``spread`` x, |x| <= 1.
    vary : tuple of (str, float)
        The same of parameters, by name.
    """

    count: Count
    spread: Positive = 1e-2
    vary: tuple[tuple[str, Positive], ...] = ()


class Goal(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """What a campaign asks for before it is run; `hbvm_bench.summaries.goals` gives the verdict.

    Either a number of HBVM and Gauss is at most ``at``, or a peer's is at least ``ratio`` times ours: of
    the settings of each that are accurate enough, the one that takes least is compared.

    Attributes
    ----------
    words : str
        In a few words; made from the rest by default.
    only : list of str
        Names of the problems it is about; each is a goal. All by default.
    method : str
        Ours: the name of a method, or one setting as it prints. All of ours by default.
    against : str
        The peer, likewise.
    metric : str
        What is compared, see `hbvm_bench.measure.metrics`.
    at, ratio : float, optional
        One of them.
    within : dict of float
        Errors, by metric, that a setting may have at most. With ``ratio`` and neither this
        nor ``no_worse``: what the problem asks for.
    no_worse : dict of float
        How many times the peer's error ours may be at most, by metric.
    alone : str
        Why the energy is compared without the position or the phase; without a reason such a
        goal is excluded.
    declared : str
        When it was declared, such as ``"2026-11-20"``, with the time of the day where that matters. A run
        writes there when it first had the goal, unless the file says it.
    measured : str
        When what it is about had been measured first, if that was before; a run writes it.
    """

    words: str = ""
    only: list[str] = []
    method: str = ""
    against: str = ""
    metric: str = "warm_seconds"
    at: Annotated[float, Meta(ge=0, le=1e300)] | None = None
    ratio: Positive | None = None
    within: Accuracy = {}
    no_worse: Accuracy = {}
    alone: str = ""
    declared: str = ""
    measured: str = ""

    def __post_init__(self) -> None:
        for name in ("declared", "measured"):
            _check_date(name, getattr(self, name))
        if (self.at is None) == (self.ratio is None) or (self.ratio is None) == bool(self.against):
            raise InputError("a goal has either at=, or against= and ratio=.")


def _check_date(name: str, given: str) -> None:
    try:
        datetime.fromisoformat(given or "2026-01-01")
    except ValueError:
        raise InputError(
            f'{name}={shown(given)} of a goal must be a date such as "2026-11-20" or "2026-11-20T18:30".'
        ) from None


class Page(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What a campaign's report keeps; what its page is made of says ``page.md`` beside its file.

    Attributes
    ----------
    by_processor : bool
        Whether a report keeps the results of several kinds of processor side by side.
    series : list of str
        Names of the series that lie beside a report, beside the curves of its figures.
    """

    by_processor: bool = False
    series: list[str] = []


class ProblemEntry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """One problem of a campaign file, or a grid of them.

    Attributes
    ----------
    use : str
        The problem as it prints; ``{name}`` stands for a value, see `hbvm_bench.campaign.sweep`.
        ``mine.py:swing(g=1.1)`` is a function in a Python file beside the campaign's.
    values : dict
        Values that the methods' texts may name, such as the step that suits the problem.
    sweep : dict of list
        Values by name; every combination is a problem.
    grid : Grid, optional
        Instead of the campaign's.
    name : str
        What ``only`` and the pages call it; its name in the registry by default.
    title, note : str
        For readers: a line, and what to know when reading the numbers.
    within : dict of float
        The errors, by metric, that times are compared at first; see `Goal`.
    reference : bool
        Whether a reference is computed before the run, by two methods, where none comes with the
        package; see `hbvm_bench.run.references`.
    end : list of float, optional
        The state at the end, where it is known, as from a publication: the reference is then that.
        Of one problem: it goes with neither a sweep nor ``reference``.
    """

    use: str
    name: str = ""
    title: str = ""
    note: str = ""
    within: Accuracy = {}
    reference: bool = False
    end: Annotated[list[float], Meta(min_length=1)] | None = None
    values: dict[str, Scalar] = {}
    sweep: dict[str, Annotated[list[Scalar], Meta(min_length=1)]] = {}
    grid: Grid | None = None

    def __post_init__(self) -> None:
        if self.name and not re.fullmatch(FILE_NAME, self.name):
            raise InputError(
                f"problem name {self.name!r} must be a file name of letters, digits, '.', '_' and '-'."
            )
        if self.end is not None and self.sweep:
            raise InputError(f"end= of {self.use} is of one problem; write an entry for each of the sweep.")
        if self.end is not None and self.reference:
            raise InputError(f"end= of {self.use} is its reference; leave out reference = true, or end=.")


class MethodEntry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """One method of a campaign file, or a grid of its settings.

    Attributes
    ----------
    use : str or list of str
        The method as it prints, such as ``"Taylor(tol=1e-15)"``, or a list of settings; ``{name}``
        stands for a value of the sweep or of the problem, see `hbvm_bench.campaign.sweep`.
    settings : str
        Whether these are the library's defaults, what its authors recommend for
        such a problem, the settings of a published experiment, or a use that the
        method was not made for.
    note : str
        A sentence that the report prints beside the row.
    sweep : dict of list
        Values by name; every combination is a setting.
    only : list of str
        Names of the problems it runs on; all by default.
    quick : list of int
        Which of its settings, counted from 0, a quick run takes; all by default.
    """

    use: str | Annotated[list[str], Meta(min_length=1)]
    settings: Settings = "chosen"
    note: str = ""
    sweep: dict[str, Annotated[list[Scalar], Meta(min_length=1)]] = {}
    only: list[str] = []
    quick: list[int] = []

    @property
    def texts(self) -> list[str]:
        """The texts of its settings, before any sweep."""
        return [self.use] if isinstance(self.use, str) else self.use


class EnsembleEntry(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True
):
    """An ensemble of a campaign file.

    Attributes
    ----------
    problem : str
        The problem as it prints; its start is the centre of the ensemble.
    name : str
        What goals and the pages call it; the problem's name by default.
    count, spread, vary
        See `Ensemble`; ``vary`` is a table of parameters.
    methods : list of MethodEntry
        Which methods take it.
    """

    problem: str
    count: int
    methods: Annotated[list[MethodEntry], Meta(min_length=1)]
    name: str = ""
    spread: Annotated[float, Meta(gt=0, le=1)] = 1e-2
    vary: dict[str, Positive] = {}

    def __post_init__(self) -> None:
        if self.count < 1:
            raise InputError(f"count={shown(self.count)} of an ensemble must be at least 1.")
        limits.check(f"an ensemble with count={shown(self.count)}", "TRAJECTORIES", self.count)

    @property
    def ensemble(self) -> Ensemble:
        """What its cases carry."""
        return Ensemble(count=self.count, spread=self.spread, vary=tuple(self.vary.items()))

    @property
    def entry(self) -> ProblemEntry:
        """Its problem as an entry, for goals."""
        return ProblemEntry(use=self.problem, name=self.name)
