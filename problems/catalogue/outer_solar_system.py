"""The outer Solar System: the Sun, Jupiter, Saturn, Uranus, Neptune and Pluto.

Data of the book's table: 5 September 1994, 0h00; distances in astronomical units,
velocities in astronomical units per day, masses in solar masses, heliocentric. The
Sun's mass contains the inner planets.
"""

from fractions import Fraction

from problems.catalogue._planets import Frame, Unit, planetary
from problems.entry import Expected, entry
from problems.picture import Orbits
from problems.problem import Problem

G_PER_DAY = "2.95912208286e-4"  # au^3/(solar mass day^2)
# The bodies in the order of the first line.
MASSES = (
    "1.00000597682",
    "0.000954786104043",
    "0.000285583733151",
    "0.0000437273164546",
    "0.0000517759138449",
    "1/130000000",
)
POSITIONS = (
    ("0", "0", "0"),
    ("-3.5023653", "-3.8169847", "-1.5507963"),
    ("9.0755314", "-3.0458353", "-1.6483708"),
    ("8.3101420", "-16.2901086", "-7.2521278"),
    ("11.4707666", "-25.7294829", "-10.8169456"),
    ("-15.5387357", "-25.2225594", "-3.1902382"),
)
VELOCITIES = (
    ("0", "0", "0"),
    ("0.00565429", "-0.00412490", "-0.00190589"),
    ("0.00168318", "0.00483525", "0.00192462"),
    ("0.00354178", "0.00137102", "0.00055029"),
    ("0.00288930", "0.00114527", "0.00039677"),
    ("0.00276725", "-0.00170702", "-0.00136504"),
)


@entry(
    title="the outer Solar System",
    references=(
        "E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd edition, "
        "Springer 2006, section I.2.4, table 2.2",
    ),
    notes="A dominant mass and weak perturbations; the inner planets are in the Sun's mass.",
    shows=("unit", "frame"),
    picture=Orbits(dimension=3, first=1, span=260.0, points=2500),
    expected=Expected(h=1.0, energy=5e-15, default=5e-15),
)
def outer_solar_system(
    *, unit: Unit = "year", frame: Frame = "barycentric", t_end: float | None = None
) -> Problem:
    """Return the outer Solar System, six bodies.

    Tests long-time conservation on weakly perturbed ellipses, where a dominant
    mass lets splitting methods shine.

    Parameters
    ----------
    unit : {"year", "day"}
        Unit of time. A year is 365.25 days; G is 2.95912208286e-4 in days and
        that times 365.25^2 in years. Distances are in astronomical units.
    frame : {"barycentric", "heliocentric"}
        ``"heliocentric"``: the table as published, the Sun at rest at the origin;
        the barycentre then moves by 0.002 au a year. ``"barycentric"``: moved to the
        barycentre and its velocity, in exact arithmetic, rounded once.
    t_end : float, optional
        End of the integration; 1200 years by default.

    Returns
    -------
    Problem
        State: positions body by body (Sun first), then momenta. Invariants:
        energy, angular momentum, and in the heliocentric frame the linear
        momentum (in the other one it is 0 but for rounding).
    """
    return planetary(
        "outer_solar_system",
        unit=unit,
        frame=frame,
        t_end=t_end,
        gravity_per_day=Fraction(G_PER_DAY),
        masses=[Fraction(text) for text in MASSES],
        positions=[[Fraction(text) for text in row] for row in POSITIONS],
        velocities=[[Fraction(text) for text in row] for row in VELOCITIES],
    )
