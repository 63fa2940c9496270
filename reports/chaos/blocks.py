"""The page on chaos, from stored results alone: published and computed values, and the maps."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median

import numpy as np

from hbvm_bench.measure.computation import Task, split
from hbvm_bench.report.document import Claim, Claims, Items, Maker, Note, Section
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.figures.drawn import number
from hbvm_bench.report.page import Results
from hbvm_bench.report.parts import Part, PartResults, claims_of, sections_of, tasks_of
from hbvm_bench.store.records import OTHER_WORK, Load
from hbvm_bench.summaries.rows import seconds as in_words
from hbvm_bench.summaries.table import NONE, Table
from integrators.dynamics.lyapunov import INTERVALS

from . import exponents, figures, maps, orbits
from .beside_pynamicalsys import ATOL, RTOL
from .systems import SOURCES, SYSTEMS, Known, Published

PIECES = 8  # of a map, for the processes to share


@dataclass(frozen=True)
class Size:
    """How much is computed: the share of every time, and the points of the maps along each axis."""

    share: float
    samples: int
    sitnikov: tuple[int, int]
    turns: int
    section: tuple[int, int]
    section_end: float
    asteroids: tuple[int, int]
    revolutions: int


FULL = Size(1.0, exponents.SAMPLES, (91, 66), 200, (81, 61), 1000.0, (121, 61), 100)
QUICK = Size(0.02, 1, (4, 4), 10, (5, 5), 20.0, (4, 3), 2)


@dataclass(frozen=True)
class Grids:
    """Where the maps are computed."""

    es: list[float]
    speeds: list[float]
    positions: list[float]
    momenta: list[float]
    axes: list[float]
    eccentricities: list[float]

    @classmethod
    def from_size(cls, size: Size) -> "Grids":
        """Return the grids of a size."""
        return cls(
            es=np.linspace(0.0, 0.9, size.sitnikov[0]).round(6).tolist(),
            speeds=np.linspace(0.05, 1.35, size.sitnikov[1]).round(6).tolist(),
            positions=np.linspace(-0.48, 0.96, size.section[0]).round(6).tolist(),
            momenta=np.linspace(-0.6, 0.6, size.section[1]).round(6).tolist(),
            axes=np.linspace(0.45, 1.0, size.asteroids[0]).round(6).tolist(),
            eccentricities=np.linspace(0.0, 0.5, size.asteroids[1]).round(6).tolist(),
        )


def parts(*, quick: bool) -> list[Part]:
    """Return what is computed and shown, in a quick run or a whole one."""
    size = QUICK if quick else FULL
    grids = Grids.from_size(size)
    measured = partial(exponents.measured, share=size.share, samples=size.samples)
    planets = partial(orbits.planets, share=size.share, samples=size.samples)
    timed = [
        *(Task(f"of {name}", partial(measured, name), timed=True) for name in SYSTEMS),
        *(Task(f"planets {name}", partial(planets, name), timed=True) for name in orbits.PLANETS),
    ]
    sitnikov = partial(maps.sitnikov, speeds=grids.speeds, turns=size.turns)
    asteroids = partial(maps.asteroids, axes=grids.axes, turns=size.revolutions)
    sections = [
        task
        for i, energy in enumerate(maps.ENERGIES)
        for task in split(
            f"energy{i}",
            partial(
                maps.henon_heiles_section, positions=grids.positions, energy=energy, t_end=size.section_end
            ),
            grids.momenta,
            PIECES,
            3.0,
        )
    ]
    checks = [
        Task("checks", partial(orbits.checks, size.share)),
        Task("curves", partial(orbits.curves, size.share)),
    ]
    return [
        Part(
            "exponents",
            "Lyapunov exponents of known systems",
            timed,
            _exponent_claims,
            partial(_exponent_blocks, size.share),
        ),
        Part("indicators", "Exact relations", checks, _exact_claims, _curve_blocks),
        Part(
            "sitnikov",
            "Sitnikov's problem",
            split("map", sitnikov, grids.es, PIECES, 20.0),
            _none,
            lambda results: [
                ("the map", lambda: figures.sitnikov(grids.es, grids.speeds, results["map"], size.turns))
            ],
        ),
        Part(
            "henon-heiles",
            "The Hénon–Heiles problem",
            sections,
            _none,
            lambda results: [
                (
                    "the sections",
                    lambda: figures.sections(
                        grids.positions,
                        grids.momenta,
                        [results[f"energy{i}"] for i in range(len(maps.ENERGIES))],
                        size.section_end,
                    ),
                )
            ],
        ),
        Part(
            "restricted",
            "The restricted three-body problem",
            split("map", asteroids, grids.eccentricities, PIECES, 20.0),
            _none,
            lambda results: [
                (
                    "the map",
                    lambda: figures.asteroids(
                        grids.axes, grids.eccentricities, results["map"], size.revolutions
                    ),
                )
            ],
        ),
    ]


def tasks(quick: bool) -> list[Task]:
    """Return the computations of a quick run, or of a whole one."""
    return tasks_of(parts(quick=quick))


def claims(run: Results) -> Section:
    """Return every published or exact value with the computed one."""
    return claims_of(_parts(run), run, "Published and exact values", "Values", "published or exact")


def experiments(run: Results) -> list[Section]:
    """Return the section of each part."""
    return sections_of(_parts(run), run)


def _parts(run: Results) -> list[Part]:
    return parts(quick=run.runs[-1].index.campaign.quick)


def _none(results: PartResults) -> list[Claim]:
    del results
    return []


def _measured(results: PartResults) -> dict[str, exponents.Measured]:
    return {name: results[f"of {name}"] for name in SYSTEMS}


def _interval(value: float, low: float, high: float) -> str:
    """Write a value with its interval, to two digits of the interval's width."""
    digits = max(0, 1 - int(np.floor(np.log10(max(high - low, 1e-12)))))
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def _within(known: Published, measured: exponents.Measured) -> bool:
    low, high = measured.intervals[0]
    return bool(low <= known.exponents[0] <= high)


def _exponent_claims(results: PartResults) -> list[Claim]:
    judged = []
    for name, here in _measured(results).items():
        for published in SYSTEMS[name].published:
            fits = _within(published, here)
            judged.append(
                Claim(
                    f"{SYSTEMS[name].title}: the largest exponent",
                    f"{published.exponents[0]:g} ({published.source})",
                    _interval(here.exponents[0], *here.intervals[0])
                    + ("" if fits else f". {_decided(SYSTEMS[name], published, here)}"),
                    "holds" if fits else "no",
                )
            )
    return judged


def _decided(known: Known, published: Published, here: exponents.Measured) -> str:
    """Return what an exact relation says of a published value outside the computed interval."""
    low, high = here.intervals[0]
    agrees = "inside" if low <= here.heyoka[0] <= high else "outside"
    other = f"heyoka's value is {here.heyoka[0]:.4f}, {agrees} this interval"
    total = sum(published.exponents)
    if known.divergence is None:
        return f"The divergence is not constant, so the sum is not known exactly; {other}"
    if len(published.exponents) == 4:
        return (
            f"The exponents of a Hamiltonian system come in pairs of opposite signs and add up to 0; the "
            f"published ones add up to {total:.4f} and are not paired, the computed ones add up to "
            f"{here.sum:.1e}; {other}"
        )
    if abs(total - known.divergence) > len(published.exponents) * 1e-4:
        return (
            f"The sum of the exponents equals the divergence, {known.divergence:g}. The published ones "
            "add up "
            f"to {total:.4f}, the computed ones to the divergence within "
            f"{abs(here.sum - known.divergence):.0e}; {other}"
        )
    return (
        f"The published exponents add up to the divergence, {known.divergence:g}, and so do the computed "
        f"ones (within {abs(here.sum - known.divergence):.0e}), so the sum does not decide; {other}"
    )


def _exact_claims(results: PartResults) -> list[Claim]:
    checks: orbits.Checks = results["checks"]
    curves: orbits.Curves = results["curves"]
    off = abs(checks.sum + 41 / 3)
    ratio = 2.0 * curves.chaotic[1, -1] / (curves.exponent * curves.chaotic[0, -1])
    last, flat = float(curves.regular[1, -1]), float(curves.linear[1, -1])
    low, high = checks.interval

    def claim(words: str, given: str, here: str, *, holds: bool) -> Claim:
        return Claim(words, given, here, "holds" if holds else "no")

    return [
        claim(
            f"Lorenz, `{orbits.LORENZ!r}`: the largest exponent",
            "0.90563; 0.9056 (Sprott 2003)",
            _interval(checks.exponent, low, high),
            holds=bool(low <= 0.90563 <= high),
        ),
        claim("Lorenz: the sum of the exponents", "−41/3, to 1e-10", f"off by {off:.0e}", holds=off < 1e-10),
        claim(
            f"Hénon–Heiles, `{orbits.PAIRS!r}`: exponents in pairs of opposite signs",
            "to 1e-10",
            f"largest sum of a pair {checks.pairs:.0e}; the largest exponent is {checks.largest:.3f}",
            holds=checks.pairs < 1e-10,
        ),
        claim(
            "MEGNO of a quasi-periodic orbit of a nonlinear system",
            "2",
            f"{last:.3f} at t = {curves.regular[0, -1]:g}",
            holds=abs(last - 2.0) < 5e-4,
        ),
        claim("MEGNO of linear oscillators", "0", f"{flat:.4f}", holds=abs(flat) < 5e-4),
        claim(
            "MEGNO of a chaotic orbit over λt/2, with λ from the same orbit",
            "1",
            f"{ratio:.3f}; λ = {_interval(curves.exponent, *curves.interval)}",
            holds=abs(ratio - 1.0) < 0.05,
        ),
    ]


def _exponent_blocks(share: float, results: PartResults) -> list[Maker]:
    def planets() -> Table:
        return _planets({name: results[f"planets {name}"] for name in orbits.PLANETS}, share)

    return [
        ("the times", lambda: _times(_measured(results))),
        ("the planets", planets),
        ("how", lambda: Note(HOW)),
        ("the sources", lambda: Items([f"{key}: {text}" for key, text in SOURCES.items()])),
    ]


def _curve_blocks(results: PartResults) -> list[Maker]:
    return [("MEGNO over time", lambda: figures.curves(results["curves"]))]


HOW = (
    f"HBVM: `{exponents.METHOD!r}` with its tangent vectors (`integrators.lyapunov`). heyoka: "
    f"`var_ode_sys` of first order and `taylor_adaptive` with tol={exponents.TOLERANCE:g}. Both make all "
    f"vectors orthonormal equally often, at least {INTERVALS} times, in Python; the runs of one "
    "system alternate in one process on one core, compiled before. Intervals: 95 %, from the slowest "
    "fluctuations of the growth; of fifteen such intervals 0.75 miss the true value on average. The last "
    "digits of published values are estimates."
)


def _spent(seconds: Sequence[float], others: float, steal: float) -> str:
    busy = Load(others=others, steal=steal).verdict()
    return in_words(median(seconds)) + " (not judged)" * bool(busy)


def _busy(shares: Sequence[float]) -> str:
    if Load(others=max(shares), steal=0.0).verdict():
        return (
            f" Not judged: other work took more than {OTHER_WORK:.0%} of a core during the timing, at most "
            f"{max(shares):.0%}."
        )
    return f" During the timing other work took at most {max(shares):.0%} of a core."


def _times(measured: dict[str, exponents.Measured]) -> Table:
    rows = []
    summed, timed = "divergence of the vector field, where that is a constant", ""
    if any(here.divergence is not None for here in measured.values()):  # not in older results
        summed = "mean divergence of the vector field along the trajectory"
        timed = "; where the divergence is not constant, the times of HBVM() contain its integration"
    for name, here in measured.items():
        known, load_ = SYSTEMS[name], (here.others, here.stolen)
        divergence = known.divergence if here.divergence is None else here.divergence
        off = NONE if divergence is None else f"{abs(here.sum - divergence):.0e}"
        rows.append(
            (
                known.title,
                ", ".join(f"{exponents_.exponents[0]:g}" for exponents_ in known.published),
                _interval(here.exponents[0], *here.intervals[0]),
                f"{here.heyoka[0]:.4f}",
                f"{here.time:.0f}",
                off,
                _spent(here.seconds, *load_),
                _spent(here.heyoka_seconds, *load_),
                NONE if here.pynamicalsys is None else f"{here.pynamicalsys[0]:.4f}",
                NONE
                if here.pynamicalsys_seconds is None
                else _spent(here.pynamicalsys_seconds, *load_)
                if here.pynamicalsys_seconds
                else "not installed",
            )
        )
    return Table(
        "Exponents and times",
        (
            *("system", "published", "HBVM(), 95 %", "heyoka", "time span", "sum off by"),
            *("time, HBVM()", "time, heyoka", "pynamicalsys", "time, pynamicalsys"),
        ),
        rows,
        f"Sum off by: the sum of the computed exponents less the {summed}. Times: median of whole runs with "
        f"all exponents, without compiling{timed}."
        + _beside_pynamicalsys(measured.values())
        + _busy([max(here.others, here.stolen) for here in measured.values()]),
        words=(0,),
        key="exponents-times",
    )


def _beside_pynamicalsys(measured: Iterable[exponents.Measured]) -> str:
    """Return how long pynamicalsys takes, relative to HBVM(); nothing where it did not run."""
    ratios = [
        median(here.pynamicalsys_seconds) / median(here.seconds)
        for here in measured
        if here.pynamicalsys_seconds
    ]
    if not ratios:
        return ""
    return (
        f" pynamicalsys takes {min(ratios):.2g} to {max(ratios):.2g} times as long as HBVM(), with the "
        f"tolerances of its documentation's example, rk45 with rtol={RTOL:g} and atol={ATOL:g}."
    )


def _planets(systems: dict[str, orbits.Planets], share: float) -> Table:
    t_end = share * orbits.REVOLUTIONS * orbits.PERIOD
    rows = [
        (
            f"{name}: a = {orbits.PLANETS[name][0]:g}, e = {orbits.PLANETS[name][1]:g}",
            row.method,
            f"{row.megno:.4g}",
            number(2.0 * row.megno / t_end),
            number(row.exponent)
            if row.low is None or row.high is None
            else f"{number(row.exponent)} [{number(row.low)}, {number(row.high)}]",
            _spent(row.seconds, system.others, system.stolen),
        )
        for name, system in systems.items()
        for row in system.rows
    ]
    return Table(
        "Sun, Jupiter and Saturn, beside REBOUND's MEGNO",
        ("Saturn", "method", "MEGNO", "2 MEGNO/t", "exponent", "time"),
        rows,
        f"Over {share * orbits.REVOLUTIONS:g} revolutions of Jupiter, from the same initial doubles, with "
        "Saturn's semi-major axis a and eccentricity e. REBOUND integrates variational equations of "
        "gravitating bodies only, so it takes no part above; its `lyapunov()` is a slope without an "
        "interval, and its MEGNO excludes safe_mode=0 of WHFast. Where motion is chaotic, 2 MEGNO/t tends to "
        "the exponent. Each library has a tangent vector of its own, and chaotic trajectories of different "
        "methods diverge." + _busy([max(system.others, system.stolen) for system in systems.values()]),
        words=(0, 1),
        key="exponents-planets",
    )


def values(run: Results) -> Picture:
    """Return the figure of the exponents with their intervals."""
    return figures.values(_measured(PartResults(_parts(run)[0], run)))


def counts(run: Results) -> dict[str, int]:
    """Return how many values are known, and how many have which verdict."""
    (found, *_) = claims(run).blocks
    assert isinstance(found, Claims)
    return {"claims": sum(found.counts.values()), **found.counts}
