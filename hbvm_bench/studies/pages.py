"""The page of every report in a directory, from what is stored beside it; nothing is run."""

from collections.abc import Callable, Iterator
from pathlib import Path

from hbvm_bench.report.campaign import document
from hbvm_bench.report.document import Document
from hbvm_bench.report.html import page
from hbvm_bench.store import archive
from hbvm_bench.store.files import write_all


def _race(folder: Path) -> Document:
    from hbvm_bench.studies.race import report, results

    return report.document(results.load(folder), results.by_kind(folder))


def _endure(folder: Path) -> Document:
    from hbvm_bench.studies import endure

    return endure.document(endure.read(folder))


def _automatic(folder: Path) -> Document:
    from hbvm_bench.studies import automatic

    return automatic.document(automatic.by_kind(folder))


def _paper(folder: Path) -> Document:
    from hbvm_bench.studies.paper import report, results

    return report.document(results.load(folder), [part.key for part in report.PARTS])


STUDIES: dict[str, Callable[[Path], Document]] = {
    "race": _race,
    "endure": _endure,
    "automatic": _automatic,
    "paper": _paper,
}


def write(directory: Path) -> Iterator[Path]:
    """Write ``index.html`` of every report in a directory, and yield its path.

    Raises
    ------
    problems.errors.InputError
        If what is stored is damaged, or a directory cannot be written.
    """
    for folder in sorted(path for path in directory.iterdir() if path.is_dir()):
        if (folder / archive.NAME).is_file():
            made = document(archive.read(folder / archive.NAME))
        elif folder.name in STUDIES:
            made = STUDIES[folder.name](folder)
        else:
            continue
        path = folder / "index.html"
        write_all({path: page(made).encode()})
        yield path
