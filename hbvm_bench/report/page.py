"""Pages: a template says which blocks stand where, and a block is a function of results.

The template is ``page.md`` of a study's folder, or the one that ships; see `hbvm_bench.report.template`. The
name of a block is that of a function in `hbvm_bench.report.blocks`; ``./blocks.py:table`` is the function
``table`` of a Python file beside the campaign's.
"""

import functools
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from importlib import import_module
from inspect import isfunction
from pathlib import Path
from typing import Any

from hbvm_bench.campaign import folder
from hbvm_bench.campaign.file import STUDY, Case, shipped
from hbvm_bench.campaign.own import NOTHING, Known
from hbvm_bench.measure import reading
from hbvm_bench.measure.measured import Series
from hbvm_bench.report import template
from hbvm_bench.report.curves import PREFIX, curves
from hbvm_bench.report.document import Block, Document
from hbvm_bench.report.figures.style import Look, looks
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import PACKED, Store, StoredRun, progress
from hbvm_bench.summaries import cost_ratio, growth
from hbvm_bench.summaries import frame as frames
from hbvm_bench.summaries.frame import Frame
from hbvm_bench.summaries.points import family_of
from problems.errors import InputError, unknown

Stores = Sequence[Store]
Made = Block | Sequence[Block] | None
BlockMaker = Callable[..., Made]

DRAWN_CASES = 300  # of a larger campaign the first so many are drawn: a figure takes seconds
HERE = "hbvm_bench.report.blocks"
PROPERTY = "Motion"  # what has a colour in figures and is no method: a property of the motion


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
        What is drawn of each case, by its id: its curves, and the series that the campaign's page names.
    computed : dict of (Record, dict)
        The computations of a study with what they returned, by their keys.
    study : Path or None
        The folder of the campaign's file, where its own blocks are.
    place : str
        The folder of the results as seen from the page; empty where they lie beside it.
    known : Known
        What is known of the problems beside their texts.
    """

    runs: list[StoredRun]
    records: list[Record]
    series: dict[str, Series]
    computed: dict[str, tuple[Record, Series]] = field(default_factory=dict)
    study: Path | None = None
    place: str = ""
    known: Known = NOTHING

    @cached_property
    def frame(self) -> Frame:
        """The results table: see `hbvm_bench.summaries.frame.cases`."""
        return frames.cases(self.runs)

    @cached_property
    def look(self) -> dict[str, Look]:
        """The colour and marker of each family."""
        return looks([*map(family_of, self.records), PROPERTY])

    def missing(self, run: StoredRun) -> list[Case]:
        """Return the cases of a run that have no result yet."""
        there = {record.id for record in self.records}
        return [case for number, case in run.index.listed() if number not in there]


def find(name: str, study: Path | None = None) -> BlockMaker:
    """Return the block called ``name``; those of a campaign's own are in the folder ``study``.

    Raises
    ------
    problems.errors.InputError
        If there is none, with the nearest names.
    """
    if name.startswith("./"):
        return folder.named(name, study)
    known = {
        key: item
        for key, item in vars(import_module(HERE)).items()
        if isfunction(item) and item.__module__ == HERE and not key.startswith("_")
    }
    if name not in known:
        raise unknown("block of a page", name, known)
    return known[name]


def page_file(study: Path | None) -> Path:
    """Return the template of the page of a study: its own, or the one that ships."""
    own = None if study is None else study / template.NAME
    return own if own is not None and own.is_file() else template.SHIPPED


def beside(place: Path) -> Path | None:
    """Return a report's folder where it has a page or a study of its own; ``None`` for any other."""
    return place if any((place / name).is_file() for name in (template.NAME, STUDY)) else None


def check(study: Path | None) -> None:
    """Refuse a page that names a block which is not there, before anything is measured."""
    for name, results in template.named_blocks(page_file(study)):
        if results is None:
            find(name, study)


def gather(stores: Stores, study: Path | None = None, place: str = "") -> Results:
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
    named_of: dict[str, list[str]] = {}
    for store, index in zip(stores, indices, strict=True):
        runs.append(StoredRun(index=index, records=reading.records(store)))
        for record in runs[-1].records:
            named_of[record.id] = index.campaign.page.series
            if record.id not in furthest or progress(record) > progress(furthest[record.id][0]):
                furthest[record.id] = (record, store)
    if not furthest:
        raise InputError(
            f"none of the {sum(len(index.ids) for index in indices)} cases of the run in "
            f"{str(stores[0].directory)!r} has finished; {stores[0].again()}."
        )
    series: dict[str, Series] = {}
    records: list[Record] = []
    known_of = {id(store): store.known() for store in stores}  # each may have a reference of its own
    for number, (key, (record, store)) in enumerate(furthest.items()):
        known = known_of[id(store)]
        series[key] = _drawn(record, store, named_of[key], known) if number < DRAWN_CASES else {}
        records.append(record)
    computed = {
        key: (record, store.series(record.id)) for store in stores for key, record in store.computed().items()
    }
    name = indices[0].campaign.name
    if study is None and name in shipped():
        study = shipped()[name].parent
    known = functools.reduce(operator.or_, known_of.values())
    return Results(runs, records, series, computed, study, place, known)


def _drawn(record: Record, store: Store, named: Sequence[str], known: Known) -> Series:
    """Return the curves of a case, and its series of these names."""
    arrays = store.series(record.id)
    whole = (
        reading.drawn(record, arrays, known)
        if named and not any(name.startswith(PREFIX) for name in arrays)
        else arrays
    )
    return {name: whole[name] for name in named if name in whole} | curves(record, arrays, known)


def document(stores: Store | Stores, study: Path | None = None) -> Document:
    """Return the page on one or more runs; raises what `gather` and `find` do."""
    return page_of(gather([stores] if isinstance(stores, Store) else stores, study))


def page_of(results: Results, parts: dict[str, Results] | None = None) -> Document:
    """Return the page on results, and on others that it has by their names; raises what `find` does."""
    campaigns = [run.index.campaign for run in results.runs]
    single = len(campaigns) == 1 or (
        campaigns[0].page.by_processor and len({campaign.name for campaign in campaigns}) == 1
    )
    titles = [campaign.title or campaign.name for campaign in campaigns]
    values = {
        "title": titles[0] if single else f"{len(titles)} runs together: {'; '.join(titles)}",
        "description": campaigns[0].description if single else "",
    }
    return _made(page_file(results.study if single else None), {"": results, **(parts or {})}, values)


def parts_in(place: Path) -> dict[str, Results]:
    """Return the results in the folders of a report's folder, by their names."""
    found = {path.parent.name: path for path in sorted(place.glob(f"*/{PACKED}"))}
    return {name: gather(Store(path).runs(), place=f"{name}/") for name, path in found.items()}


def page_in(place: Path) -> Document:
    """Return the page of a report's folder, of the results in it and in the folders in it, by their names.

    Raises
    ------
    problems.errors.InputError
        If there are none, and what `gather` and `find` raise.
    """
    parts = parts_in(place)
    if (place / PACKED).is_file():
        return page_of(gather(Store(place / PACKED).runs(), beside(place)), parts)
    if not parts or not (place / template.NAME).is_file():
        raise InputError(f"the folder {str(place)!r} has no results, or no {template.NAME}.")
    return _made(place / template.NAME, parts, {})


def _made(path: Path, parts: dict[str, Results], values: dict[str, Any]) -> Document:
    def results(name: str | None = None) -> Results:
        if name is None:
            name = next(iter(parts)) if len(parts) == 1 else ""
        if name not in parts:
            raise unknown("results of the page", str(name), parts)
        return parts[name]

    def make(name: str, of: str | None = None, **options: Any) -> Callable[[], Made]:
        return partial(find(name, results(of).study), results(of), **options)

    def frame(of: str | None = None) -> Frame:
        return results(of).frame

    def ratios(of: str | None = None, **options: Any) -> Frame:
        return cost_ratio.ratios(frame(of), **options)

    def latest(found: Frame) -> Frame:
        return found[found.processor == found.processor.iloc[-1]]

    def rms(of: str, method: str) -> float:
        (number,) = frame(of)[frame(of).method == method].id
        return growth.energy_rms(results(of).series[number])

    def value(name: str, of: str | None = None) -> Any:
        return find(name, results(of).study)(results(of))

    values = {**values, "frame": frame, "ratios": ratios, "latest": latest, "rms": rms, "value": value}
    values["strongest"] = cost_ratio.strongest
    title, lead, blocks = template.rendered(path, make, values)
    families = dict.fromkeys(family for part in parts.values() for family in part.look)
    return Document(title, lead, blocks, list(looks(families).values()))
