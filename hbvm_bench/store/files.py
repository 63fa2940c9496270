"""Files that are complete or not there, and directories that can be written."""

import os
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from problems.errors import InputError


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """Yield a temporary path that becomes ``path`` if the block succeeds, and vanishes if not.

    Raises
    ------
    problems.errors.InputError
        If it cannot be written, as on a full disk.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.part")
    try:
        yield temporary
        temporary.replace(path)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise InputError(f"cannot write {str(path)!r}: {error.strerror or error}.") from error
        raise


def spreadsheet_text(cell: str) -> str:
    """Return a cell that spreadsheets show as it is: an apostrophe goes before what would be a formula."""
    if not cell.startswith(("=", "+", "-", "@", "\t", "\r")):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell


def write_all(files: Mapping[Path, bytes]) -> None:
    """Write files that belong together: all of them or, as far as it can be helped, none.

    Raises
    ------
    problems.errors.InputError
        If one cannot be written; what there was is left as it was.
    """
    folders = {path.parent for path in files}
    new = _missing(folders)
    try:
        for folder in folders:
            ensure_writable(folder)
        with ExitStack() as stack:
            for path, content in files.items():
                stack.enter_context(atomic(path)).write_bytes(content)
    except BaseException:
        _remove(new)
        raise


def ensure_writable(directory: Path, *, keep: bool = True) -> None:
    """Make a directory and try to write in it; on failure, or unless ``keep``, leave nothing behind.

    Raises
    ------
    problems.errors.InputError
        With the reason.
    """
    new, kept = _missing([directory]), False
    try:
        if new:
            directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
        kept = keep
    except OSError as error:
        raise InputError(f"cannot write to the directory {str(directory)!r}: {error.strerror}.") from None
    finally:
        if not kept:
            _remove(new)


def _missing(folders: Iterable[Path]) -> set[Path]:
    return {path for folder in folders for path in (folder, *folder.parents) if not path.exists()}


def _remove(folders: Iterable[Path]) -> None:
    for path in sorted(folders, reverse=True):
        with suppress(OSError):
            path.rmdir()
