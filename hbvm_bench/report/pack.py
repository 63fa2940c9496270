"""What a page carries beside its text, packed: most of its figures, and their numbers."""

import base64
import gzip
from collections.abc import Mapping
from typing import Any

import msgspec

from hbvm_bench.report.document import Document


def packed(data: bytes) -> str:
    """Return bytes as gzip in base 85; the same bytes give the same text.

    The digits are those of `base64.b85encode`, which has no slash and no quotes, with
    a comma for ``<``, so that the text can stand in any place of a page.
    """
    return base64.b85encode(gzip.compress(data, 9, mtime=0)).decode("ascii").replace("<", ",")


def data(document: Document, drawings: Mapping[str, str]) -> str:
    """Return what the figures of a page are made of, packed; ``drawings`` are those not in its text."""
    content: dict[str, dict[str, Any]] = {"drawings": dict(drawings), "numbers": {}}
    for picture in document.pictures:
        if (table := picture.numbers) is not None:
            said = {"head": table.head, "rows": table.rows, "words": len(table.words)}
            content["numbers"][picture.key] = said
    return packed(msgspec.json.encode(content))
