"""Input that is more than numbers, such as lengths with a unit, is refused: nothing of it is dropped."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems.errors import InputError, shown

_PLAIN = {float, int, np.float64}


class PlainArray(np.ndarray):
    """Base of arrays that are written to in another way, and carry nothing but numbers."""


_ALLOWED = (np.memmap, PlainArray)


def plain_numbers(label: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return numbers as an array of float64; an array of float64 as it is.

    Raises
    ------
    problems.errors.InputError
        For what is not made of numbers, or of more than numbers.
    """
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    if (why := _more(value)) is not None:
        raise InputError(f"{label} {why}.")
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{label} must be numbers, not {shown(value)}.") from error


def refuse_more_than_numbers(label: str, value: Any) -> None:
    """Refuse what a conversion to float64 would drop a part of.

    Raises
    ------
    problems.errors.InputError
        For units, masks, imaginary parts, booleans and subclasses of NumPy's arrays.
    """
    if (why := _more(value)) is not None:
        raise InputError(f"{label} {why}.")


def _more(value: Any) -> str | None:
    """Return what a value is besides numbers, and what to give instead; ``None`` for numbers."""
    kind = type(value)
    if kind in _PLAIN or (kind is np.ndarray and value.dtype == np.float64):
        return None
    if kind in (list, tuple) and {*map(type, value)} <= _PLAIN:
        return None
    if named := next((name for name in ("unit", "units") if hasattr(kind, name)), None):
        return (
            f"has the unit {getattr(value, named)!s:.40}, and units are not carried; give numbers in one "
            "system of units, as from .to_value(unit) with astropy or .m_as(unit) with pint"
        )
    if isinstance(value, np.ma.MaskedArray):
        return "is a masked array; give plain numbers, as from .compressed() or .filled(value)"
    if (
        isinstance(value, np.ndarray)
        and kind is not np.ndarray
        and not isinstance(value, np.memmap | PlainArray)
    ):
        return f"is a {kind.__name__}, of which only the numbers would be used; give np.asarray of it"
    if isinstance(value, complex | np.complexfloating) or _kind(value) == "c":
        return (
            "is complex, and must be real; a complex state is split into real and imaginary parts, "
            "as in y0=[*z.real, *z.imag]"
        )
    if isinstance(value, bool | np.bool_) or _kind(value) == "b":
        return "has True or False, and must be numbers; give 1.0 or 0.0"
    if isinstance(value, list | tuple):
        return next((why for item in value if (why := _more(item)) is not None), None)
    return None


def _kind(value: Any) -> str:
    return getattr(getattr(value, "dtype", None), "kind", "")
