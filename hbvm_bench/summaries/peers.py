"""What the bench costs a peer beside its library alone: the result of ``hbvm-bench doctor --peers``.

`hbvm_bench.studies.peers.check` measures it; the result that comes with the package (`KEPT`) is
printed in every report.
"""

from collections.abc import Iterable
from pathlib import Path
from statistics import median

import msgspec

from hbvm_bench.campaign.identity import digest_of, make_method
from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import Spread
from hbvm_bench.summaries.rows import seconds as in_words
from hbvm_bench.summaries.table import Table

ALLOWED = 1.05
"""Largest median of the ratio harness over library."""

OVERHEAD = 2e-5
"""Seconds a call may take longer whatever its ratio, which is then that of a very short run."""

DIFFERENCE = 1e-6
"""Most difference of the end states. Measured: 1e-8 for REBOUND, which adds a fixed step to its clock 300,000
times where our adapter sets it to t0 + n h; 2e-7 for diffrax's LeapfrogMidpoint, whose rounding grows
over 1,500,000 steps; 0 where steps vary."""

KEPT = Path(__file__).with_name("peers.json")
COMMAND = "hbvm-bench doctor --peers"


class Row(msgspec.Struct, frozen=True, kw_only=True):
    """One method through the harness and alone."""

    problem: str
    method: str
    call: str  # what the library alone is called by
    seconds: list[float]  # of the processor's time through the harness, one of each round
    alone: list[float]  # and of the library alone
    steps: int
    alone_steps: int
    difference: float  # largest difference of the states at the end, over the largest component

    @property
    def ratio(self) -> Spread:
        """Harness over library within each round."""
        return Spread.of([a / b for a, b in zip(self.seconds, self.alone, strict=True)])

    @property
    def beyond(self) -> bool:
        """Whether the harness costs more than is allowed, takes other steps or comes elsewhere."""
        other = self.steps != self.alone_steps or not self.difference <= DIFFERENCE
        overhead = median(a - b for a, b in zip(self.seconds, self.alone, strict=True))
        return other or (self.ratio.median > ALLOWED and overhead > OVERHEAD)


class PeerCheck(msgspec.Struct, frozen=True, kw_only=True):
    """The result."""

    rows: list[Row]  # in the order of `PAIRS`
    refused: dict[str, str]  # why a pair did not run, by its method and problem
    machine: dict[str, str | int]
    versions: dict[str, str]
    measured: str  # the time
    sources: str = ""  # the `digest` of the code that was measured


def digest(methods: Iterable[str]) -> str:
    """Return the sha256 of the sources that a result depends on: the check's, and the methods' adapters'."""
    adapters = {type(make_method(text)).__module__ for text in methods}
    lazily = {"integrators.peers.diffrax.steps", "integrators.peers.diffrax.solve"}
    check = ("hbvm_bench.studies.peers.check", "problems.catalogue.kepler")
    return digest_of((*check, *sorted(adapters | lazily)))


def table(result: PeerCheck) -> Table:
    """Return the result as a table; rows beyond what is allowed are marked."""
    rows: list[tuple[str, ...]] = []
    for row in result.rows:
        ratio = row.ratio
        said = f"{ratio.median:.3f} [{ratio.low:.3f}, {ratio.high:.3f}]{' (beyond)' * row.beyond}"
        steps = (str(row.steps), str(row.alone_steps))
        spent, difference = in_words(median(row.alone)), f"{row.difference:.0e}"
        rows.append((row.method, row.problem, row.call, said, spent, *steps, difference))
    now = digest(row.method for row in result.rows)
    rounds = len(result.rows[0].seconds) if result.rows else 0
    versions = ", ".join(f"{name} {number}" for name, number in result.versions.items())
    return Table(
        "Every peer through this bench, over the same library alone",
        (
            *("method", "problem", "called by", "bench / alone", "time alone"),
            *("steps, bench", "steps, alone", "end states differ by"),
        ),
        rows,
        f"Median and quartiles of the ratio of the processor's times in each of {rounds} rounds, the two in "
        f"turn in one process, compiled and set up before; {ALLOWED:g} is allowed, or {OVERHEAD * 1e6:g} "
        "microseconds a call. The end states of REBOUND's fixed steps differ because it adds up its clock, "
        f"which our adapter sets to whole steps. Measured on {result.measured[:10]}"
        f"{'' if result.sources == now else ', with an earlier version of this code'}, with {versions}. "
        f"{machine.sentence(result.machine)} To repeat it: {COMMAND}.",
        words=(0, 1, 2),
    )


def kept() -> Table | None:
    """Return the table of the result that comes with the package."""
    result = load()
    return None if result is None else table(result)


def load(path: Path = KEPT) -> PeerCheck | None:
    """Return a result, by default the one that comes with the package; ``None`` where there is none."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=PeerCheck)
    except OSError:
        return None
