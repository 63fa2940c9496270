"""Write a document: everything is made first, then every file is put in place whole."""

from collections.abc import Mapping
from pathlib import Path

from hbvm_bench.report.document import Document
from hbvm_bench.report.html import pages
from hbvm_bench.report.markdown import markdown
from hbvm_bench.store.files import write_all

TEXT = "report.md"


def rendered(document: Document) -> dict[str, bytes]:
    """Return all files of a document by their path in its directory."""
    files = {TEXT: markdown(document).encode()}
    files |= {name: text.encode() for name, text in pages(document).items()}
    return {picture.file: picture.svg.encode() for picture in document.pictures} | files


def write(document: Document, directory: Path, beside: Mapping[str, bytes] | None = None) -> list[Path]:
    """Write the markdown with its ``figures/``, and the page; return the paths of the first two.

    Parameters
    ----------
    document : Document
        What is written.
    directory : Path
        Where to.
    beside : mapping of str to bytes, optional
        Other files that belong to it, by name.
    """
    files = {**(beside or {}), **rendered(document)}
    write_all({directory / name: content for name, content in files.items()})
    return [directory / TEXT, directory / "index.html"]
