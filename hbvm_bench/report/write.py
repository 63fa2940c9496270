"""Write a report: everything is made first, then every file is put in place whole."""

from pathlib import Path

from hbvm_bench.report.content import gather
from hbvm_bench.report.html import page
from hbvm_bench.report.markdown import markdown
from hbvm_bench.store import Store, atomic, ensure_writable
from problems.errors import InputError

FIGURES = "figures"


def write_report(store: Store, directory: Path) -> list[Path]:
    """Write ``report.md``, ``index.html`` and ``figures/`` of a run.

    Parameters
    ----------
    store : Store
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
        If the run has no finished case, or the directory cannot be written.
    """
    index = store.index()
    if not store.records():
        raise InputError(
            f"none of the {len(index.ids)} cases of the run in {str(store.directory)!r} has finished; "
            f"run: {index.command}."
        )
    # everything is made before anything is written
    content = gather(store)
    documents = {"report.md": markdown(content), "index.html": page(content)}
    files: dict[Path, bytes] = {}
    for picture in (picture for section in content.sections for picture in section.pictures):
        files[directory / FIGURES / f"{picture.key}.svg"] = picture.svg.encode()
        files[directory / FIGURES / f"{picture.key}.png"] = picture.png
    files |= {directory / name: text.encode() for name, text in documents.items()}
    ensure_writable(directory / FIGURES)
    for path, data in files.items():
        with atomic(path) as temporary:
            temporary.write_bytes(data)
    return [directory / name for name in documents]
