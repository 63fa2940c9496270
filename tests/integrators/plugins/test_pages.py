"""The examples on the plugins' pages run as they stand there, and print what the pages say."""

import contextlib
import io
import re
import runpy
from pathlib import Path

import pytest

PAGES = Path(__file__).parents[3] / "docs" / "plugins"


def example(page: str, which: int = 0) -> list[float]:
    """Run a code block of a page in the tests' process; return the numbers it printed."""
    block = re.findall(r"```python\n(.*?)```", (PAGES / page).read_text(), re.DOTALL)[which]
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(block, page, "exec"), {"__name__": page})  # noqa: S102 -- our own page
    return [abs(float(line)) for line in printed.getvalue().split()]


def test_the_example_for_scipy_shows_the_leak_and_its_absence() -> None:
    leaking, kept = example("scipy.md")
    assert leaking > 1e-7  # measured 3.2e-7
    assert kept < 1e-13  # measured 7e-15


def test_the_example_of_compiled_fields_keeps_the_energy() -> None:
    errors = example("scipy.md", 1)
    assert len(errors) == 2
    assert max(errors) < 1e-13  # measured 4e-15


def test_the_example_for_diffrax_keeps_the_energy() -> None:
    pytest.importorskip("diffrax")
    (error,) = example("diffrax.md")
    assert error < 1e-12  # measured 1e-14


def test_the_example_for_rebound_keeps_the_energy() -> None:
    pytest.importorskip("rebound")
    (error,) = example("rebound.md")
    assert error < 2e-14  # measured 1e-15


def test_the_energy_of_dop853_leaks_linearly_and_that_of_hbvm_does_not() -> None:
    rows = list(runpy.run_path(str(PAGES / "costs.py"))["leak"](400.0, parts=4))
    leaks = [errors["DOP853"] for _, errors in rows]
    assert leaks[-1] / leaks[0] == pytest.approx(4.0, rel=0.2)
    assert max(errors["HBVM"] for _, errors in rows) < 1e-2 * leaks[0]  # measured 1e-14 beside 1e-7
