"""The page on what is public lists what the modules say themselves, and the formats that the code writes."""

import importlib
import re
from pathlib import Path

import pytest

from integrators.running import watch
from integrators.solution import files

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "public.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `([\w.]+)` \| [^|]+ \| ([^|]+) \|$", PAGE, flags=re.MULTILINE)
LISTED = {module: re.findall(r"`(\w+)`", names) for module, names in ROWS if "`" in names}


@pytest.mark.parametrize("module", LISTED)
def test_the_page_lists_what_a_module_says_is_public(module):
    found = importlib.import_module(module)
    assert LISTED[module] == sorted(found.__all__)
    assert all(hasattr(found, name) for name in found.__all__)


def test_the_page_lists_every_module_with_public_names():
    assert len(LISTED) == 13
    assert {"problems", "integrators", "integrators.protocol", "integrators.stepping"} <= {*LISTED}


def test_the_page_tells_the_formats_of_files():
    row = r"^\| (solution|ensemble|checkpoint) \| [^|]+ \| (\d+)"
    written = {"solution": files.FORMAT, "ensemble": files.FORMAT, "checkpoint": watch.VERSION}
    assert dict(re.findall(row, PAGE, flags=re.MULTILINE)) == {name: str(n) for name, n in written.items()}
