"""The report on the seed paper's experiments, from kept results alone: claim, paper, here."""

from collections.abc import Sequence
from functools import partial

from hbvm_bench.report.document import Claims, Commands, Document, Files, Section, attempt
from hbvm_bench.studies.paper import henon_heiles_part, period_annulus_part, properties_part, sitnikov_part
from hbvm_bench.studies.paper.drawn import LOOKS
from hbvm_bench.studies.paper.results import NAME, Kept, Part, Results, Task

PARTS = (sitnikov_part.PART, henon_heiles_part.PART, period_annulus_part.PART, properties_part.PART)


def tasks(keys: Sequence[str]) -> list[Task]:
    """Return the computations of the named parts."""
    return [task for part in PARTS if part.key in keys for task in part.tasks]


def document(kept: Kept, keys: Sequence[str]) -> Document:
    """Return the report on the named parts."""
    parts = [(part, Results(part, kept)) for part in PARTS if part.key in keys]

    def claims(part: Part, results: Results) -> Claims:
        return Claims([(part.title, part.key, part.claims(results))])

    made = attempt(*((f"the claims of {part.title}", partial(claims, part, found)) for part, found in parts))
    groups = [group for block in made if isinstance(block, Claims) for group in block.groups]
    return Document(
        "The seed paper, run again",
        [
            "Every experiment, figure and table of the paper from one command, beside what the paper says. "
            "Where the two differ, the difference is explained; where the paper is silent, it is measured.",
            "L. Brugnano, F. Iavernaro, T. Susca: Numerical comparisons between Gauss–Legendre methods and "
            "Hamiltonian BVMs defined over Gauss points",
        ],
        [
            Section(
                "Claim, paper, here",
                [Claims(groups), *(block for block in made if not isinstance(block, Claims))],
                "all-claims",
                nav="Claims",
            ),
            *(
                Section(part.title, attempt(*part.blocks(found)), part.key, nav=part.title)
                for part, found in parts
            ),
            Section(
                "Raw data",
                [
                    Files("What every computation returned (MessagePack)", [NAME]),
                ],
                "data-files",
                nav="Data",
            ),
            Section(
                "Run it again",
                [
                    Commands(kept.command),
                    "Everything is computed anew, by the same integrators that the bench compares, and takes "
                    "one to two minutes on two cores; `hbvm-bench paper --redraw --out DIRECTORY` draws this "
                    "report again without running anything. The same machine and versions give the same "
                    "bytes; elsewhere the last digits of what depends on the last bit will differ.",
                ],
                "again",
                nav="Run it again",
            ),
        ],
        LOOKS,
        name="report.md",
    )
