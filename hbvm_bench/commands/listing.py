"""Answers about what there is and what came out: lists, citations, JSON."""

import dataclasses
import inspect
import re
from collections.abc import Sequence
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

import integrators.registry
import problems
from hbvm_bench.campaign.file import load, shipped
from hbvm_bench.campaign.identity import version_of_library
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Index
from hbvm_bench.summaries import export, goals
from integrators.protocol import MethodBase
from problems.errors import unknown

KINDS = ("problems", "methods", "metrics", "campaigns")


def tables(what: str = "") -> list[Table]:
    """Return the tables that ``hbvm-bench list`` prints.

    Parameters
    ----------
    what : str
        One of `KINDS`; all when empty.

    Raises
    ------
    problems.errors.UnknownNameError
        For anything else.
    """
    if what and what not in KINDS:
        raise unknown("list", what, KINDS)
    made = {"problems": _problems, "methods": _methods, "metrics": _metrics, "campaigns": _campaigns}
    return [made[kind]() for kind in ([what] if what else KINDS)]


def citations(texts: Sequence[str]) -> list[str]:
    """Return the citations of methods, each BibTeX entry once.

    Parameters
    ----------
    texts : sequence of str
        Names or calls; all methods when empty.
    """
    names = [text.partition("(")[0].strip() for text in texts] or integrators.registry.names()
    found = [integrators.registry.get(name).citation.strip() for name in names]
    return list(dict.fromkeys(entry for text in found if text for entry in re.split(r"\n+(?=@)", text)))


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


def _table(title: str, *heads: str) -> Table:
    made = Table(*heads, title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    made.columns[0].no_wrap = True
    return made


def _problems() -> Table:
    made = _table("problems", "problem", "dimension", "invariants", "what")
    for name in problems.names():
        problem = problems.load(name)
        system = problem.system
        made.add_row(
            Text(_signature(name, problem.arguments)),
            Text(str(system.dim)),
            Text(", ".join(system.invariant_names)),
            Text(problem.title or ""),
        )
    return made


def _methods() -> Table:
    made = _table("methods", "method", "library", "version", "what")
    for name in integrators.registry.names():
        try:
            cls = integrators.registry.get(name)
        except ImportError as error:
            made.add_row(Text(name), "–", "–", Text(f"cannot be imported: {error}"))
            continue
        made.add_row(
            Text(_options(cls)),
            Text(cls.library),
            Text(version_of_library(cls.library)),
            Text((inspect.getdoc(cls) or "").partition("\n")[0]),
        )
    return made


def _metrics() -> Table:
    made = _table("metrics", "metric", "unit", "better", "what")
    for metric in METRICS.values():
        made.add_row(metric.key, metric.unit or "–", metric.better or "–", Text(metric.description))
    return made


def _campaigns() -> Table:
    made = _table("campaigns", "campaign", "cases", "what")
    for name in shipped():
        campaign = load(name)
        made.add_row(name, str(len(campaign.cases())), Text(campaign.title))
    return made


def _options(cls: type[MethodBase]) -> str:
    words = []
    for field in dataclasses.fields(cls):
        default = "..." if field.default is dataclasses.MISSING else repr(field.default)
        words.append(f"{field.name}={default}")
    return f"{cls.__name__}({', '.join(words)})"


def _signature(name: str, arguments: Any) -> str:
    return f"{name}({', '.join(f'{key}={value!r}' for key, value in arguments.items())})"
