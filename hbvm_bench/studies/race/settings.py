"""The settings that run, declared here before any of them is run: equally many for every family.

Every ladder was laid, in trials, so that it spans the family's useful range on the
problem, from loose to as accurate as it gets; the fastest setting that is accurate
enough is then picked afterwards, by the same rule for all
(`hbvm_bench.studies.race.standings`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from hbvm_bench.campaign.identity import make_method
from hbvm_bench.studies.race.results import Setting

SETTINGS = 16
"""Settings of each family on each problem."""

QUICK_SETTINGS = 3
"""The same for ``--quick``."""

OURS = "hbvm"


@dataclass(frozen=True)
class Family:
    """What runs under one name in the race.

    Attributes
    ----------
    title, short : str
        For readers; for column heads.
    lead : str
        The method whose colour and marker it has.
    fixed : bool
        Whether its step is fixed, so that its samples are own steps.
    code : str
        What machine code runs.
    """

    title: str
    short: str
    lead: str
    fixed: bool
    code: str


FAMILIES: dict[str, Family] = {
    OURS: Family(
        "HBVM and Gauss, fixed step",
        "HBVM, Gauss",
        "HBVM",
        True,
        "compiled here by numba for this processor, vector instructions as it has them",
    ),
    "heyoka": Family(
        "heyoka, Taylor",
        "heyoka",
        "Taylor",
        False,
        "compiled here by heyoka's LLVM for this processor",
    ),
    "ias15": Family(
        "REBOUND, IAS15",
        "IAS15",
        "IAS15",
        False,
        "the wheel's, for any x86-64; forces other than gravity compiled here by numba",
    ),
    "whfast": Family("REBOUND, WHFast", "WHFast", "WHFast", True, "the wheel's, for any x86-64"),
    "whfast512": Family(
        "REBOUND, WHFast512",
        "WHFast512",
        "WHFast512",
        True,
        "the wheel's, in AVX-512 instructions; on other processors it does not run",
    ),
    "leapfrog": Family(
        "REBOUND, leapfrog",
        "leapfrog",
        "Leapfrog",
        True,
        "the wheel's, for any x86-64; forces other than gravity compiled here by numba",
    ),
    "dop853": Family(
        "SciPy, DOP853",
        "DOP853",
        "DOP853",
        False,
        "a step loop in Python around a vector field compiled here by numba",
    ),
}

Ladder = Sequence[tuple[int, int, Sequence[float]]]  # k, s, steps

_CHAIN: Ladder = (
    (8, 8, (1.25, 1.0, 0.75, 0.625, 0.6, 0.5, 0.375)),
    (8, 6, (0.5, 0.375, 0.3)),
    (12, 12, (1.0, 0.75)),
    (16, 16, (1.5, 1.25, 1.0, 0.75)),
)
_OURS: dict[str, Ladder] = {
    "outer_solar_system": (
        (8, 8, (3.0, 2.5, 2.0, 1.6, 1.5, 1.25)),
        (16, 8, (2.5, 2.0)),
        (16, 12, (3.0, 2.5)),
        (12, 12, (2.5, 2.0)),
        (16, 16, (4.0, 3.2, 3.0, 2.5)),
    ),
    "sitnikov": (
        (8, 8, (0.15, 0.125, 0.12, 0.1, 0.08)),
        (16, 8, (0.15, 0.125)),
        (12, 12, (0.1875, 0.16, 0.15)),
        (16, 12, (0.25, 0.1875)),
        (16, 16, (0.25, 0.24, 0.2, 0.1875)),
    ),
    "kepler": (
        (8, 8, (0.25, 0.2, 0.15, 0.125)),
        (16, 8, (0.3, 0.2)),
        (12, 12, (0.4, 0.3, 0.25)),
        (16, 12, (0.4, 0.3)),
        (16, 16, (0.6, 0.5, 0.45, 0.4, 0.35)),
    ),
    "henon_heiles": (
        (8, 8, (1.25, 1.0, 0.75, 0.5)),
        (16, 8, (1.5, 1.0)),
        (12, 12, (2.0, 1.6, 1.5)),
        (16, 12, (2.5, 2.4, 2.0)),
        (16, 16, (3.0, 2.5, 2.4, 2.0)),
    ),
    "fput32": _CHAIN,
    "fput100": _CHAIN,
    "pendulum": (
        (8, 8, (1.0, 0.75, 0.6, 0.5)),
        (16, 8, (1.5, 1.0, 0.75)),
        (12, 12, (1.5, 1.25)),
        (16, 12, (2.0, 1.5)),
        (16, 16, (2.5, 2.4, 2.0, 1.6, 1.5)),
    ),
    "double_pendulum": (
        (8, 8, (1.0, 0.75, 0.6, 0.5, 0.375)),
        (16, 8, (1.0, 0.75)),
        (12, 12, (1.5, 1.25, 1.0)),
        (16, 12, (1.5, 1.25)),
        (16, 16, (2.0, 1.5, 1.25, 1.0)),
    ),
    "cr3bp": (
        (8, 8, (0.01, 0.005, 0.0025, 0.00125)),
        (16, 8, (0.01, 0.005, 0.0025)),
        (12, 12, (0.01, 0.005, 0.0025)),
        (16, 12, (0.01, 0.005)),
        (16, 16, (0.02, 0.01, 0.005, 0.0025)),
    ),
}

_FAST = ", fast_math=True"
_COMPACT = ", compact_mode=True"
_ACCURATE = ", high_accuracy=True"


def _taylor(options: str, *tolerances: float) -> list[str]:
    return [f"Taylor(tol={tol}{options})" for tol in tolerances]


_STANDARD_TAYLOR = [
    *_taylor("", 1e-6, 1e-9, 1e-12, 1e-14, 1e-15),
    "Taylor()",
    *_taylor(_FAST, 1e-12, 1e-13, 3e-14, 1e-14, 1e-15),
    *_taylor(_COMPACT, 1e-13, 1e-14, 1e-15),
    *_taylor(_ACCURATE, 1e-16, 1e-18),
]
# Without compact mode a system this large compiles for tens of seconds, at every order anew.
_LARGE_TAYLOR = [
    *_taylor(_COMPACT, 1e-6, 1e-9, 1e-12, 1e-13, 1e-14, 1e-15),
    *_taylor(_COMPACT + _FAST, 1e-13, 1e-14, 1e-15),
    *_taylor("", 1e-12, 1e-13),
    "Taylor()",
    *_taylor(_FAST, 1e-12, 1e-13),
    *_taylor(_ACCURATE + _COMPACT, 1e-16, 1e-18),
]

_IAS15_PLANETS = (
    [f"IAS15(epsilon={e})" for e in (0.1, 1e-2, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 1e-7)]
    + ["IAS15()"]
    + [f"IAS15(epsilon={e}, mode='global')" for e in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)]
)
# Where a coordinate passes through zero together with its acceleration, the default criterion stalls.
_IAS15_ZEROS = (
    ["IAS15()"]
    + [
        f"IAS15(epsilon={e}, mode='global')"
        for e in (1e-2, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 1e-7, 1e-8, 1e-9)
    ]
    + [f"IAS15(epsilon={e}, mode='aarseth85')" for e in (1e-3, 1e-5, 1e-7, 1e-9)]
)

_WHFAST = [
    f"WHFast(h={h}, corrector=17{kernel})"
    for kernel in ("", ", kernel='lazy'")
    for h in (1.0, 0.5, 0.3, 0.2, 0.125, 0.1, 0.05, 0.025)
]

_WHFAST512 = [
    f"WHFast512(h={h}, corrector=17)"
    for h in (1.0, 0.75, 0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.125, 0.1, 0.075, 0.05, 0.04, 0.025, 0.02)
]

# Multiples of the step at which order 8 begins to resolve the motion.
_LEAPFROG = {
    2: (0.25,),
    4: (0.5, 0.25, 0.125, 0.0625),
    6: (1.0, 0.5, 0.25, 0.125, 0.0625),
    8: (1.0, 0.75, 0.5, 0.375, 0.25, 0.125),
}
_LEAPFROG_STEP = {"sitnikov": 0.16, "kepler": 0.1}
_LEAPFROG_STEP_ELSEWHERE = 0.8

_DOP853 = (
    *(1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10),
    *(3e-11, 1e-11, 3e-12, 1e-12, 3e-13, 1e-13, 5e-14, 2.3e-14),
)
# Momenta of light bodies are small numbers that the tolerance must still resolve.
_ATOL_OVER_RTOL = {"outer_solar_system": 1e-4, "sitnikov": 1e-4}

_ONLY_AT_HOME = {"whfast": ("outer_solar_system",), "whfast512": ("outer_solar_system",)}


def settings(contest: str, *, quick: bool = False) -> list[Setting]:
    """Return the settings of a contest, family by family, equally many for each.

    Parameters
    ----------
    contest : str
        Key of a contest in `hbvm_bench.studies.race.contests`.
    quick : bool
        Only `QUICK_SETTINGS` of each family, such as compile fast.
    """
    ladders = {
        OURS: [_ours(k, s, h) for k, s, steps in _OURS[contest] for h in steps],
        "heyoka": _LARGE_TAYLOR if contest == "fput100" else _STANDARD_TAYLOR,
        "ias15": _IAS15_PLANETS if contest in ("outer_solar_system", "kepler") else _IAS15_ZEROS,
        "whfast": _WHFAST,
        "whfast512": _WHFAST512,
        "leapfrog": [
            f"Leapfrog(h={factor * _LEAPFROG_STEP.get(contest, _LEAPFROG_STEP_ELSEWHERE):.6g}, order={order})"
            for order, factors in _LEAPFROG.items()
            for factor in factors
        ],
        "dop853": [
            f"DOP853(rtol={rtol}, atol={rtol * _ATOL_OVER_RTOL.get(contest, 1.0):.3g})" for rtol in _DOP853
        ],
    }
    return [
        Setting(family=family, method=repr(make_method(method)), default=method in ("Taylor()", "IAS15()"))
        for family, ladder in ladders.items()
        if contest in _ONLY_AT_HOME.get(family, (contest,))
        for method in ([ladder[i] for i in _quick(family, contest)] if quick else ladder)
    ]


def _quick(family: str, contest: str) -> tuple[int, ...]:
    """Return which of a family's ladder run with ``--quick``."""
    if family == "heyoka":
        return (3, 4, 5) if contest == "fput100" else (11, 12, 13)  # compact mode
    return {
        OURS: (3, 8, 14),
        "ias15": (6, 8, 9),
        "whfast": (9, 11, 13),
        "whfast512": (3, 7, 12),
        "leapfrog": (12, 14, 15),
        "dop853": (11, 13, 15),
    }[family]


def _ours(k: int, s: int, h: float) -> str:
    return f"Gauss(s={s}, h={h})" if k == s else f"HBVM(k={k}, s={s}, h={h})"
