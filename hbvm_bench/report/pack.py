"""What a page carries beside its text: the data, and the plotting library, packed.

The library is the one of the installed plotting package; nothing of it is in this
repository, and the page unpacks it behind the static pictures.
"""

import base64
import gzip
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

import msgspec
from plotly.offline import get_plotlyjs

from hbvm_bench.report.document import Document, Files
from hbvm_bench.report.figures.plots import as_json, numbers
from hbvm_bench.report.figures.style import Look

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


def data(document: Document) -> str:
    """Return what the figures, tables and downloads of a page are made of, packed."""
    plots: dict[str, Any] = {}
    motions: dict[str, Any] = {}
    for picture in document.pictures:
        if picture.plot is not None:
            table = numbers(picture.plot)
            plots[picture.key] = as_json(picture.plot) | {
                "numbers": {"head": table.head, "rows": table.rows, "words": len(table.words)}
            }
        if picture.motion is not None:
            motions[picture.key] = picture.motion
    carried = {
        path: content.decode()
        for block in document.walk()
        if isinstance(block, Files)
        for path, content in block.files.items()
        if content is not None
    }
    made = {"looks": looks_json(document.looks, document.names), "plots": plots, "motions": motions}
    return packed(msgspec.json.encode(made | {"files": carried}))


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
