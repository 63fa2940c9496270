"""The page of every report in a directory, from what is stored beside it; nothing is run."""

from collections.abc import Iterator
from pathlib import Path

from hbvm_bench.report.html import page
from hbvm_bench.report.page import document
from hbvm_bench.store import archive
from hbvm_bench.store.files import write_all
from hbvm_bench.studies.paper import report, results


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
        elif (folder / results.NAME).is_file():
            made = report.document(results.load(folder), [part.key for part in report.PARTS])
        else:
            continue
        path = folder / "index.html"
        write_all({path: page(made).encode()})
        yield path
