"""What a page carries beside its text: the data, and the plotting library, packed.

The library is the one of the installed plotting package; nothing of it is in this
repository, and the page unpacks it behind the static pictures.
"""

import base64
import csv
import gzip
import io
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import msgspec
from plotly.offline import get_plotlyjs

from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.report.content import Content
from hbvm_bench.report.figures import motion
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.figures.plots import as_json, numbers
from hbvm_bench.report.figures.style import Look
from hbvm_bench.store.files import json_of
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.rows import group_of, status_of

# Marker names: of matplotlib, of plotly.
SYMBOLS = {
    "o": "circle",
    "D": "diamond",
    "d": "diamond-tall",
    "8": "octagon",
    "s": "square",
    "^": "triangle-up",
    "v": "triangle-down",
    "P": "cross",
    "X": "x",
    "<": "triangle-left",
    ">": "triangle-right",
    "p": "pentagon",
    "h": "hexagon",
    "H": "hexagon2",
    "*": "star",
}


def packed(data: bytes) -> str:
    """Return bytes as gzip in base 85; the same bytes give the same text.

    The digits are those of `base64.b85encode`, which has no slash and no quotes, with
    a comma for ``<``, so that the text can stand in any place of a page.
    """
    return base64.b85encode(gzip.compress(data, 9, mtime=0)).decode("ascii").replace("<", ",")


@cache
def library() -> str:
    """Return the packed plotting library of the installed package."""
    return packed(get_plotlyjs().encode())


def figures_data(
    pictures: Sequence[Picture], looks: Iterable[Look], names: Mapping[int, str], more: Mapping[str, Any]
) -> str:
    """Return what the figures, tables and downloads of a page are made of, packed."""
    plots: dict[str, Any] = {}
    for picture in pictures:
        if picture.plot is not None:
            table = numbers(picture.plot)
            plots[picture.key] = as_json(picture.plot) | {
                "numbers": {"head": table.head, "rows": table.rows, "words": table.words}
            }
    return packed(msgspec.json.encode({"looks": looks_json(looks, names), "plots": plots, **more}))


def raw(content: Content) -> dict[str, Any]:
    """Return what the page of a campaign carries beside its figures' numbers."""
    return {
        "motions": {s.motion.key: motion.as_json(s.motion) for s in content.sections if s.motion is not None},
        "csv": results_csv(content.records),
        "json": results_json(content),
    }


def looks_json(looks: Iterable[Look], names: Mapping[int, str]) -> dict[str, dict[str, Any]]:
    """Return the looks by number, for the page's script; colours are variables of the page."""
    return {
        str(look.number): {
            "dash": ",".join(f"{1.3 * length:.3g}px" for length in look.dash) or "solid",
            "symbol": SYMBOLS[look.marker],
            **({"name": names[look.number]} if look.number in names else {}),
        }
        for look in looks
    }


def results_csv(records: Sequence[Record]) -> str:
    """Return one line per case: what it is, how it ended, every metric, and the quartiles of the time."""
    keys = [key for key in METRICS if any(key in record.result.metrics for record in records)]
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    first = ["problem", "method", "library", "settings", "group", "status", "reason", "t_stop"]
    writer.writerow([*first, *keys, *(f"{key}_void" for key in keys), "time_q1", "time_q3", "time_samples"])
    for record in records:
        result, values = record.result, record.result.metrics
        summary = record.timing.summary if record.timing is not None else {}
        writer.writerow(
            [
                *(record.case.problem, record.case.method, record.library, record.case.settings),
                *(group_of(record), status_of(record), result.reason or result.violation),
                "" if result.t_stop is None else repr(result.t_stop),
                *(
                    "" if key not in values or values[key].value is None else repr(values[key].value)
                    for key in keys
                ),
                *("void" if key in values and values[key].void else "" for key in keys),
                *("" if q not in summary else repr(summary[q]) for q in ("q1", "q3")),
                " ".join(map(repr, record.timing.samples)) if record.timing is not None else "",
            ]
        )
    return stream.getvalue()


def results_json(content: Content) -> dict[str, Any]:
    """Return all records as JSON values, with what they were made by."""
    return {
        "title": content.title,
        "runs": [{"command": run.command, "version": run.version} for run in content.runs],
        "metrics": {
            metric.key: {"label": metric.label, "unit": metric.unit, "description": metric.description}
            for metric in content.metrics
        },
        "cases": [msgspec.to_builtins(record) for record in content.records],
    }


def files(content: Content) -> dict[str, bytes]:
    """Return the data of a report as files by their path beside the page."""
    return {
        "data/results.csv": results_csv(content.records).encode(),
        "data/results.json": json_of(results_json(content)),
    }
