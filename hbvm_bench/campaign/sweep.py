"""Placeholders in a campaign's specifications, and the grids of values they are filled with.

``HBVM(k={k}, s={s}, h={step*f})`` with ``sweep = { k = [8, 16], f = [1, 0.5] }`` and
the problem's ``values = { step = 0.1, s = 4 }`` is four methods. Inside the braces
stand names and numbers, joined by ``*``; nothing is evaluated.
"""

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence

from problems.errors import InputError, unknown

PLACEHOLDER = re.compile(r"\{([^{}]*)\}")
DIGITS = 12  # of a product: 3 * 0.1 is 0.3 here

Scalar = float | int | str | list[str]
Sweep = Mapping[str, Sequence[Scalar]]


def combinations(sweep: Sweep) -> Iterator[dict[str, Scalar]]:
    """Yield every combination of the values of a sweep; one empty one where there is none."""
    for chosen in itertools.product(*sweep.values()):
        yield dict(zip(sweep, chosen, strict=True))


def names(text: str) -> set[str]:
    """Return the names in the placeholders of a specification."""
    factors = (factor.strip() for inside in PLACEHOLDER.findall(text) for factor in inside.split("*"))
    return {factor for factor in factors if factor.isidentifier()}


def fill(text: str, values: Mapping[str, Scalar]) -> str:
    """Return a specification, such as ``"Leapfrog(h={step*f}, order=8)"``, with its placeholders filled.

    Raises
    ------
    problems.errors.UnknownNameError
        For a name without a value.
    problems.errors.InputError
        For a factor that is neither a name nor a number, or a product of words.
    """
    return PLACEHOLDER.sub(lambda match: _product(text, match[1], values), text)


def _product(text: str, inside: str, values: Mapping[str, Scalar]) -> str:
    factors = [_factor(text, part.strip(), values) for part in inside.split("*")]
    if len(factors) == 1:
        return repr(tuple(factors[0]) if isinstance(factors[0], list) else factors[0])
    product = 1.0
    for factor in factors:
        if isinstance(factor, str | list):
            raise InputError(f"{text}: {{{inside}}} multiplies {factor!r}; give numbers.")
        product *= factor
    return repr(float(f"{product:.{DIGITS}g}"))


def _factor(text: str, part: str, values: Mapping[str, Scalar]) -> Scalar:
    if part.isidentifier():
        if part not in values:
            raise unknown(f"value in {text}", part, values)
        return values[part]
    try:
        return float(part)
    except ValueError:
        raise InputError(
            f"{text}: {part!r} in a placeholder is neither a name nor a number; write as in {{step*0.5}}."
        ) from None
