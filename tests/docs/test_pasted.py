"""Every page can be pasted from top to bottom into a fresh process."""

import code
import contextlib
import io
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs import pages

BLOCK = re.compile(r"^```python\n(.*?)^```[ \t]*$|" + pages.CELL.pattern, re.MULTILINE | re.DOTALL)
QUOTED = "kernel.md"  # its blocks are parts of the package's code
PROMPTED = re.compile(r"^(?:>>> |\.\.\. ?)(.*)$", re.MULTILINE)  # what the site's button copies
PASTED = [
    page for page in pages.sources() if page.name != QUOTED and BLOCK.search(page.read_text(encoding="utf-8"))
]


def _name(page):
    return str(page.relative_to(pages.ROOT))


QUICK = ("README.md", "start.md", "solutions.md", "own_hamiltonian.md")
PEERS = ("heyoka", "rebound", "diffrax", "jax", "torch")


def pasted(page):
    """Return what is typed, without the prompts and what is printed."""
    typed = []
    for python, cell in BLOCK.findall(page.read_text(encoding="utf-8")):
        block = python or pages.plain(cell)
        typed.append("\n".join(PROMPTED.findall(block)) or block)
    return "\n".join(["from tests.docs.pages import shell as _shell, write as _write", *typed])


class Typed(code.InteractiveConsole):
    """A prompt that reads and does not run."""

    def runcode(self, code):
        pass


@pytest.mark.parametrize("page", PASTED, ids=_name)
def test_what_has_prompts_can_be_pasted_into_one(page):
    console = Typed()
    with contextlib.redirect_stderr(io.StringIO()) as errors:
        for block in re.findall(r"^```python\n(>>> .*?)^```", page.read_text(encoding="utf-8"), re.M | re.S):
            waits = [console.push(line) for line in [*PROMPTED.findall(block), ""]]
            assert not waits[-1]
    assert errors.getvalue() == ""


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=[] if page.name in QUICK else [pytest.mark.slow]) for page in PASTED],
    ids=map(_name, PASTED),
)
def test_a_page_runs_pasted_from_top_to_bottom(page, tmp_path):
    script = tmp_path / "page.py"
    script.write_text(pasted(page), encoding="utf-8")
    commands = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PYTHONPATH": str(pages.ROOT), "MPLBACKEND": "Agg", "PATH": commands}
    made = subprocess.run(
        [sys.executable, "-W", "error", script],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    missing = re.search(r"No module named '(\w+)'", made.stderr)
    if missing and missing[1] in PEERS:
        pytest.skip(f"{page.name} DID NOT RUN: {missing[1]} is missing")
    assert made.returncode == 0, made.stderr[-2000:]
