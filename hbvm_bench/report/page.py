"""The one builder of pages: a campaign names the blocks of its page, and a block is a function of results.

A name is that of a block in `hbvm_bench.report.campaign`; ``./blocks.py:table`` is the function ``table`` of
a Python file beside the campaign's.
"""

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from importlib import import_module
from inspect import isfunction
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign import folder
from hbvm_bench.campaign.file import Case, Page, shipped
from hbvm_bench.measure import machine, reading
from hbvm_bench.report.document import Block, Document, attempt
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.figures.style import Look, looks
from hbvm_bench.report.stored import pictures
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Store, progress
from hbvm_bench.store.stored_run import StoredRun
from hbvm_bench.summaries.points import family_of
from problems.errors import InputError, unknown

Series = dict[str, NDArray[np.float64]]
Stores = Sequence[Store]
Made = Block | Sequence[Block] | None

DRAWN_CASES = 300  # of a larger campaign the first so many are drawn: a figure takes seconds
HERE, STUDIES = "hbvm_bench.report.campaign", "hbvm_bench.studies"
DEFAULT = (
    *(
        "goals_reached",
        "best_compilations",
        "overview_of_many",
        "what_came_out",
        "overview_of_one",
        "problems_in_turn",
    ),
    *("fairness", "raw_data", "run_again", "sources"),
)
"""The blocks of a campaign that names none."""


@dataclass(frozen=True, eq=False)
class Results:
    """What a page is made of.

    Attributes
    ----------
    runs : list of StoredRun
        What was asked for, and the records of each.
    records : list of Record
        Of all cases; of one that several runs have, that of the run that got further with it.
    series : dict
        What is drawn of each case, by its id; empty where a report has figures instead.
    figures : sequence of (str, str)
        Of a report; see `Store.figures`.
    computed : dict of (Record, dict)
        The computations of a study with what they returned, by their keys.
    study : Path or None
        The folder of the campaign's file, where its own blocks are.
    """

    runs: list[StoredRun]
    records: list[Record]
    series: dict[str, Series]
    figures: Sequence[tuple[str, str]] = ()
    computed: dict[str, tuple[Record, Series]] = field(default_factory=dict)
    study: Path | None = None

    @property
    def page(self) -> Page:
        """What the campaign says of its page; several campaigns together have the default one."""
        pages = {run.index.campaign.name: run.index.campaign.page for run in self.runs}
        return next(iter(pages.values())) if len(pages) == 1 else Page()

    @cached_property
    def look(self) -> dict[str, Look]:
        """The colour and marker of each method, or of each family where the page has it so."""
        name = family_of if self.page.colours == "family" else lambda record: record.case.method
        return looks([*map(name, self.records), *self.page.looks])

    def missing(self, run: StoredRun) -> list[Case]:
        """Return the cases of a run that have no result yet."""
        there = {record.id for record in self.records}
        return [case for number, case in run.index.listed() if number not in there]

    @cached_property
    def by_processor(self) -> dict[str, list[StoredRun]]:
        """The runs by the kind of processor, by its name."""
        runs_of: dict[str, list[StoredRun]] = {}
        for run in self.runs:
            runs_of.setdefault(machine.kind(run.machine), []).append(run)
        return dict(sorted(runs_of.items()))

    def drawn(self, place: str) -> list[Picture]:
        """Return the figures of a section as a report has them."""
        return pictures(self.figures, place)


BlockMaker = Callable[[Results], Made]


def find(name: str, study: Path | None = None) -> BlockMaker:
    """Return the block called ``name``; those of a campaign's own are in the folder ``study``.

    Raises
    ------
    problems.errors.InputError
        If there is none, with the nearest names.
    """
    if folder.is_beside(name):
        return folder.named(name, study)
    module, _, function = name.rpartition(":")
    place = f"{STUDIES}.{module}" if module else HERE
    known: dict[str, BlockMaker] = {}
    if re.fullmatch(r"[\w.]+", place):
        with suppress(ModuleNotFoundError):
            found = import_module(place)
            known = {key: item for key, item in vars(found).items() if _is_block(item, found)}
    if function not in known:
        prefix = f"{module}:" * bool(module)
        raise unknown("block of a page", name, [f"{prefix}{key}" for key in known])
    return known[function]


def _is_block(item: object, module: ModuleType) -> bool:
    """Whether something in a module is one of its own functions for campaigns to name."""
    return isfunction(item) and item.__module__ == module.__name__ and not item.__name__.startswith("_")


def gather(stores: Stores, study: Path | None = None) -> Results:
    """Read the stores of one or more runs.

    A case that several runs have is taken from the run that is more complete
    (`hbvm_bench.store.store.progress`). ``study`` is the folder with the blocks of the campaign's own; that
    of a shipped one is known.

    Raises
    ------
    problems.errors.InputError
        If a directory holds no run, or no run has a finished case.
    """
    indices = [store.index() for store in stores]
    runs = []
    furthest: dict[str, tuple[Record, Store]] = {}
    for store, index in zip(stores, indices, strict=True):
        runs.append(StoredRun(index=index, records=reading.records(store)))
        for record in runs[-1].records:
            if record.id not in furthest or progress(record) > progress(furthest[record.id][0]):
                furthest[record.id] = (record, store)
    if not furthest:
        raise InputError(
            f"none of the {sum(len(index.ids) for index in indices)} cases of the run in "
            f"{str(stores[0].directory)!r} has finished; {stores[0].again()}."
        )
    series: dict[str, Series] = {}
    records: list[Record] = []
    last = None
    for number, (key, (record, store)) in enumerate(furthest.items()):
        if store is not last:
            store.add_known()  # of two runs each may have a reference of its own
            last = store
        series[key] = reading.drawn(record, store.series(key)) if number < DRAWN_CASES else {}
        records.append(record)
    computed = {
        key: (record, store.series(record.id)) for store in stores for key, record in store.computed().items()
    }
    name = indices[0].campaign.name
    if study is None and name in shipped():
        study = shipped()[name].parent
    return Results(runs, records, series, stores[0].figures(), computed, study)


def document(stores: Store | Stores, study: Path | None = None) -> Document:
    """Return the page on one or more runs; raises what `gather` and `find` do."""
    return page_of(gather([stores] if isinstance(stores, Store) else stores, study))


def page_of(results: Results) -> Document:
    """Return the page on results; raises what `find` does."""
    page, campaigns = results.page, [run.index.campaign for run in results.runs]
    makers = [(name, partial(find(name, results.study), results)) for name in page.blocks or DEFAULT]
    single = len({campaign.name for campaign in campaigns}) == 1
    titles = [campaign.title or campaign.name for campaign in campaigns]
    together = f"{len(titles)} runs together: {'; '.join(titles)}"
    return Document(
        titles[0] if single and (page.by_processor or len(titles) == 1) else together,
        page.lead or ([campaigns[0].description] if len(campaigns) == 1 else []),
        attempt(*makers),
        list(results.look.values()),
        name=page.name,
    )
