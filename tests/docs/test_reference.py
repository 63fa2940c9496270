"""Every public name stands in the reference, and has an example that is true."""

import doctest
import inspect
import re
import sys
from pathlib import Path

import pytest

import integrators
import problems
from integrators import registry

PAGES = Path(__file__).parents[2] / "docs" / "reference"


def listed(page: str) -> list[str]:
    """Return the names that a page of the reference lists."""
    return re.findall(r"^   (\w+)$", (PAGES / page).read_text(encoding="utf-8"), flags=re.MULTILINE)


NAMES = [
    *((integrators, name) for page in ("integrators.md", "methods.md") for name in listed(page)),
    *((problems, name) for name in listed("problems.md")),
]


def test_every_public_name_stands_in_the_reference():
    assert sorted(listed("problems.md")) == sorted(problems.__all__)
    assert sorted(listed("methods.md")) == sorted(registry.names())
    shown = {*listed("integrators.md"), *listed("methods.md")}
    assert {*integrators.__all__} - {"registry"} <= shown
    assert {*listed("integrators.md")} <= {*integrators.__all__}


@pytest.mark.parametrize(("package", "name"), NAMES, ids=[name for _, name in NAMES])
def test_its_example_is_true(package, name):
    thing = getattr(package, name)
    text = inspect.getdoc(thing) or ""
    assert "Examples\n--------\n" in text
    if sys.modules.get(library := getattr(thing, "library", ""), sys) is None:
        pytest.skip(f"{library} is not installed")
    test = doctest.DocTestParser().get_doctest(text, {}, name, inspect.getsourcefile(thing), 0)
    said: list[str] = []
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, out=said.append)
    assert not said, "".join(said)
