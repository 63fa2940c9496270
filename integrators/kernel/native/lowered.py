"""The kernel's functions as LLVM's text, which is made where the package is built and lies beside it.

To lower them takes numba two thirds of a first compilation, and what comes out is the same for all
processors of a system: only what LLVM makes of it depends on the processor at hand. A file is named by the
key of its function (an edit of the sources has another one) and by the version of LLVM that wrote it: no
other one promises to read it. Where there is none, numba lowers the function. Bitcode would be read a little
sooner, but compresses worse: 1.02 MB for the kernel, the text 0.63.
"""

import lzma
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import llvmlite.binding as llvm

from integrators.kernel.native import store

FOLDER = Path(__file__).parents[1] / "lowered"


def _file(key: str) -> Path:
    return FOLDER / f"{store.key(key, llvm.get_process_triple())}.{llvm.llvm_version_info[0]}.xz"


def get(key: str) -> str | None:
    """Return the text of a key, or ``None``: none for this system, or none that can be read."""
    file = _file(key)
    with suppress(OSError, lzma.LZMAError, EOFError, UnicodeDecodeError):
        return lzma.decompress(file.read_bytes()).decode("ascii")
    return None


def write(made: Mapping[str, str]) -> None:
    """Let texts, by their keys, be all that lies there."""
    FOLDER.mkdir(exist_ok=True)
    for old in FOLDER.glob("*.xz"):
        old.unlink()
    for key, text in made.items():
        _file(key).write_bytes(lzma.compress(text.encode("ascii"), preset=9))
