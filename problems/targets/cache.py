"""Generated source kept in files, so that compiled code is found again by later processes.

numba finds its compiled code again only for functions that live in a file, and
loads it only if the module's name is the file's and stands in ``sys.modules``
(it pickles references to it). Files are named by a hash of everything that goes
into them, written to a temporary name and moved into place.
"""

import contextlib
import functools
import hashlib
import importlib.util
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from problems import locks
from problems.errors import InputError

VARIABLE = "HBVM_BENCH_CACHE"


@functools.cache
def _prepared(explicit: str | None, xdg: str | None) -> tuple[Path, bool]:
    """Return the folder, and whether it can be written."""
    if explicit:
        folder = Path(explicit).expanduser()
    else:
        folder = (Path(xdg) if xdg else Path.home() / ".cache") / "hbvm-bench"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        if folder.is_dir() and os.access(folder, os.R_OK | os.X_OK):
            return folder, False
        if explicit:
            raise InputError(
                f"{VARIABLE}={explicit} is not a folder that can be written, or read: {error}."
            ) from error
        return _own(), True
    return folder, True


@functools.cache
def _own() -> Path:
    """Return a folder of this process: what is compiled there is compiled anew in each."""
    return Path(tempfile.mkdtemp(prefix="hbvm-bench-"))


def directory() -> Path:
    """Return the folder of what is kept between processes, made if it is missing.

    ``HBVM_BENCH_CACHE``, else ``$XDG_CACHE_HOME/hbvm-bench``, else
    ``~/.cache/hbvm-bench``; where it can only be read, what it has is used and nothing is
    added; where none of the latter two is there, a folder of this process.

    Raises
    ------
    problems.errors.InputError
        If ``HBVM_BENCH_CACHE`` names a folder that can neither be written nor read.
    """
    return _prepared(os.environ.get(VARIABLE), os.environ.get("XDG_CACHE_HOME"))[0]


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Let one process at a time through, or all of them where nothing can be locked; see `problems.locks`."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # a folder that can only be read, a file system without locks
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            stack.enter_context(locks.held(path, wait=True))
        yield


def versions() -> str:
    """Return what compiled code depends on besides its source."""
    import numba

    python = ".".join(map(str, sys.version_info[:3]))
    return f"python {python} numba {numba.__version__}"


def module(text: str, stem: str) -> ModuleType:
    """Import generated source as a module from the cache folder.

    Parameters
    ----------
    text : str
        The module's source, complete with its imports.
    stem : str
        Start of the module's name; the hash of the text and of `versions` follows.

    Returns
    -------
    ModuleType
        The same module object for the same text, within a process.

    Raises
    ------
    problems.errors.InputError
        If there is no place to write the source to.
    """
    full = f"# {versions()}\n{text}"
    name = f"{stem}_{hashlib.sha256(full.encode()).hexdigest()[:20]}"
    if name in sys.modules:
        return sys.modules[name]
    path = _written(f"{name[-120:]}.py", full)  # names of files have a length that systems bound
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    result = importlib.util.module_from_spec(spec)
    sys.modules[name] = result
    try:
        spec.loader.exec_module(result)
    except BaseException:
        del sys.modules[name]
        raise
    return result


def _written(name: str, text: str) -> Path:
    """Return a file that holds the source, in a folder that numba can write to as well."""
    folder, writable = _prepared(os.environ.get(VARIABLE), os.environ.get("XDG_CACHE_HOME"))
    error = None
    for place in (lambda: folder, _own) if writable else (_own,):
        path = place() / name
        # Left alone when it is right: numba takes a newer file for a changed one.
        if _holds(path, text):
            return path
        try:
            _write(path, text)
        except OSError as full_or_gone:
            error = full_or_gone
        else:
            return path
    raise InputError(f"cannot write generated code to {folder}: {error}; make room, or set {VARIABLE}.")


def _holds(path: Path, text: str) -> bool:
    try:
        return path.read_text(encoding="utf-8") == text
    except (OSError, UnicodeDecodeError):
        return False


def _write(path: Path, text: str) -> None:
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".tmp")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(temporary).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(temporary).unlink()
        raise
