"""The page on events tells what the code does."""

import doctest
from pathlib import Path

PAGE = Path(__file__).parents[3] / "docs" / "events.md"


def test_the_examples_of_the_page_are_true():
    # The fences of code blocks end an example's output, as blank lines do.
    result = doctest.testfile(str(PAGE), module_relative=False, optionflags=doctest.ELLIPSIS)
    assert result.attempted >= 18
    assert result.failed == 0
