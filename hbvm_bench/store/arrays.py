"""Arrays as bytes: compressed ``.npy`` files without pickles."""

import io
import re
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from problems import limits

NAME = re.compile(r"\w[\w .-]{0,99}")
"""What an array, or an invariant, may be called: the names stand on pages and in file names."""

MAGIC = b"\x93NUMPY"


def packed(values: NDArray[np.float64], *, compress: bool = True) -> bytes:
    """Return an array as the bytes of a ``.npy`` file, compressed unless something around them is."""
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.atleast_1d(values), allow_pickle=False)
    return zlib.compress(stream.getvalue(), 6) if compress else stream.getvalue()


def unpacked(data: bytes) -> NDArray[np.float64]:
    """Return the array of some bytes; see `packed`.

    Raises
    ------
    ValueError
        If they are something else: cut, larger than memory is allowed, pickles, texts or complex numbers.
    """
    if not data.startswith(MAGIC):
        unpacking = zlib.decompressobj()
        try:
            data = unpacking.decompress(data, int(limits.limit("GIB") * 2**30))
        except zlib.error as error:
            raise ValueError(f"an array is damaged: {error}") from None
        if not unpacking.eof:
            raise ValueError("an array is cut, or larger than HBVM_BENCH_MAX_GIB allows")
    stream = io.BytesIO(data)
    try:
        np.lib.format.read_magic(stream)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    except Exception as error:  # numpy parses the header, and raises what its parser does
        raise ValueError(f"an array has no header: {error}") from None
    if dtype.kind not in "fiu" or any(length < 0 for length in shape):
        raise ValueError(f"an array has the type {dtype} and the shape {shape}")
    values = np.frombuffer(data, dtype, offset=stream.tell())  # which allocates nothing
    return values.reshape(shape, order="F" if fortran else "C").copy()


def check(blobs: Mapping[str, bytes]) -> None:
    """Read the arrays of some bytes to the end, by their names.

    Raises
    ------
    ValueError
        If a name or an array is none.
    """
    if not all(map(NAME.fullmatch, blobs)):
        raise ValueError("an array has no name, or one that is none")
    for data in blobs.values():
        unpacked(data)
