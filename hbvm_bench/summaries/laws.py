"""The laws of the drifts of a run, in rows, and counted by family."""

from collections.abc import Sequence
from dataclasses import dataclass

from hbvm_bench.store.records import Law, Record
from hbvm_bench.summaries.points import family_of
from hbvm_bench.summaries.rows import group_of

SHORT = {
    "bounded": "bounded",
    "square root": "t^1/2",
    "linear": "t",
    "power": "t^a",
    "exponential": "exp t",
    "drift": "drift",
}
"""Every law in a few signs, by the keys of `hbvm_bench.measure.drift.LAWS`."""


@dataclass(frozen=True)
class LawRow:
    """The law of one invariant's error in one case.

    Attributes
    ----------
    record : Record
        The case.
    family, invariant : str
        Names.
    law : Law
        As found.
    text : str
        In a few signs, with the power of t and its interval where it grows.
    """

    record: Record
    family: str
    invariant: str
    law: Law
    text: str


def rows(records: Sequence[Record], invariant: str | None = None) -> list[LawRow]:
    """Return the laws of all cases that stayed on their trajectory, in the order of the run.

    Parameters
    ----------
    records : sequence of Record
        Of a run.
    invariant : str, optional
        Only this one's; all by default.
    """
    return [
        LawRow(record, family_of(record), name, law, text(law))
        for record in records
        if group_of(record) == "on"
        for name, law in record.result.laws.items()
        if invariant in (None, name)
    ]


def counts(records: Sequence[Record], invariant: str = "energy") -> dict[str, dict[str, int]]:
    """Return for each family how many of its cases follow each law; ``"none"`` where none is clear."""
    counted: dict[str, dict[str, int]] = {}
    for row in rows(records, invariant):
        laws = counted.setdefault(row.family, {})
        key = row.law.law or "none"
        laws[key] = laws.get(key, 0) + 1
    return counted


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
