"""A lock among processes, which ends with the one that holds it, however that one ends.

``fcntl`` is Unix's. Elsewhere SQLite, which Python contains, locks a file in the way of the system at hand.
"""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:
    fcntl = None

FILE = ".lock"
FOREVER = 2e6  # seconds; SQLite counts milliseconds in 32 bits


@contextlib.contextmanager
def held(path: Path, *, wait: bool) -> Iterator[None]:
    """Hold the lock of a path: a directory, or a file that is made where it is missing and stays.

    Raises
    ------
    BlockingIOError
        If another one holds it and ``wait`` is false.
    OSError
        If the file cannot be opened, or its file system has no locks.
    """
    if fcntl is None:
        with _by_sqlite(path / FILE if path.is_dir() else path, wait):
            yield
        return
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield
    finally:
        os.close(handle)


@contextlib.contextmanager
def _by_sqlite(path: Path, wait: bool) -> Iterator[None]:
    import sqlite3  # where it is needed

    try:
        connection = sqlite3.connect(path, timeout=FOREVER if wait else 0.0, isolation_level=None)
    except sqlite3.Error as error:
        raise OSError(str(error)) from error
    with contextlib.closing(connection):
        try:
            connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as error:
            busy = error.sqlite_errorcode == sqlite3.SQLITE_BUSY
            raise (BlockingIOError if busy else OSError)(str(error)) from error
        yield
