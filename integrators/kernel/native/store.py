"""Compiled code kept on disk: one file per key, written at once or not at all.

Several processes may start together, and a file may be cut short by a full
disk: each file carries the digest of its content, is written under another
name and renamed, and is dropped and made anew when it does not check out. The digest
is over the key too: code under another key's name would be run all the same.
"""

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np

from problems.targets.cache import directory, locked

DIGEST = 32


def key(*parts: str | bytes) -> str:
    """Return the name (sha256, hex) of whatever follows from ``parts``."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()


def _path(name: str) -> Path:
    return directory() / "native" / name[:2] / name


def _digest(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + content).digest()


def making(name: str) -> AbstractContextManager[None]:
    """Return a context that one process at a time enters for a key; see `problems.targets.cache.locked`."""
    return locked(directory() / "locks" / name)


def get(name: str) -> bytes | None:
    """Return what is kept under a key, or ``None``: nothing there, not readable, or damaged."""
    try:
        data = _path(name).read_bytes()
    except OSError:
        return None
    digest, content = data[:DIGEST], data[DIGEST:]
    if _digest(name, content) == digest:
        return content
    with contextlib.suppress(OSError):
        _path(name).unlink()
    return None


def put(name: str, content: bytes) -> bool:
    """Keep ``content`` under a key; return whether the disk took it."""
    path = _path(name)
    temporary = None
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".")
        with os.fdopen(handle, "wb") as file:
            file.write(_digest(name, content) + content)
        Path(temporary).replace(path)
    except OSError:
        if temporary is not None:
            with contextlib.suppress(OSError):
                Path(temporary).unlink()
        return False
    return True


def arrays(name: str, shapes: Sequence[tuple[int, int]], make: Callable[[], Sequence[Any]]) -> list[Any]:
    """Return arrays of doubles that are kept under a key, or made and kept now.

    They are read back even if just made: what is computed from them depends on their layout, in the last bit.
    """
    ends = np.cumsum([rows * columns for rows, columns in shapes])
    kept = get(name)
    if kept is None or len(kept) != 8 * ends[-1]:
        kept = b"".join(part.astype("<f8").tobytes() for part in make())
        put(name, kept)
    parts = np.split(np.frombuffer(kept, "<f8"), ends[:-1])
    return [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]
