"""Every page can be pasted from top to bottom into a fresh process."""

import doctest
import os
import re
import subprocess
import sys

import pytest

from tests.docs import pages

BLOCK = re.compile(r"^```python\n(.*?)^```[ \t]*$|" + pages.CELL.pattern, re.MULTILINE | re.DOTALL)
PASTED = [page for page in pages.sources() if BLOCK.search(page.read_text(encoding="utf-8"))]
QUICK = ("README.md", "general.md", "solutions.md")
PEERS = ("heyoka", "rebound", "diffrax", "jax", "torch")


def pasted(page):
    """Return what is typed, without the prompts and what is printed."""
    typed = []
    for python, cell in BLOCK.findall(page.read_text(encoding="utf-8")):
        block = python or cell
        prompted = doctest.DocTestParser().get_examples(block)
        typed.append("".join(example.source for example in prompted) if prompted else block)
    return "\n".join(typed)


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=[] if page.name in QUICK else [pytest.mark.slow]) for page in PASTED],
    ids=[str(page.relative_to(pages.ROOT)) for page in PASTED],
)
def test_a_page_runs_pasted_from_top_to_bottom(page, tmp_path):
    script = tmp_path / "page.py"
    script.write_text(pasted(page), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(pages.ROOT), "MPLBACKEND": "Agg"}
    made = subprocess.run(
        [sys.executable, script], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    missing = re.search(r"No module named '(\w+)'", made.stderr)
    if missing and missing[1] in PEERS:
        pytest.skip(f"{page.name} DID NOT RUN: {missing[1]} is missing")
    assert made.returncode == 0, made.stderr[-2000:]
