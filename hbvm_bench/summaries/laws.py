"""The laws of the drifts of a run: in a few signs, and counted by family."""

from collections import Counter
from collections.abc import Sequence

from hbvm_bench.store.records import Law, Record
from hbvm_bench.summaries.points import by_family
from hbvm_bench.summaries.rows import reached
from hbvm_bench.summaries.table import Table

SHORT = {
    "bounded": "bounded",
    "square root": "t^1/2",
    "linear": "t",
    "power": "t^a",
    "exponential": "exp t",
    "drift": "drift",
}
"""Every law in a few signs, by the keys of `hbvm_bench.measure.drift.LAWS`."""


def counts(records: Sequence[Record]) -> dict[str, Counter[str]]:
    """Return for each family how many cases have which law of the energy; ``"none"`` where none is clear."""
    found = [one for one in records if "energy" in one.result.laws and reached(one)]
    return {
        family: Counter(one.result.laws["energy"].law or "none" for one in members)
        for family, members in by_family(found).items()
    }


def table(records: Sequence[Record]) -> Table | None:
    """Return how many cases of each method follow which law; ``None`` where no law was sought."""
    counted = counts(records)
    if not counted:
        return None
    kinds = [*SHORT, "none"]
    return Table(
        "The law of the energy's drift",
        ("method", *(SHORT.get(kind, "not clear") for kind in kinds)),
        [(family, *(str(by.get(kind, "–")) for kind in kinds)) for family, by in counted.items()],
        "How many cases of each method follow which law.",
    )


def text(law: Law) -> str:
    """Return a law in a few signs: ``"t^1/2 (0.52, 0.41 to 0.63)"``, ``"drift (-8.5e-14 ± 9e-15)"``."""
    if law.law is None:
        return law.why or "not clear"
    if law.law == "bounded":
        return "0" if law.floor == 0 else f"bounded at {law.floor:.1e}"
    if law.law == "exponential":
        return SHORT[law.law] if law.growth is None else f"exp({law.growth:.2g} t)"
    if law.law == "drift" and law.mean is not None and law.mean_error is not None:
        return f"drift ({law.mean:+.1e} ± {law.mean_error:.0e})"
    if law.slope is None:
        return SHORT[law.law]
    if law.slope_low is None or law.slope_high is None:
        return f"{SHORT[law.law]} ({law.slope:.2f})"
    return f"{SHORT[law.law]} ({law.slope:.2f}, {law.slope_low:.2f} to {law.slope_high:.2f})"


def power_of(law: Law) -> str:
    """Return the power of t with its interval, where it has one: ``"0.52 (0.41 to 0.63)"``."""
    bare = law.slope_low is None or law.slope_high is None
    return f"{law.slope:.2f}" + ("" if bare else f" ({law.slope_low:.2f} to {law.slope_high:.2f})")
