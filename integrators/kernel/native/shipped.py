"""What is compiled where the package is built, and lies beside it: a first use need not wait for a compiler.

Machine code of the engines for each level of a processor's instructions (`machine.LEVELS`), and LLVM's text
of what is linked with a system's field. Each lies under the key of its function, so that an edit of the
sources has another one. Where there is none, numba compiles the function.

Machine code is the same for every version of LLVM; a text is read by the version that wrote it alone. All of
it takes 0.4 MB.
"""

import io
import lzma
import tarfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import llvmlite.binding as llvm

FOLDER = Path(__file__).parents[1] / "shipped"


def code(key: str) -> bytes | None:
    """Return the machine code of a key, or ``None``: none for this system, or none that can be read."""
    return _get(_codes(), key)


def text(key: str) -> str | None:
    """Return LLVM's text of a key, or ``None``: none for this system and version that can be read."""
    kept = _get(_texts(), key)
    return None if kept is None else kept.decode("ascii")


def write(codes: Mapping[str, bytes], texts: Mapping[str, str]) -> None:
    """Let machine code and texts, by their keys, be all that lies there."""
    FOLDER.mkdir(exist_ok=True)
    for old in FOLDER.glob("*.xz"):
        old.unlink()
    _put(_codes(), codes)
    _put(_texts(), {key: text.encode("ascii") for key, text in texts.items()})


def _codes() -> Path:
    return FOLDER / f"{llvm.get_process_triple()}.tar.xz"


def _texts() -> Path:
    return FOLDER / f"{llvm.get_process_triple()}.{llvm.llvm_version_info[0]}.tar.xz"


def _get(file: Path, key: str) -> bytes | None:
    """Return what lies under a key; the archive's checksum is of all of it, so all of it is read."""
    with suppress(OSError, lzma.LZMAError, EOFError, tarfile.TarError):
        content = lzma.decompress(file.read_bytes())
        with tarfile.open(fileobj=io.BytesIO(content)) as archive:
            for member in archive:
                if member.name == key and (found := archive.extractfile(member)) is not None:
                    return found.read()
    return None


def _put(file: Path, contents: Mapping[str, bytes]) -> None:
    with tarfile.open(file, "w:xz", preset=9) as archive:
        for key, content in contents.items():
            member = tarfile.TarInfo(key)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
