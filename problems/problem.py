"""A problem: a system, an initial state, parameters and an integration interval."""

import copy
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems import targets
from problems.analysis import deviations, invariants
from problems.analysis.manifold import on_manifold
from problems.checks import NOTHING, Named, checked_arguments
from problems.errors import InputError, printable, shown
from problems.quantities import plain_numbers
from problems.systems.base import System, Value
from problems.systems.constrained import Constrained

Array = NDArray[np.float64]

LONGEST = 400  # characters that ``print`` shows
NUMBERS_SHOWN = 8  # numbers of a list that it shows


@dataclass(frozen=True, init=False, repr=False, eq=False)
class Problem:
    """An initial value problem; immutable, hashable, printed as the call that creates it.

    Parameters
    ----------
    system : System
        The dynamical system.
    q0, p0, v0, y0 : array_like
        The initial state: positions with momenta or (for systems with H = sum c_i p_i^2/2 + V) with
        velocities v = c p, or those of a `problems.Lagrangian`; or the whole state ``y0``.
    parameters : mapping of str to float or sequence of float
        Values that differ from the system's defaults.
    t0, t_end : float
        Integration interval; ``t_end`` may lie before ``t0``, or be ``t0``, where a solution is the start.
    name : str, optional
        The name for `problems.load`.
    title : str, optional
        One line for reports.
    arguments : mapping
        Arguments of the function of that name, for printing: ``{"e": 0.75}``.
    times : array_like, optional
        Default output times.
    references : sequence of str
        Sources of the problem.
    notes : str
        Remarks.
    bodies : sequence of str
        Names of the bodies of an N-body problem.
    project : bool
        Whether a start that violates the constraints of a `problems.Constrained` is moved to the nearest one
        that satisfies them.

    Attributes
    ----------
    moved : ndarray, shape (dim,), or None
        How far ``project`` has moved the start; ``None`` without.

    Raises
    ------
    problems.errors.InputError
        If a value is missing, not finite or of the wrong length.

    Examples
    --------
    >>> from problems import Hamiltonian, Problem
    >>> def H(q, p, m):
    ...     return p[0]**2/2 - m.cos(q[0])
    >>> Problem(Hamiltonian(H, dof=1), q0=[0.0], p0=[1.9], t_end=1000.0)
    Problem(Hamiltonian(H, dof=1), q0=[0.0], p0=[1.9], t_end=1000.0)
    """

    system: System
    y0: Array
    par: Array
    t0: float
    t_end: float
    name: str | None
    title: str
    arguments: Mapping[str, Any]
    times: Array | None
    references: tuple[str, ...]
    notes: str
    _made_with: str
    bodies: tuple[str, ...] = ()
    moved: Array | None = None

    @checked_arguments
    def __init__(
        self,
        system: System,
        *,
        q0: ArrayLike | None = None,
        p0: ArrayLike | None = None,
        v0: ArrayLike | None = None,
        y0: ArrayLike | None = None,
        parameters: Named[Value] = NOTHING,
        t0: float = 0.0,
        t_end: float,
        name: str | None = None,
        title: str | None = None,
        arguments: Named[Any] = NOTHING,
        times: ArrayLike | None = None,
        references: Sequence[str] = (),
        notes: str = "",
        bodies: Sequence[str] = (),
        project: bool = False,
    ) -> None:
        if not isinstance(system, System):
            raise InputError(f"a Problem needs a Hamiltonian or a VectorField, not {shown(system)}.")
        par = system.pack(parameters)
        state = _start(system, par, t0, {"q0": q0, "p0": p0, "v0": v0, "y0": y0})
        given_state = state
        if isinstance(system, Constrained):
            state = on_manifold(system, par, t0, state, project=project)
        elif project:
            raise InputError(
                f"project=True is for systems with constraints, unlike {system.name}; leave it out."
            )
        grid = None if times is None else _numbers("times", times, None)
        given = {"q0": q0, "p0": p0, "v0": v0, "y0": y0}
        printed = [f"{key}={_shown(value)}" for key, value in given.items() if value is not None]
        if parameters:
            printed.append(f"parameters={ {key: parameters[key] for key in parameters}!r}")
        printed += [f"t0={t0!r}"] if t0 != 0.0 else []
        printed += [f"bodies={list(bodies)!r}"] if bodies else []
        printed += ["project=True"] if project else []
        values = {
            "system": system,
            "y0": _frozen(state),
            "par": _frozen(par),
            "t0": float(t0),
            "t_end": float(t_end),
            "name": name,
            "title": title or name or system.name,
            "arguments": MappingProxyType(dict(arguments)),
            "references": tuple(references),
            "notes": notes,
            "times": None if grid is None else _frozen(grid),
            "_made_with": ", ".join([repr(system), *printed, f"t_end={t_end!r}"]),
        }
        if bodies:
            values["bodies"] = tuple(bodies)
        if project:
            values["moved"] = _frozen(state - given_state)
        for key, value in values.items():
            object.__setattr__(self, key, value)

    def with_metadata(
        self, *, name: str, title: str, arguments: Mapping[str, Any], references: Sequence[str], notes: str
    ) -> Self:
        """Return the same problem with a name, and metadata for reports."""
        named = copy.copy(self)
        words = {
            "name": name,
            "title": title,
            "arguments": MappingProxyType(dict(arguments)),
            "references": tuple(references),
            "notes": notes,
        }
        for key, value in words.items():
            object.__setattr__(named, key, value)
        return named

    @checked_arguments
    def replace(
        self,
        *,
        y0: ArrayLike | None = None,
        parameters: Named[Value] = NOTHING,
        t0: float | None = None,
        t_end: float | None = None,
    ) -> "Problem":
        """Return the same system with another initial state, other parameters or another interval.

        Parameters
        ----------
        y0 : array_like, shape (dim,), optional
            The initial state.
        parameters : mapping of str to float or sequence of float
            New values; the others are those of this problem, not the system's defaults.
        t0, t_end : float, optional
            Integration interval.

        Raises
        ------
        problems.errors.InputError
            As for `Problem`.

        Examples
        --------
        >>> import problems
        >>> problems.load("kepler", e=0.6).replace(t_end=10.0).t_end
        10.0
        """
        values = {**self.system.unpack(self.par), **parameters}
        return Problem(
            self.system,
            y0=self.y0 if y0 is None else y0,
            parameters={
                key: value.tolist() if isinstance(value, np.ndarray) else value
                for key, value in values.items()
            },
            t0=self.t0 if t0 is None else t0,
            t_end=self.t_end if t_end is None else t_end,
            bodies=self.bodies,
        )

    def __getstate__(self) -> dict[str, Any]:
        """Return what `__setstate__` takes: copies and pickles need none of the user's functions."""
        return {**vars(self), "arguments": dict(self.arguments)}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        arrays = {key: state[key] for key in ("y0", "par", "times") if state[key] is not None}
        frozen = {key: _frozen(array) for key, array in arrays.items()}
        for key, value in {**state, **frozen, "arguments": MappingProxyType(state["arguments"])}.items():
            object.__setattr__(self, key, value)

    def written(self) -> str:
        """Return the call that makes it, with all its numbers."""
        if self.name is None:
            return printable(f"Problem({self._made_with})")
        inside = ", ".join(f"{key}={value!r}" for key, value in self.arguments.items())
        return printable(f"{self.name}({inside})")

    def __repr__(self) -> str:
        """Return the call that makes a problem with a name; of another the same, with long lists in short."""
        return str(self) if self.name is None else self.written()

    def __str__(self) -> str:
        """Return what it prints as, with long lists of numbers in short."""
        text = re.sub(r"\[[^\[\]]*\]", _short, self.written())
        return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"

    def _identity(self) -> tuple[Any, ...]:
        return (
            self.written(),
            targets.fingerprint(self.system),
            self.y0.tobytes(),
            self.par.tobytes(),
            self.t0,
            self.t_end,
            None if self.times is None else self.times.tobytes(),
        )

    def __eq__(self, other: object) -> bool:
        return self._identity() == other._identity() if isinstance(other, Problem) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._identity())

    def invariants(self, y: ArrayLike, t: ArrayLike | None = None) -> dict[str, Array]:
        """Evaluate the invariants in double-double from double states, rounded once at the end.

        Parameters
        ----------
        y : array_like, shape (n, dim)
            States, one per row.
        t : array_like, shape (n,), optional
            Times of the states, if an invariant depends on time.

        Returns
        -------
        dict of str to ndarray
            Shape (n,), or (n, k) for a vector; the energy first.
        """
        return invariants.invariants(self.system, self.par, y, t)

    def errors(self, y: ArrayLike, t: ArrayLike | None = None) -> dict[str, Array]:
        """Return the deviation of each invariant from its initial value, relative to the size of its terms.

        That size is the largest sum of the absolute values of its terms, such as kinetic and potential
        energy, at the start and at the states given: it does not vanish where they cancel. Constants are not
        counted. An invariant whose terms are all 0 has an absolute error. The difference is computed in
        double-double, before rounding; vectors are measured in the 2-norm.

        Parameters
        ----------
        y, t
            As for `invariants`.

        Returns
        -------
        dict of str to ndarray, shape (n,)
        """
        return deviations.errors(self.system, self.par, y, t, starts=(self.t0, self.y0))

    def guards(self, y: ArrayLike, t: ArrayLike | None = None) -> dict[str, Array]:
        """Return the symmetry guards, shape (n,) each; 0 as long as the symmetry is conserved."""
        return invariants.guards(self.system, self.par, y, t)

    def velocity(self, y: ArrayLike, t: ArrayLike | None = None) -> Array | None:
        """Return the velocities, shape (n, dof): c_i p_i, or those of a `problems.Lagrangian`; else ``None``.

        ``t``, shape (n,), is needed where the kinetic energy of a Lagrangian depends on time.
        """
        return invariants.velocity(self.system, self.par, y, t)

    def multipliers(self, y: ArrayLike, t: ArrayLike | None = None) -> Array | None:
        """Return the multipliers of constraints at states, shape (n, m); ``None`` where there are none."""
        return invariants.multipliers(self.system, self.par, y, t)


def _short(numbers: re.Match[str]) -> str:
    """Return a printed list, of a long one the first three numbers and how many there are."""
    parts = numbers[0][1:-1].split(", ")
    return numbers[0] if len(parts) <= NUMBERS_SHOWN else f"[{', '.join(parts[:3])}, ... {len(parts)} in all]"


def _start(system: System, par: Array, t0: float, given: Mapping[str, ArrayLike | None]) -> Array:
    names = tuple(name for name, value in given.items() if value is not None)
    if names == ("y0",):
        return _numbers("y0", given["y0"], system.dim)
    if system.dof is None:
        raise InputError(
            f"a {type(system).__name__} starts from y0=, of length {system.dim}; got {_listed(names)}."
        )
    if names not in (("q0", "p0"), ("q0", "v0")):
        raise InputError(f"give the start as q0= and p0=, or q0= and v0=, or y0=; got {_listed(names)}.")
    q = _numbers("q0", given["q0"], system.dof)
    if "p0" in names:
        return np.concatenate([q, _numbers("p0", given["p0"], system.dof)])
    v = _numbers("v0", given["v0"], system.dof)
    return np.concatenate([q, invariants.momentum(system, par, t0, q, v)])


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if names else "nothing"


def _numbers(label: str, value: Any, size: int | None) -> Array:
    array = np.array(plain_numbers(label, value))
    if array.ndim != 1 or (size is not None and array.size != size):
        wanted = "a flat list" if size is None else f"a flat list of length {size}"
        raise InputError(f"{label} must be {wanted}, not an array of shape {array.shape}.")
    if not np.isfinite(array).all():
        raise InputError(f"{label} must be finite, not {shown(array.tolist())}.")
    return array


def _frozen(array: Array) -> Array:
    array = array.copy()
    array.flags.writeable = False
    return array


def _shown(value: ArrayLike) -> str:
    return repr(np.asarray(value, dtype=np.float64).tolist())


def check_is_problem(problem: Problem) -> None:
    """Raise `problems.errors.InputError` for what is no problem, such as a system without a start."""
    if isinstance(problem, Problem):
        return
    if isinstance(problem, System):
        raise InputError(
            f"problem must be a Problem, not {shown(problem)}, a system without a start; "
            "give problems.Problem(system, y0=..., t_end=...)."
        )
    raise InputError(
        f"problem must be a Problem, not {shown(problem)}; make one with problems.load or problems.Problem."
    )


__all__ = ["Problem", "System"]
