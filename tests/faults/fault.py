"""The table of faults: what somebody does wrong, and the sentence they must get for it."""

import re
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from problems.errors import InputError


@dataclass(frozen=True)
class Fault:
    """One row of the table.

    Attributes
    ----------
    name : str
        What is wrong, as it would be typed where that is short; the test's id.
    do : callable
        Does it.
    says : str
        A regular expression for what the sentence must contain: the value and the fix.
    error : type
        What is raised.
    """

    name: str
    do: Callable[[], object]
    says: str
    error: type[Exception] = InputError

    def __str__(self) -> str:
        return self.name


def is_met(fault: Fault) -> None:
    """Assert that a fault gets its one sentence."""
    with pytest.raises(fault.error) as caught:
        fault.do()
    sentence(str(caught.value), fault.says)


def sentence(text: str, says: str) -> None:
    """Assert that a message is one readable sentence that says what it must."""
    assert re.search(says, text), f"{text!r} does not say {says!r}"
    assert "\n" not in text.strip(), f"more than one line: {text!r}"
    assert len(text) < 600, f"{len(text)} characters: {text!r}"
    assert not re.search(r"object at 0x|Traceback|\x1b", text), text
