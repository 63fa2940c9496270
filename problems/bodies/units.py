"""Units of lengths, times and masses, and the constants of gravitation and of light in them.

Masses in ``Msun``, ``Mearth`` and ``Mjup`` are exact multiples of each other through the nominal GM of the
International Astronomical Union (Resolution B3 of 2015), so that orbits in them do not depend on G in SI
units.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from problems.checks import CheckedOptions
from problems.errors import InputError, unknown

G_SI = 6.67430e-11  # m^3/(kg s^2): CODATA 2018
AU = 149597870700.0  # m: IAU 2012, Resolution B2
DAY = 86400.0  # s
LENGTHS = {"m": 1.0, "km": 1e3, "Rearth": 6.3781e6, "Rsun": 6.957e8, "au": AU, "pc": AU * 648000 / np.pi}
TIMES = {"s": 1.0, "h": 3600.0, "day": DAY, "yr": 365.25 * DAY}
GM = {"kg": G_SI, "Mearth": 3.986004e14, "Mjup": 1.2668653e17, "Msun": 1.3271244e20}  # m^3/s^2
LIGHT = 299792458.0  # m/s
KINDS = {"length": LENGTHS, "time": TIMES, "mass": GM}


@dataclass(frozen=True)
class Units(CheckedOptions):
    """Units of a problem of bodies, named once.

    Parameters
    ----------
    names : str
        One of each kind, in any order: ``m``, ``km``, ``Rearth``, ``Rsun``, ``au``, ``pc``; ``s``, ``h``,
        ``day``, ``yr`` (365.25 days); ``kg``, ``Mearth``, ``Mjup``, ``Msun``.

    Attributes
    ----------
    G, c : float
        The constant of gravitation and the velocity of light in these units.

    Raises
    ------
    problems.errors.InputError
        For a unit that is not known, and two or none of a kind.

    References
    ----------
    A. Prša et al., Nominal values for selected solar and planetary quantities: IAU 2015 Resolution B3, The
    Astronomical Journal 152 (2016), 41.

    Examples
    --------
    >>> from problems.bodies import Units
    >>> units = Units("au, yr, Msun")
    >>> round(units.G, 6), round(units.c, 3)
    (39.476926, 63241.077)
    """

    names: str

    def __post_init__(self) -> None:
        super().__post_init__()
        names = [name.strip() for name in self.names.split(",")]
        for name in names:
            if not any(name in known for known in KINDS.values()):
                raise unknown("unit", name, [one for known in KINDS.values() for one in known])
        for kind, known in KINDS.items():
            if sum(name in known for name in names) != 1:
                raise InputError(
                    f"unit={self.names!r} must name one {kind}, of {', '.join(known)}; "
                    "such as unit='au, yr, Msun'."
                )
        object.__setattr__(self, "names", ", ".join(names))

    def _size(self, kind: str) -> float:
        return next(KINDS[kind][name] for name in self.names.split(", ") if name in KINDS[kind])

    @cached_property
    def G(self) -> float:
        """The constant of gravitation."""
        return self._size("mass") * self._size("time") ** 2 / self._size("length") ** 3

    @cached_property
    def c(self) -> float:
        """The velocity of light."""
        return LIGHT * self._size("time") / self._size("length")
