"""The error growth of the cases of a run: which is clear, in a few signs, and counted by family."""

from collections import Counter
from collections.abc import Sequence
from statistics import median

from msgspec.structs import replace

from hbvm_bench.measure import drift
from hbvm_bench.store.records import ErrorGrowth, Record
from hbvm_bench.summaries.points import by_family
from hbvm_bench.summaries.rows import reached
from hbvm_bench.summaries.table import NONE, Table

SHORT = {
    "bounded": "bounded",
    "power": "t^a",
    "exponential": "exp t",
    "drift": "drift",
}
"""Every kind in a few signs, by the keys of `hbvm_bench.measure.drift.KINDS`; powers have exponents."""
FORMER_POWERS = ("square root", "linear")  # in archives; beside them stands the exponent
NOT_CLEAR = "not clear"
FEWEST_STARTS = 16
"""Initial conditions from which a growth is reported: a root mean square over 16 is known to 18 %."""


def clear(growth: ErrorGrowth) -> ErrorGrowth:
    """Return a growth as it is reported: from fewer than `FEWEST_STARTS` initial conditions it is not clear.

    Powers of t that an older archive calls by a name are powers.
    """
    if growth.kind is None or growth.starts >= FEWEST_STARTS:
        return replace(growth, kind="power") if growth.kind in FORMER_POWERS else growth
    from_few = f"{NOT_CLEAR} from {growth.starts} initial condition" + "s" * (growth.starts != 1)
    return replace(growth, kind=None, why=from_few)


def by_method(records: Sequence[Record]) -> dict[str, list[ErrorGrowth]]:
    """Return for each family the energy's error growth of its cases on their trajectory."""
    judged = [record for record in records if "energy" in record.result.growth and reached(record)]
    return {
        family: [clear(record.result.growth["energy"]) for record in each]
        for family, each in by_family(judged).items()
    }


def table(records: Sequence[Record]) -> Table | None:
    """Return how many cases of each method have which growth; ``None`` where none was fitted."""
    growths_of = by_method(records)
    if not growths_of:
        return None
    kinds = [*dict.fromkeys(SHORT.values()), NOT_CLEAR]
    rows = []
    for family, growths in growths_of.items():
        counted = Counter(SHORT[growth.kind] if growth.kind else NOT_CLEAR for growth in growths)
        powers = sorted(g.slope for g in growths if g.slope is not None and g.kind == "power")
        middle = f"{median(powers):.2f} ({powers[0]:.2f} to {powers[-1]:.2f})" if powers else NONE
        rows.append((family, *(str(counted.get(kind, NONE)) for kind in kinds), middle))
    starts = max(growth.starts for growths in growths_of.values() for growth in growths)
    return Table(
        "Growth of the energy error",
        ("method", *kinds, "a"),
        rows,
        "The number of cases of each method with each kind of growth; a: median of the exponents, in "
        "brackets the smallest and the largest. The interval of each exponent is given with its case."
        + drift.uncertainty(starts),
    )


def text(growth: ErrorGrowth) -> str:
    """Return a growth in a few signs: ``"t^0.52 (0.41 to 0.63)"``, ``"drift (-8.5e-14 ± 9e-15)"``."""
    if growth.kind is None:
        return growth.why or NOT_CLEAR
    if growth.kind == "bounded":
        return "0" if growth.floor == 0 else f"bounded at {growth.floor:.1e}"
    if growth.kind == "exponential":
        rate = growth.exponential_rate
        return SHORT[growth.kind] if rate is None else f"exp({rate:.2g} t)"
    if growth.kind == "drift" and growth.mean is not None and growth.mean_error is not None:
        return f"drift ({growth.mean:+.1e} ± {growth.mean_error:.0e})"
    return SHORT[growth.kind] if growth.slope is None else f"t^{power_of(growth)}"


def power_of(growth: ErrorGrowth) -> str:
    """Return the power of t with its interval, where it has one: ``"0.52 (0.41 to 0.63)"``."""
    bare = growth.slope_low is None or growth.slope_high is None
    return f"{growth.slope:.2f}" + ("" if bare else f" ({growth.slope_low:.2f} to {growth.slope_high:.2f})")
