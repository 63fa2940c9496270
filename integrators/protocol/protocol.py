"""What every method, program and stepper satisfies."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, wraps
from pathlib import Path
from typing import Any, ClassVar, Protocol, cast, runtime_checkable

from integrators.protocol.values import Array, Samples, Stats, Status
from problems.checks import CheckedOptions
from problems.errors import InputError, shown
from problems.problem import Problem, System, check_is_problem


@runtime_checkable
class Stepper(Protocol):
    """An integration in progress."""

    @property
    def t(self) -> float: ...
    @property
    def y(self) -> Array: ...
    @property
    def status(self) -> Status: ...
    @property
    def reason(self) -> str: ...
    @property
    def stats(self) -> Stats: ...

    def step(self) -> Status:
        """Take one step of the method."""
        ...

    def advance(self, times: Array, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]`` and return the states at ``times``.

        The stepper is then at ``times[-1]`` or, if states between steps are computed without a change of the
        steps, at the last step before it.

        Parameters
        ----------
        times : ndarray, shape (n,)
            Finite, strictly monotone in the direction of integration; the
            first may be the current time.
        sample : {"partial", "steps", "stop", "dense"}, optional
            How states between steps are computed. ``None``: the most accurate way that leaves the steps
            unchanged, or a stop at the output times if the method does not lose efficiency by it. A method
            refuses samplings that it does not support.

        Returns
        -------
        Samples

        Raises
        ------
        problems.errors.InputError
            For times that are not finite or not monotone, or a sampling that the method does not support.
        """
        ...


@runtime_checkable
class Program(Protocol):
    """A method compiled for one system; parameters are run-time values."""

    @property
    def compile_seconds(self) -> float: ...
    @property
    def from_cache(self) -> bool | None:
        """Whether compiled code came from a cache; ``None`` where nothing is compiled."""
        ...

    def start(self, y0: Array, par: Array | None = None, t0: float = 0.0) -> Stepper:
        """Return a stepper at ``t0``; raises `UserError` if a user function raises there."""
        ...


class Compiled:
    """Base class of programs.

    A pickled program contains the method and the system, and is compiled again when it is loaded.

    Attributes
    ----------
    method : MethodBase
        Set by its `MethodBase.compile`.
    system : System
        The system that it was compiled for.
    """

    method: Any
    system: System

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self.method).compile, (self.method, self.system)


def cite(*keys: str) -> str:
    """Return the entries of ``citations.bib`` with these keys, one after another."""
    return "".join(map(_citations().__getitem__, keys))


@cache
def _citations() -> dict[str, str]:
    text = Path(__file__).with_name("citations.bib").read_text(encoding="utf-8")
    return {entry[2]: entry[1] for entry in re.finditer(r"^(@\w+\{(\w+),.*?^\}\n)", text, re.M | re.S)}


@dataclass(frozen=True, kw_only=True)
class MethodBase(CheckedOptions):
    """Base class of all methods: a frozen description that prints as the call that creates it.

    Attributes
    ----------
    library, citation, family : str
        The package that integrates, the citation that its authors ask for, and the kind of method.
    to_end : str or None
        The sampling with which the library's documentation integrates to an end time, which is timed;
        ``None`` if it is the default of `Stepper.advance`.
    built : str
        What the library's machine code is built for, in a few words.
    computes_with : tuple of str
        Packages on whose versions the numbers depend, beside the library itself.

    Raises
    ------
    problems.errors.UnknownNameError
        For an option that does not exist, with the nearest names.
    problems.errors.InputError
        For an option that is missing, not given by name, or not what its annotation says.

    Examples
    --------
    >>> from integrators import HBVM
    >>> method = HBVM(k=8, s=4, h=0.5)
    >>> method, method.order, method.library
    (HBVM(k=8, s=4, h=0.5), 8, 'hbvm-bench')
    """

    library: ClassVar[str] = "hbvm-bench"
    citation: ClassVar[str] = ""
    family: ClassVar[str] = ""
    to_end: ClassVar[str | None] = None
    built: ClassVar[str] = ""
    computes_with: ClassVar[tuple[str, ...]] = ()

    order = cast("int | None", None)  # without an annotation, with which it would be an option
    """Order of convergence, an int; ``None`` where it varies with the tolerance."""

    precision = cast("Any", "double")
    """Precision of the arithmetic; programs with another one are `DoubleDouble`."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "compile" in vars(cls):
            setattr(cls, "compile", _of_a_system(cls.compile))  # noqa: B010 -- its type stays as written

    def accepts(self, problem: Problem) -> str | None:
        """Return ``None`` if the method can integrate ``problem`` (the default), else the reason."""
        return self.refuses(problem.system)

    def refuses(self, system: System) -> str | None:
        """Return the reason why ``compile`` refuses ``system``, or ``None`` (the default)."""
        return None

    def caveat(self, problem: Problem) -> str | None:
        """Return why `problem` is outside the method's intended use, or `None`."""
        return None

    def conserved(self, system: System) -> dict[str, float]:
        """Return the invariants that the method conserves, and by how much each may change in a step.

        Relative to its size; 0: by rounding only. A much larger change indicates a feature that all steps
        missed, and `integrators.Solution.warnings` report it.
        """
        return {}

    def compile(self, system: System) -> Program:
        """Compile for ``system``; see the module's guide."""
        raise NotImplementedError

    def options(self, *, defaults: bool = False) -> dict[str, Any]:
        """Return the options by name: those that differ from their default, or all."""
        return self._values() if defaults else self._printed()

    def __repr__(self) -> str:
        inside = ", ".join(f"{name}={value!r}" for name, value in self.options().items())
        return f"{type(self).__name__}({inside})"


def _of_a_system(compile_: Callable[[Any, System], Program]) -> Callable[[Any, System], Program]:
    """Return a method's ``compile`` that refuses what is no system, and what the method refuses."""

    @wraps(compile_)
    def checking(method: Any, system: System) -> Program:
        check_system(method, system)
        return compile_(method, system)

    return checking


def check_system(method: MethodBase, system: System) -> None:
    """Raise `problems.errors.InputError` unless ``system`` is one that ``method`` can be compiled for."""
    if not isinstance(system, System):
        raise InputError(
            f"{type(method).__name__}.compile takes a system, such as problem.system, not {shown(system)}."
        )
    if (reason := method.refuses(system)) is not None:
        raise InputError(f"{method!r} cannot integrate {system.name}: {reason}")


def check_problem(problem: Problem, method: MethodBase) -> None:
    """Raise `problems.errors.InputError` unless ``method`` can integrate ``problem``."""
    check_is_problem(problem)
    if not isinstance(method, MethodBase):
        raise InputError(f"method must be a method such as HBVM(k=8, s=4, h=0.1), not {shown(method)}.")
    reason = method.accepts(problem)
    if reason is not None:
        raise InputError(f"{method!r} cannot integrate {problem!s}: {reason}")
