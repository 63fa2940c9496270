"""The Solar System: the Sun and eight planets, the Moon's mass with the Earth's.

Ellipses at J2000.0 of Standish and Williams' table for 1800 to 2050, with respect to
the mean ecliptic and equinox of J2000. Masses of the JPL ephemeris DE405, as in the
Almanac. G is the square of the Gaussian gravitational constant. Each planet starts on
its ellipse about the Sun, as if alone with it.
"""

from fractions import Fraction
from functools import cache
from typing import Any

from problems.catalogue._planets import Frame, Unit, planetary
from problems.entry import Expected, entry
from problems.picture import Orbits
from problems.problem import Problem

GAUSSIAN_CONSTANT = "0.01720209895"  # au^(3/2)/(solar mass^(1/2) day)
# Sun's mass over planet's mass: Mercury, Venus, Earth and Moon, Mars, Jupiter, Saturn, Uranus, Neptune.
MASS_RATIOS = (
    "6023600",
    "408523.71",
    "328900.561400",
    "3098708",
    "1047.3486",
    "3497.898",
    "22902.98",
    "19412.24",
)
# Semi-major axis (au), eccentricity, inclination, mean longitude, longitudes of perihelion and node (deg).
ELEMENTS = (
    ("0.38709927", "0.20563593", "7.00497902", "252.25032350", "77.45779628", "48.33076593"),
    ("0.72333566", "0.00677672", "3.39467605", "181.97909950", "131.60246718", "76.67984255"),
    ("1.00000261", "0.01671123", "-0.00001531", "100.46457166", "102.93768193", "0.0"),
    ("1.52371034", "0.09339410", "1.84969142", "-4.55343205", "-23.94362959", "49.55953891"),
    ("5.20288700", "0.04838624", "1.30439695", "34.39644051", "14.72847983", "100.47390909"),
    ("9.53667594", "0.05386179", "2.48599187", "49.95424423", "92.59887831", "113.66242448"),
    ("19.18916464", "0.04725744", "0.77263783", "313.23810451", "170.95427630", "74.01692503"),
    ("30.06992276", "0.00859048", "1.77004347", "-55.12002969", "44.96476227", "131.78422574"),
)


@entry(
    title="the Solar System",
    references=(
        "E. M. Standish, J. G. Williams, Keplerian elements for approximate positions of the "
        "major planets, Jet Propulsion Laboratory, table 1",
        "The Astronomical Almanac for the year 2006, page K7",
    ),
    notes="Periods from 0.24 to 165 years; approximate ellipses, not an ephemeris.",
    shows=("unit", "frame"),
    picture=Orbits(
        dimension=3,
        first=5,
        span=165.0,
        points=6000,
        limits=(-35.0, 75.0, None, None),
        inset=(1, 5, 1.9, "Mercury to Mars"),
    ),
    expected=Expected(h=0.02, energy=5e-16, default=1e-15),
)
def solar_system(*, unit: Unit = "year", frame: Frame = "barycentric", t_end: float | None = None) -> Problem:
    """Return the Solar System, nine bodies.

    Tests long-time conservation with periods from 0.24 to 165 years and a
    Mercury whose eccentricity rules the step.

    Parameters
    ----------
    unit : {"year", "day"}
        Unit of time; a year is 365.25 days. Distances are in astronomical units.
    frame : {"barycentric", "heliocentric"}
        ``"heliocentric"``: the Sun at rest at the origin; ``"barycentric"``: moved to
        the barycentre and its velocity, in exact arithmetic, rounded once.
    t_end : float, optional
        End of the integration; 1200 years by default.

    Returns
    -------
    Problem
        State: positions body by body (Sun first), then momenta. Invariants:
        energy, angular momentum, and in the heliocentric frame the linear
        momentum (in the other one it is 0 but for rounding).
    """
    positions, velocities = heliocentric()
    return planetary(
        "solar_system",
        unit=unit,
        frame=frame,
        t_end=t_end,
        gravity_per_day=Fraction(GAUSSIAN_CONSTANT) ** 2,
        masses=[Fraction(1), *(1 / Fraction(text) for text in MASS_RATIOS)],
        positions=positions,
        velocities=velocities,
    )


@cache
def heliocentric() -> tuple[tuple[tuple[Fraction, ...], ...], tuple[tuple[Fraction, ...], ...]]:
    """Return positions and velocities about the Sun, in au and au per day, to 40 digits.

    Returns
    -------
    positions, velocities : tuple of 9 tuples of 3 Fraction
        The Sun, at the origin, first.
    """
    import mpmath

    positions: list[tuple[Fraction, ...]] = [(Fraction(0),) * 3]
    velocities = list(positions)
    with mpmath.workdps(50):
        attraction = mpmath.mpf(GAUSSIAN_CONSTANT) ** 2
        for texts, ratio in zip(ELEMENTS, MASS_RATIOS, strict=True):
            elements = [mpmath.mpf(text) for text in texts]
            q, v = _on_ellipse(elements, attraction * (1 + 1 / mpmath.mpf(ratio)))
            positions.append(tuple(Fraction(str(mpmath.nstr(x, 40))) for x in q))
            velocities.append(tuple(Fraction(str(mpmath.nstr(x, 40))) for x in v))
    return tuple(positions), tuple(velocities)


def _on_ellipse(elements: list[Any], attraction: Any) -> tuple[list[Any], list[Any]]:
    import mpmath

    a, e, *angles = elements
    inclination, longitude, perihelion, node = (mpmath.radians(angle) for angle in angles)
    mean = longitude - perihelion
    eccentric = mpmath.findroot(lambda x: x - e * mpmath.sin(x) - mean, mean + e * mpmath.sin(mean))
    c, s, minor = mpmath.cos(eccentric), mpmath.sin(eccentric), mpmath.sqrt(1 - e * e)
    speed = mpmath.sqrt(attraction / a) / (1 - e * c)
    plane = ((a * (c - e), a * minor * s), (-speed * s, speed * minor * c))
    w = perihelion - node
    # The columns of Rz(node) Rx(inclination) Rz(w): towards the perihelion, and 90 degrees ahead of it.
    cw, sw, cn, sn = mpmath.cos(w), mpmath.sin(w), mpmath.cos(node), mpmath.sin(node)
    ci, si = mpmath.cos(inclination), mpmath.sin(inclination)
    towards = (cw * cn - sw * sn * ci, cw * sn + sw * cn * ci, sw * si)
    ahead = (-sw * cn - cw * sn * ci, -sw * sn + cw * cn * ci, cw * si)
    q, v = ([x * t + y * u for t, u in zip(towards, ahead, strict=True)] for x, y in plane)
    return q, v
