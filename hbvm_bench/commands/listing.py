"""Answers about what there is: lists, citations, JSON."""

import dataclasses
import inspect
import re
from collections.abc import Mapping, Sequence
from typing import Any

import integrators.registry
import problems
from hbvm_bench.campaign.file import load, shipped
from hbvm_bench.campaign.identity import version_of
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Index
from hbvm_bench.summaries import export, goals
from hbvm_bench.summaries.table import NONE, Table
from problems.errors import unknown


def tables(only: str = "") -> list[Table]:
    """Return the tables that ``hbvm-bench list`` prints: one of `KINDS`, or all of them.

    Raises
    ------
    problems.errors.UnknownNameError
        For anything else.
    """
    if only and only not in KINDS:
        raise unknown("list", only, KINDS)
    return [KINDS[kind]() for kind in ([only] if only else KINDS)]


def citations(texts: Sequence[str]) -> list[str]:
    """Return the citations of methods, given by names or calls, each BibTeX entry once; of all for none."""
    names = [text.partition("(")[0].strip() for text in texts] or integrators.registry.names()
    texts_ = [integrators.registry.get(name).citation.strip() for name in names]
    return list(dict.fromkeys(entry for text in texts_ if text for entry in re.split(r"\n+(?=@)", text)))


def as_json(index: Index, records: Sequence[Record]) -> dict[str, Any]:
    """Return everything about a run as JSON values; numbers are finite or null with a reason."""
    return {
        "campaign": index.campaign,
        "command": index.command,
        "version": index.version,
        "cases_planned": len(index.ids),
        "goals": goals.as_data(goals.verdicts(index.campaign, records)),
        **export.as_json(records),
    }


def _problems() -> Table:
    rows = [
        (repr(problem), str(problem.system.dim), ", ".join(problem.system.invariants), problem.title or "")
        for problem in map(problems.load, problems.names())
    ]
    head = ("problem", "dimension", "invariants", "description")
    return Table("problems", head, rows, words=(0, 2, 3))


def _methods() -> Table:
    rows = [*map(_method, integrators.registry.names())]
    return Table("methods", ("method", "library", "version", "description"), rows, words=range(4))


def _method(name: str) -> tuple[str, ...]:
    try:
        cls = integrators.registry.get(name)
    except ImportError as error:
        return name, NONE, NONE, f"cannot be imported: {error}"
    said = (inspect.getdoc(cls) or "").partition("\n")[0]
    options = {field.name: field.default for field in dataclasses.fields(cls)}
    return _call(cls.__name__, options), cls.library, version_of(cls.library), said


def _metrics() -> Table:
    rows = [(m.key, m.unit or NONE, m.better or NONE, m.description) for m in METRICS.values()]
    return Table("metrics", ("metric", "unit", "better", "description"), rows, words=range(4))


def _campaigns() -> Table:
    loaded = [(name, load(name)) for name in shipped()]
    rows = [(name, str(len(campaign.cases())), campaign.title) for name, campaign in loaded]
    return Table("campaigns", ("campaign", "cases", "description"), rows, words=(0, 2))


def _call(name: str, arguments: Mapping[str, Any]) -> str:
    words = {key: "..." if value is dataclasses.MISSING else repr(value) for key, value in arguments.items()}
    return f"{name}({', '.join(f'{key}={word}' for key, word in words.items())})"


KINDS = {"problems": _problems, "methods": _methods, "metrics": _metrics, "campaigns": _campaigns}
