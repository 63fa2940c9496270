"""The page on the original paper's experiments, from kept results alone: claim, paper, here."""

from collections.abc import Callable

from hbvm_bench.report.document import Section
from hbvm_bench.report.page import Results as Run
from hbvm_bench.report.page import block
from hbvm_bench.store.store import Store
from hbvm_bench.studies.computations import (
    Part,
    Results,
    Task,
    claims_of,
    load,
    run_all,
    sections_of,
    telling,
)
from hbvm_bench.studies.paper import henon_heiles_part, period_annulus_part, properties_part, sitnikov_part

NAME = "paper"
PARTS = (sitnikov_part.PART, henon_heiles_part.PART, period_annulus_part.PART, properties_part.PART)


def tasks() -> list[Task]:
    """Return the computations of all parts."""
    return [task for part in PARTS for task in part.tasks]


def compute(store: Store, jobs: int, tell: Callable[[str], None]) -> None:
    """Compute what is missing beside the cases of a run."""
    missing = tasks()
    run_all(NAME, missing, jobs, store, telling(tell, len(missing)))


COMPUTATIONS = {"compute": compute}


@block
def claims(run: Run) -> Section:
    """Return every claim with what the paper gives and what came out."""
    return claims_of(_parts(run), "Claim, paper, here", "Claims")


@block
def experiments(run: Run) -> list[Section]:
    """Return the section of each experiment."""
    return sections_of(_parts(run))


def _parts(run: Run) -> list[tuple[Part, Results]]:
    kept, records = load(NAME, run.beside), {record.case.method: record for record in run.records}
    return [(part, Results(part, kept, records)) for part in PARTS]
