"""The kernel's functions as LLVM's bitcode, which is made where the package is built and lies beside it.

To lower them takes numba two thirds of a first compilation, and what comes out is the same for all
processors of a system: only what LLVM makes of it depends on the processor at hand. A file is named by the
key of its function (an edit of the sources has another one) and by the version of LLVM that wrote it, which
later ones can read. Where there is none, numba lowers the function.
"""

import lzma
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import llvmlite.binding as llvm

from integrators.kernel.native import store

FOLDER = Path(__file__).parents[1] / "lowered"


def _name(key: str) -> str:
    return store.key(key, llvm.get_process_triple())


def get(key: str) -> bytes | None:
    """Return the bitcode of a key, or ``None``: none for this system, or none that can be read."""
    for file in FOLDER.glob(f"{_name(key)}.*.xz"):
        with suppress(OSError, lzma.LZMAError, EOFError):
            if int(file.suffixes[0][1:]) <= llvm.llvm_version_info[0]:
                return lzma.decompress(file.read_bytes())
    return None


def write(made: Mapping[str, bytes]) -> None:
    """Let bitcode, by its keys, be all that lies there."""
    FOLDER.mkdir(exist_ok=True)
    for old in FOLDER.glob("*.xz"):
        old.unlink()
    for key, bitcode in made.items():
        file = FOLDER / f"{_name(key)}.{llvm.llvm_version_info[0]}.xz"
        file.write_bytes(lzma.compress(bitcode, preset=9))
