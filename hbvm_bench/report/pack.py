"""What a page carries beside its text: the data, and the plotting library, packed.

The library is the one of the installed plotting package; nothing of it is in this
repository, and the page unpacks it behind the static pictures.
"""

import base64
import gzip
from functools import cache
from typing import Any

import msgspec
from plotly.offline import get_plotlyjs

from hbvm_bench.report.document import Document, Files
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.figures.plots import as_json, numbers

# By matplotlib's name of a marker: plotly's, and its drawing in a box of 12 by 12 as the figures have it.
MARKERS = {
    "o": ("circle", '<circle cx="6" cy="6" r="4.2"/>'),
    "d": ("diamond-tall", '<path d="M6 1 9.2 6 6 11 2.8 6z"/>'),
    "8": ("octagon", '<path d="M4.1 1.4h3.8l2.7 2.7v3.8l-2.7 2.7H4.1L1.4 7.9V4.1z"/>'),
    "D": ("diamond", '<path d="M6 1 11 6 6 11 1 6z"/>'),
    "s": ("square", '<path d="M2 2h8v8H2z"/>'),
    "^": ("triangle-up", '<path d="M6 1.5 10.8 10H1.2z"/>'),
    "v": ("triangle-down", '<path d="M6 10.5 10.8 2H1.2z"/>'),
    "P": ("cross", '<path d="M4.3 1h3.4v3.3H11v3.4H7.7V11H4.3V7.7H1V4.3h3.3z"/>'),
    "X": ("x", '<path d="M3.2 1 6 3.8 8.8 1 11 3.2 8.2 6 11 8.8 8.8 11 6 8.2 3.2 11 1 8.8 3.8 6 1 3.2z"/>'),
    "<": ("triangle-left", '<path d="M1.5 6 10 1.2v9.6z"/>'),
    ">": ("triangle-right", '<path d="M10.5 6 2 1.2v9.6z"/>'),
    "p": ("pentagon", '<path d="M6 1 11 4.8 9 10.6H3L1 4.8z"/>'),
    "h": ("hexagon", '<path d="M6 .8 10.5 3.4v5.2L6 11.2 1.5 8.6V3.4z"/>'),
    "H": ("hexagon2", '<path d="M3.4 1.5h5.2L11.2 6 8.6 10.5H3.4L.8 6z"/>'),
    "*": ("star", '<path d="M6 .8 7.4 4.4 11.2 4.6 8.2 7 9.3 10.8 6 8.6 2.7 10.8 3.8 7 .8 4.6 4.6 4.4z"/>'),
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
    made: dict[str, dict[str, Any]] = {"looks": {}, "plots": {}, "motions": {}, "files": {}}
    for look in document.looks:  # without colours, which are variables of the page
        dash = ",".join(f"{1.3 * length:.3g}px" for length in look.dash) or "solid"
        name = {"name": document.names[look.number]} if look.number in document.names else {}
        made["looks"][str(look.number)] = {"dash": dash, "symbol": MARKERS[look.marker][0], **name}
    for block in document.walk():
        if isinstance(block, Picture) and block.plot is not None:
            table = numbers(block.plot)
            said = {"head": table.head, "rows": table.rows, "words": len(table.words)}
            made["plots"][block.key] = as_json(block.plot) | {"numbers": said}
        if isinstance(block, Picture) and block.motion is not None:
            made["motions"][block.key] = block.motion
        if isinstance(block, Files):
            made["files"] |= {path: data.decode() for path, data in block.files.items() if data is not None}
    return packed(msgspec.json.encode(made))
