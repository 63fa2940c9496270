"""The kernel's functions as LLVM's text, which is made where the package is built and lies beside it.

To lower them takes numba two thirds of a first compilation, and what comes out, after LLVM's passes that
depend on no processor, is the same for all processors of a system. An archive is named by the system and by
the version of LLVM that wrote it, for no other one promises to read it; a text in it by the key of its
function, so that an edit of the sources has another one. Where there is none, numba lowers the function.

The texts have functions in common: one archive of them takes 0.34 MB, and one for each text would take
0.41 MB. An archive is read up to the text that is asked for, 5 ms for each MB.
"""

import io
import lzma
import tarfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import llvmlite.binding as llvm

FOLDER = Path(__file__).parents[1] / "lowered"


def _file() -> Path:
    return FOLDER / f"{llvm.get_process_triple()}.{llvm.llvm_version_info[0]}.tar.xz"


def get(key: str) -> str | None:
    """Return the text of a key, or ``None``: none for this system, or none that can be read."""
    with (
        suppress(OSError, lzma.LZMAError, EOFError, tarfile.TarError, UnicodeDecodeError),
        tarfile.open(_file(), "r|xz") as archive,
    ):
        for member in archive:
            if member.name == key and (text := archive.extractfile(member)) is not None:
                return text.read().decode("ascii")
    return None


def write(texts: Mapping[str, str]) -> None:
    """Let texts, by their keys, be all that lies there; the first ones are read soonest."""
    FOLDER.mkdir(exist_ok=True)
    for old in FOLDER.glob("*.xz"):
        old.unlink()
    with tarfile.open(_file(), "w:xz", preset=9) as archive:
        for key, text in texts.items():
            content = text.encode("ascii")
            member = tarfile.TarInfo(key)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
