"""The laws of the drifts of a run: which are clear, in a few signs, and counted by family."""

from collections import Counter
from collections.abc import Sequence
from statistics import median

from msgspec.structs import replace

from hbvm_bench.measure import drift
from hbvm_bench.store.records import Law, Record
from hbvm_bench.summaries.points import by_family
from hbvm_bench.summaries.rows import reached
from hbvm_bench.summaries.table import NONE, Table

SHORT = {
    "bounded": "bounded",
    "power": "t^a",
    "exponential": "exp t",
    "drift": "drift",
}
"""Every law in a few signs, by the keys of `hbvm_bench.measure.drift.LAWS`; powers have exponents."""
FORMER_POWERS = ("square root", "linear")  # in archives; beside them stands the exponent
NOT_CLEAR = "not clear"
FEWEST_STARTS = 16
"""Initial conditions from which a law is told: a root mean square over 16 is known to 18 %."""


def clear(law: Law) -> Law:
    """Return a law as it may be told: one from fewer than `FEWEST_STARTS` initial conditions is not clear.

    Powers of t that an older archive calls by a name are powers.
    """
    if law.law is None or law.starts >= FEWEST_STARTS:
        return replace(law, law="power") if law.law in FORMER_POWERS else law
    from_few = f"{NOT_CLEAR} from {law.starts} initial condition" + "s" * (law.starts != 1)
    return replace(law, law=None, why=from_few)


def by_method(records: Sequence[Record]) -> dict[str, list[Law]]:
    """Return for each family the laws of the energy of its cases on their trajectory."""
    judged = [record for record in records if "energy" in record.result.laws and reached(record)]
    return {
        family: [clear(record.result.laws["energy"]) for record in each]
        for family, each in by_family(judged).items()
    }


def table(records: Sequence[Record]) -> Table | None:
    """Return how many cases of each method follow which law; ``None`` where no law was sought."""
    laws_of = by_method(records)
    if not laws_of:
        return None
    kinds = [*dict.fromkeys(SHORT.values()), NOT_CLEAR]
    rows = []
    for family, laws in laws_of.items():
        counted = Counter(SHORT[law.law] if law.law else NOT_CLEAR for law in laws)
        powers = sorted(law.slope for law in laws if law.slope is not None and law.law == "power")
        middle = f"{median(powers):.2f} ({powers[0]:.2f} to {powers[-1]:.2f})" if powers else NONE
        rows.append((family, *(str(counted.get(kind, NONE)) for kind in kinds), middle))
    starts = max(law.starts for laws in laws_of.values() for law in laws)
    return Table(
        "Growth of the energy error",
        ("method", *kinds, "a"),
        rows,
        "The number of cases of each method with each kind of growth; a: median of the exponents, in "
        "brackets the smallest and the largest. The interval of each exponent is given with its case."
        + drift.uncertainty(starts),
    )


def text(law: Law) -> str:
    """Return a law in a few signs: ``"t^0.52 (0.41 to 0.63)"``, ``"drift (-8.5e-14 ± 9e-15)"``."""
    if law.law is None:
        return law.why or NOT_CLEAR
    if law.law == "bounded":
        return "0" if law.floor == 0 else f"bounded at {law.floor:.1e}"
    if law.law == "exponential":
        return SHORT[law.law] if law.growth is None else f"exp({law.growth:.2g} t)"
    if law.law == "drift" and law.mean is not None and law.mean_error is not None:
        return f"drift ({law.mean:+.1e} ± {law.mean_error:.0e})"
    return SHORT[law.law] if law.slope is None else f"t^{power_of(law)}"


def power_of(law: Law) -> str:
    """Return the power of t with its interval, where it has one: ``"0.52 (0.41 to 0.63)"``."""
    bare = law.slope_low is None or law.slope_high is None
    return f"{law.slope:.2f}" + ("" if bare else f" ({law.slope_low:.2f} to {law.slope_high:.2f})")
