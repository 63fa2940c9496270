"""How large things may become before they are refused, and how to allow more.

What a person types by mistake (``n=10**8``) or by habit (a sum written out instead of
`m.sum`) can keep a machine busy for hours, in silence. So sizes are estimated before
anything is built, and what is beyond these limits is refused with one sentence. The
environment variable ``HBVM_BENCH_MAX_<NAME>`` raises a limit: ``HBVM_BENCH_MAX_CASES=1e6``.
"""

import math
import os
from typing import Any

from problems.errors import InputError, large, shown

PREFIX = "HBVM_BENCH_MAX_"

LIMITS = {
    "COMPONENTS": (200_000, "components of the state"),  # 3 s to build and 1 s to compile as a loop
    "TERMS": (2_000_000, "terms in one m.sum"),  # 1 s to read them
    "OPERATIONS": (10_000, "operations written out"),  # about a minute to compile
    "UNROLLED": (200_000, "operations with all loops written out"),  # 2 s to write them
    "DEPTH": (1_000, "operations that wait for one another"),  # the same: all their values are kept
    "STAGES": (256, "stages"),  # 7 s for the coefficients, 20 s for twice as many
    "SAMPLES": (10_000_000, "samples"),
    "TRAJECTORIES": (10_000_000, "trajectories"),
    "CASES": (100_000, "cases"),
    "GIB": (16, "GiB of memory"),
}
"""Name of each limit: its size, and what it counts."""

WRITTEN_OUT = (
    "write sums as m.sum(lambda j: q[j]**2, range(n)), and the components of a field as "
    "m.each(lambda i: -y[i], range(n)), which stay loops"
)
"""What to do about too many operations."""


def limit(name: str) -> float:
    """Return a limit: that of the environment, or else of `LIMITS`.

    Raises
    ------
    problems.errors.InputError
        If the environment's is not a positive number.
    """
    given = os.environ.get(PREFIX + name)
    if given is None:
        return LIMITS[name][0]
    try:
        value = float(given)
    except ValueError:
        value = math.nan
    if not value > 0.0:
        raise InputError(f"{PREFIX}{name}={given!r} must be a positive number, such as {LIMITS[name][0]}.")
    return value


def check(label: str, name: str, size: float, hint: str = "make it smaller") -> None:
    """Refuse what would become larger than a limit.

    Parameters
    ----------
    label : str
        What it is, as a user wrote it: ``"fput(n=100000000)"``.
    name : str
        Of the limit, see `LIMITS`.
    size : float
        How large it would become.
    hint : str
        What to do instead.

    Raises
    ------
    problems.errors.InputError
        If ``size`` is beyond the limit.
    """
    most = limit(name)
    if size > most:
        raise InputError(
            f"{label} has {_shown(size)} {LIMITS[name][1]}, and the limit is {most:,.15g}; {hint}, "
            f"or raise the limit with the environment variable {PREFIX}{name}."
        )


def check_problem(name: str, unknowns: int, terms: int = 0, **values: Any) -> None:
    """Refuse arguments of a problem that make its state, or a sum in it, larger than a limit; see `check`."""
    call = f"{name}({', '.join(f'{key}={shown(value)}' for key, value in values.items())})"
    check(call, "COMPONENTS", unknowns)
    check(call, "TERMS", terms)


def _shown(size: float) -> str:
    if size < 1e15:
        return f"{size:,.15g}" if size == int(size) else f"{size:,.1f}"
    return large(size) if isinstance(size, int) else f"{size:.3g}"
