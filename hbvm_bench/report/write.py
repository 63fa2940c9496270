"""Write a report: everything is made first, then every file is put in place whole."""

from collections.abc import Sequence
from pathlib import Path

from hbvm_bench.report import pack
from hbvm_bench.report.as_markdown import markdown
from hbvm_bench.report.content import Content, gather
from hbvm_bench.report.figures import canvas
from hbvm_bench.report.html import page
from hbvm_bench.store.files import write_all
from hbvm_bench.store.store import Store, again
from problems.errors import InputError


def write_report(stores: Store | Sequence[Store], directory: Path) -> list[Path]:
    """Write ``report.md``, ``index.html``, ``figures/`` and ``data/`` of one run, or of several together.

    Parameters
    ----------
    stores : Store or sequence of Store
        With at least one finished case.
    directory : Path
        Made if missing.

    Returns
    -------
    list of Path
        The two documents.

    Raises
    ------
    problems.errors.InputError
        If no run has a finished case, or the directory cannot be written.
    """
    stores = [stores] if isinstance(stores, Store) else list(stores)
    if not any(store.records() for store in stores):
        planned = sum(len(store.index().ids) for store in stores)
        raise InputError(
            f"none of the {planned} cases of the run in {str(stores[0].directory)!r} has finished; "
            f"{again(stores[0].index(), stores[0].directory)}."
        )
    made = rendered(gather(stores))
    write_all({directory / name: data for name, data in made.items()})
    return [directory / "report.md", directory / "index.html"]


def rendered(content: Content) -> dict[str, bytes]:
    """Return all files of a report by their path in its directory."""
    documents = {"report.md": markdown(content).encode(), "index.html": page(content).encode()}
    return canvas.files(content.pictures) | pack.files(content) | documents
