"""Reductions of many trajectories whose states do not fit into memory.

A reduction processes the states in pieces, in the order of the trajectories. States that were not reached are
ignored.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from problems import targets
from problems.checks import CheckedOptions, Must
from problems.errors import InputError, shown
from problems.systems.base import System
from problems.systems.code_digest import code_digest

Array = NDArray[np.float64]

__all__ = ["Histogram", "Maximum", "Mean", "Minimum", "Reduction"]


class Gathering(Protocol):
    """What a reduction has gathered until now; it pickles."""

    def take(self, values: Array) -> None:
        """Take the values of the next trajectories, shape (n, m); NaN where one did not arrive."""
        ...

    def result(self) -> Array:
        """Return what it amounts to."""
        ...


@dataclass(frozen=True)
class Reduction(CheckedOptions):
    """A reduction of a function of the state.

    Parameters
    ----------
    g : callable
        A function that returns a number; its arguments are among ``t, q, p, y, par, m``, as for a
        Hamiltonian. It is traced.
    over : {"trajectories", "times"}
        The axis of the reduction: all trajectories, with one result for each of the m times, or all times,
        with one result for each of the n trajectories.
    """

    g: Callable[..., Any]
    _: KW_ONLY
    over: Literal["trajectories", "times"] = "trajectories"

    def __post_init__(self) -> None:
        if not callable(self.g):
            raise InputError(f"a reduction needs a function, not {shown(self.g)}.")
        super().__post_init__()

    def begin(self) -> Gathering:
        """Return what gathers the values."""
        raise NotImplementedError

    @property
    def digest(self) -> str:
        """Return a text that tells it from others."""
        options = {name: np.asarray(value).tolist() for name, value in self._values().items() if name != "g"}
        return code_digest(self.g, 0, f"{type(self).__name__} {options}")


@dataclass(frozen=True)
class Mean(Reduction):
    """The mean of g, shape (m,) or (n,); NaN if no state was reached.

    Examples
    --------
    >>> import numpy as np, problems
    >>> from integrators import Gauss, integrate_many
    >>> from integrators.reduce import Mean
    >>> starts = np.column_stack([np.zeros(50), np.linspace(0.1, 1.5, 50)])
    >>> made = integrate_many(
    ...     problems.load("pendulum"), Gauss(s=4, h=0.1), starts=starts, times=[5.0, 10.0],
    ...     reduce={"height": Mean(lambda q, m: -m.cos(q[0]))},
    ... )
    >>> made.reduced["height"].shape, made.y.shape  # of the states, the last ones are kept
    ((2,), (50, 1, 2))
    """

    def begin(self) -> Gathering:
        """Return what gathers the values."""
        return _Sum() if self.over == "trajectories" else _Rows(np.nanmean)


@dataclass(frozen=True)
class Minimum(Reduction):
    """The minimum of g, shape (m,) or (n,); NaN if no state was reached."""

    def begin(self) -> Gathering:
        """Return what gathers the values."""
        return _Extreme(np.fmin) if self.over == "trajectories" else _Rows(np.nanmin)


@dataclass(frozen=True)
class Maximum(Reduction):
    """The maximum of g, shape (m,) or (n,); NaN if no state was reached."""

    def begin(self) -> Gathering:
        """Return what gathers the values."""
        return _Extreme(np.fmax) if self.over == "trajectories" else _Rows(np.nanmax)


def _increases(edges: Any) -> bool:
    try:
        given = np.asarray(edges, dtype=np.float64)
    except (TypeError, ValueError):
        return False
    return given.ndim == 1 and given.size > 1 and bool((np.diff(given) > 0.0).all())


@dataclass(frozen=True)
class Histogram(Reduction):
    """The histogram of g, with the bins of `numpy.histogram`: shape (m, bins) or (n, bins).

    Parameters
    ----------
    edges : sequence of float
        Edges of the bins, increasing. Values outside are not counted.
    """

    edges: Annotated[Sequence[float], Must("at least two increasing numbers", _increases)] = field(
        kw_only=True
    )

    def begin(self) -> Gathering:
        """Return what gathers the values."""
        edges = np.array(self.edges, dtype=np.float64)
        return _Counts(edges) if self.over == "trajectories" else _CountedRows(edges)


@dataclass
class _Sum:
    total: Any = 0.0
    count: Any = 0

    def take(self, values: Array) -> None:
        there = ~np.isnan(values)
        self.total = self.total + np.where(there, values, 0.0).sum(axis=0)
        self.count = self.count + there.sum(axis=0)

    def result(self) -> Array:
        with np.errstate(invalid="ignore"):
            return np.asarray(self.total / self.count, dtype=np.float64)


@dataclass
class _Extreme:
    better: Callable[..., Any]
    collected: Any = np.nan

    def take(self, values: Array) -> None:
        self.collected = self.better(self.collected, self.better.reduce(values, axis=0))  # pyright: ignore[reportFunctionMemberAccess]

    def result(self) -> Array:
        return np.asarray(self.collected, dtype=np.float64)


@dataclass
class _Counts:
    edges: Array
    collected: Any = 0

    def take(self, values: Array) -> None:
        self.collected = self.collected + _counted(values.T, self.edges)

    def result(self) -> Array:
        return np.asarray(self.collected)


@dataclass
class _Rows:
    of_row: Callable[..., Any]
    collected: list[Array] = field(default_factory=list)

    def take(self, values: Array) -> None:
        with warnings.catch_warnings():  # that a trajectory reached nothing: its result is NaN
            warnings.simplefilter("ignore", RuntimeWarning)
            self.collected.append(self.of_row(values, axis=1))

    def result(self) -> Array:
        return np.concatenate(self.collected)


@dataclass
class _CountedRows:
    edges: Array
    collected: list[Array] = field(default_factory=list)

    def take(self, values: Array) -> None:
        self.collected.append(_counted(values, self.edges))

    def result(self) -> Array:
        return np.concatenate(self.collected)


def _counted(rows: Array, edges: Array) -> Array:
    return np.array([np.histogram(row[~np.isnan(row)], edges)[0] for row in rows])


class Reducer:
    """Reductions in progress.

    Parameters
    ----------
    system : System
        Of whose states the functions are; traced.
    reductions : mapping of str to Reduction
        By name.

    Raises
    ------
    problems.errors.InputError
        For a function that cannot be traced.
    """

    def __init__(self, system: System, reductions: Mapping[str, Reduction]):
        for name, reduction in reductions.items():
            if not isinstance(reduction, Reduction):
                raise InputError(
                    f"reduce={{{name!r}: {shown(reduction)}}} is no reduction; give a Mean, Minimum, "
                    "Maximum or Histogram of integrators.reduce."
                )
        self._evaluate = {
            name: targets.numpy(system, system.trace(reduction.g, f"reduction {name!r}"))
            for name, reduction in reductions.items()
        }
        self._over_times = [name for name, reduction in reductions.items() if reduction.over == "times"]
        self.gathered = {name: reduction.begin() for name, reduction in reductions.items()}
        self.numbers: list[NDArray[np.int64]] = []

    def take(self, numbers: NDArray[np.int64], t: Array, y: Array, par: Array) -> None:
        """Take the states of trajectories of these numbers, shape (n, m, dim), at times (m,) or (n, m).

        Parameters have shape (n, n_par), or (n, m, n_par) where events have changed them.
        """
        n, m, dim = y.shape
        self.numbers.append(numbers)
        each = par if par.ndim == 3 else par[:, np.newaxis]
        columns = y.reshape(n * m, dim).T
        own = np.broadcast_to(each, (n, m, par.shape[-1])).reshape(n * m, -1).T
        times = np.broadcast_to(t, (n, m)).reshape(-1)
        for name, evaluate in self._evaluate.items():
            with np.errstate(all="ignore"):
                values = np.array(evaluate(times, columns, own)[0], dtype=np.float64).reshape(n, m)
            values[np.isnan(y).any(axis=2)] = np.nan
            self.gathered[name].take(values)

    def results(self, n: int) -> dict[str, Array]:
        """Return what each amounts to, of n trajectories; nothing if none was taken."""
        if not self.numbers:
            return {}
        results = {name: gathering.result() for name, gathering in self.gathered.items()}
        order = np.concatenate(self.numbers)
        for name in self._over_times:
            values = results[name]
            results[name] = np.full((n, *values.shape[1:]), np.nan if values.dtype.kind == "f" else 0)
            results[name][order] = values
        return results
