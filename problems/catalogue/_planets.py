"""What the planetary problems share: units of time, frames of reference, exact set-up."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Literal

from problems.bodies import gravity
from problems.problem import Problem

Unit = Literal["year", "day"]
Frame = Literal["barycentric", "heliocentric"]
DAYS = {"day": Fraction(1), "year": Fraction("365.25")}
SPAN = 1200  # years


def planetary(
    name: str,
    *,
    unit: Unit,
    frame: Frame,
    t_end: float | None,
    gravity_per_day: Fraction,
    masses: Sequence[Fraction],
    positions: Sequence[Sequence[Fraction]],
    velocities: Sequence[Sequence[Fraction]],
) -> Problem:
    """Return the problem of the Sun and some planets.

    All sums are exact and each number is rounded once: the start is the same on
    every machine.

    Parameters
    ----------
    name : str
        The system's name.
    unit : {"year", "day"}
        Unit of time; a year is 365.25 days.
    frame : {"barycentric", "heliocentric"}
        Whether positions and velocities are moved to those of the barycentre.
    t_end : float or None
        End of the integration; 1200 years for ``None``.
    gravity_per_day : Fraction
        G in au^3/(solar mass day^2).
    masses, positions, velocities : sequence
        In solar masses, au and au per day; the Sun first.
    """
    days = DAYS[unit]
    q = [list(row) for row in positions]
    v = [[x * days for x in row] for row in velocities]
    if frame == "barycentric":
        q, v = _centred(masses, q), _centred(masses, v)
    system = gravity.hamiltonian(
        [float(mass) for mass in masses],
        name=name,
        G=float(gravity_per_day * days * days),
        linear_momentum=frame == "heliocentric",
    )
    return Problem(
        system,
        q0=[float(x) for row in q for x in row],
        p0=[float(mass * x) for mass, row in zip(masses, v, strict=True) for x in row],
        t_end=float(SPAN * DAYS["year"] / days) if t_end is None else t_end,
    )


def _centred(masses: Sequence[Fraction], rows: list[list[Fraction]]) -> list[list[Fraction]]:
    total = sum(masses)
    centre = [
        sum((mass * row[c] for mass, row in zip(masses, rows, strict=True)), Fraction(0)) / total
        for c in range(3)
    ]
    return [[x - c for x, c in zip(row, centre, strict=True)] for row in rows]
