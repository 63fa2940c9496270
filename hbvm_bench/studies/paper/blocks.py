"""The page on the original paper's experiments, from stored results alone: claim, paper, here."""

from hbvm_bench.measure.computation import Task
from hbvm_bench.report.document import Claims, Section
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.page import Results
from hbvm_bench.report.parts import claims_of, sections_of, tasks_of

from . import henon_heiles_part, period_annulus_part, properties_part, sitnikov_part

PARTS = (sitnikov_part.PART, henon_heiles_part.PART, period_annulus_part.PART, properties_part.PART)


def tasks(quick: bool) -> list[Task]:
    """Return the computations of a quick run, or of a whole one."""
    del quick
    return tasks_of(PARTS)


def claims(run: Results) -> Section:
    """Return every claim with the paper's result and the computed one."""
    return claims_of(PARTS, run, "Claim, paper, here", "Claims")


def experiments(run: Results) -> list[Section]:
    """Return the section of each experiment."""
    return sections_of(PARTS, run)


def figure(run: Results) -> Picture:
    """Return the figure of the distance of the primaries: who keeps the planetoid with the same step."""
    return sitnikov_part.distances(run)


def counts(run: Results) -> dict[str, int]:
    """Return how many claims there are, and how many have which verdict."""
    (found, *_) = claims(run).blocks
    assert isinstance(found, Claims)
    return {"claims": sum(found.counts.values()), **found.counts}
