"""Write a document: everything is made first, then every file is put in place whole."""

from pathlib import Path

from hbvm_bench.report.document import Document
from hbvm_bench.report.html import page
from hbvm_bench.report.markdown import markdown
from hbvm_bench.store.files import write_all


def rendered(document: Document) -> dict[str, bytes]:
    """Return all files of a document by their path in its directory."""
    made = {document.name: markdown(document).encode(), "index.html": page(document).encode()}
    return {picture.file: picture.svg.encode() for picture in document.shown} | made


def write(document: Document, directory: Path) -> list[Path]:
    """Write the markdown with its ``figures/``, and the page; return the paths of the first two.

    Raises
    ------
    problems.errors.InputError
        If the directory cannot be written.
    """
    write_all({directory / name: content for name, content in rendered(document).items()})
    return [directory / document.name, directory / "index.html"]
