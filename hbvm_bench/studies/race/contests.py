"""The problems of the race and what is asked of them, declared before the run.

The spans are as long as the accuracy that is asked for allows: on longer ones the
round-off of every double-precision code exceeds it, and on chaotic problems
(`double_pendulum` at larger energies, `henon_heiles` from most starts at this energy)
no code has a position after a few hundred units of time. The starts are regular
orbits for that reason.
"""

from hbvm_bench.studies.race.results import Contest, Goal
from problems.errors import unknown

_CONTESTS = (
    Contest(
        key="outer_solar_system",
        title="Outer Solar System, six bodies, 12 000 years",
        problem="outer_solar_system(t_end=12000.0)",
        goals=(
            Goal(family="heyoka", ratio=10.0),
            Goal(family="ias15", ratio=25.0),
            Goal(family="whfast", ratio=3.0, energy=1e-10, position=None),
        ),
        note="The home ground of WHFast: symplectic correctors of order 17, its plain and its lazy kernel, "
        "safe mode off. WHFast512 has a row of its own: it needs a processor with AVX-512.",
    ),
    Contest(
        key="sitnikov",
        title="Sitnikov's problem, e = 0.75, 280 revolutions of the primaries",
        problem="sitnikov(e=0.75, t_end=6000.0)",
        position=1e-8,
        goals=(
            Goal(family="heyoka", ratio=5.0, position=1e-8),
            Goal(family="ias15", ratio=12.0, position=1e-8),
        ),
        note="The planetoid stays on the axis only while rounding keeps the symmetry bit for bit; a run "
        "that leaves it follows another trajectory and is void. IAS15's default criterion stalls where the "
        "planetoid crosses the primaries' plane, so its other settings use other criteria. WHFast does not "
        "run: no body dominates.",
    ),
    Contest(
        key="kepler",
        title="Kepler's problem, e = 0.6, 500 revolutions",
        problem="kepler(e=0.6, t_end=3150.0)",
        goals=(Goal(family="heyoka", ratio=3.0),),
    ),
    Contest(
        key="henon_heiles",
        title="Hénon–Heiles, E = 1/8, a regular orbit",
        problem="henon_heiles(energy=0.125, q2=0.1, t_end=9600.0)",
        goals=(Goal(family="heyoka", ratio=3.0),),
    ),
    Contest(
        key="fput32",
        title="Fermi–Pasta–Ulam–Tsingou chain, 32 masses, thermal start",
        problem="fput(n=32, start='thermal', t_end=12000.0)",
        goals=(Goal(family="heyoka", ratio=12.0),),
    ),
    Contest(
        key="fput100",
        title="Fermi–Pasta–Ulam–Tsingou chain, 100 masses, thermal start",
        problem="fput(n=100, start='thermal', t_end=3000.0)",
        goals=(Goal(family="heyoka", ratio=20.0),),
    ),
    Contest(
        key="pendulum",
        title="Pendulum, a swing near the separatrix",
        problem="pendulum(t_end=12000.0)",
        note="Transcendental: the price of sine and cosine decides.",
    ),
    Contest(
        key="double_pendulum",
        title="Double pendulum, a regular orbit",
        problem="double_pendulum(q1=0.5, q2=0.7, t_end=3000.0)",
        note="Not separable: our first-order form; REBOUND's methods do not apply.",
    ),
    Contest(
        key="cr3bp",
        title="Restricted three-body problem, Arenstorf's orbit of four loops, one period",
        problem="cr3bp(loops=4)",
        note="Not separable, with close passages: a fixed step is a poor choice here, and the run is short, "
        "so that the overhead of a call weighs on the fastest settings.",
    ),
)

CONTESTS: dict[str, Contest] = {contest.key: contest for contest in _CONTESTS}

QUICK_SHARE = 0.1
"""Of the span, with ``--quick``."""


def chosen(keys: list[str] | None) -> list[Contest]:
    """Return the contests with these keys, all by default, in the order of declaration.

    Raises
    ------
    problems.errors.UnknownNameError
        For a key that does not exist, with the nearest ones.
    """
    for key in keys or []:
        if key not in CONTESTS:
            raise unknown("problem of the race", key, CONTESTS)
    return [contest for contest in _CONTESTS if not keys or contest.key in keys]
