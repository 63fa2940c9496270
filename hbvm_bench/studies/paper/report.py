"""The page on the original paper's experiments, from kept results alone: claim, paper, here."""

from collections.abc import Callable
from functools import partial

from hbvm_bench.report.document import Block, Claims, Section, attempt
from hbvm_bench.report.page import Results as Run
from hbvm_bench.report.page import block
from hbvm_bench.store.store import Store
from hbvm_bench.studies.paper import henon_heiles_part, period_annulus_part, properties_part, sitnikov_part
from hbvm_bench.studies.paper.results import Part, Results, Task, load, run_all

PARTS = (sitnikov_part.PART, henon_heiles_part.PART, period_annulus_part.PART, properties_part.PART)


def tasks() -> list[Task]:
    """Return the computations of all parts."""
    return [task for part in PARTS for task in part.tasks]


def compute(store: Store, jobs: int, tell: Callable[[str], None]) -> None:
    """Compute what is missing beside the cases of a run."""
    missing, ended = tasks(), 0

    def done(key: str, said: str) -> None:
        nonlocal ended
        ended += 1
        tell(f"  computation {ended} of at most {len(missing)}, {key}: {said}")

    run_all(missing, jobs, store, done)


COMPUTATIONS = {"compute": compute}


@block
def claims(run: Run) -> Section:
    """Return every claim with what the paper gives and what came out."""

    def of(part: Part, results: Results) -> Claims:
        return Claims([(part.title, part.key, part.claims(results))])

    made = attempt(
        *((f"the claims of {part.title}", partial(of, part, found)) for part, found in _parts(run))
    )
    groups = [group for one in made if isinstance(one, Claims) for group in one.groups]
    failed: list[Block] = [one for one in made if not isinstance(one, Claims)]
    return Section("Claim, paper, here", [Claims(groups), *failed], "all-claims", nav="Claims")


@block
def experiments(run: Run) -> list[Section]:
    """Return the section of each experiment."""
    return [
        Section(part.title, attempt(*part.blocks(found)), part.key, nav=part.title)
        for part, found in _parts(run)
    ]


def _parts(run: Run) -> list[tuple[Part, Results]]:
    kept, records = load(run.beside), {record.case.method: record for record in run.records}
    return [(part, Results(part, kept, records)) for part in PARTS]
