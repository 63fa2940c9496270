"""The page on the original paper's experiments, from stored results alone: claim, paper, here."""

from hbvm_bench.report.document import Section
from hbvm_bench.report.page import Results, block
from hbvm_bench.studies.computations import (
    Part,
    PartResults,
    claims_of,
    computing,
    load,
    sections_of,
)
from hbvm_bench.studies.paper import henon_heiles_part, period_annulus_part, properties_part, sitnikov_part

NAME = "paper"
PARTS = (sitnikov_part.PART, henon_heiles_part.PART, period_annulus_part.PART, properties_part.PART)


COMPUTATIONS = {"compute": computing(NAME, lambda quick: PARTS)}


@block
def claims(run: Results) -> Section:
    """Return every claim with the paper's result and the computed one."""
    return claims_of(_parts(run), "Claim, paper, here", "Claims")


@block
def experiments(run: Results) -> list[Section]:
    """Return the section of each experiment."""
    return sections_of(_parts(run))


def _parts(run: Results) -> list[tuple[Part, PartResults]]:
    stored, records = load(NAME, run.beside), {record.case.method: record for record in run.records}
    return [(part, PartResults(part, stored, records)) for part in PARTS]
