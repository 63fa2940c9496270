"""Settings of all tests."""

import os
import signal
import sys
from importlib.util import find_spec

import pytest
from hypothesis import settings

from integrators.peers import APART, without_wheels
from problems.errors import MissingLibraryError

# What decides whether a change lands is the same every time; at home hypothesis goes on looking.
settings.register_profile("ci", derandomize=True, deadline=None, print_blob=True)
settings.register_profile("home", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "home")

# A shell starts background jobs deaf to Ctrl-C, and their children inherit it; some tests send it to a child.
signal.signal(signal.SIGINT, signal.default_int_handler)


# Libraries that have no wheels for this system, and those apart that are not installed; the tests want every
# other one. WITHOUT="heyoka ..." hides more of them, as they are hidden there.
APART_ABSENT = [library for library in APART if find_spec(library) is None]
ABSENT = {*without_wheels(), *APART_ABSENT, *os.environ.get("WITHOUT", "").split()}
sys.modules.update(dict.fromkeys(ABSENT))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Skip a test that met a library which this system cannot have."""
    report = yield
    error = call.excinfo and call.excinfo.value
    if isinstance(error, MissingLibraryError) and ABSENT.intersection(str(error).split()):
        report.outcome, report.longrepr = "skipped", (str(item.path), 0, f"Skipped: {error}")
    return report


# Begun first, so that at the end no core waits for one of them: a file is the work of one process.
LONG = (
    *("test_report_browser.py", "test_diffrax.py", "test_runner.py", "test_pasted.py", "test_conformance.py"),
    *("test_pages_browser.py", "test_scripts.py", "test_peer_check.py", "test_general.py"),
)


def pytest_collection_modifyitems(items):
    """Sort the long files to the front."""
    items.sort(key=lambda item: item.path.name not in LONG)


def pytest_terminal_summary(terminalreporter):
    """Say loudly that nobody looked at the pages."""
    skipped = [one for one in terminalreporter.stats.get("skipped", []) if "no chromium" in str(one.longrepr)]
    if skipped:
        terminalreporter.write_line(
            f"NOT TESTED: {len(skipped)} tests look at pages in a browser, and there is no chromium here. "
            "Install one, or run .venv/bin/playwright install chromium and set CHROMIUM to its path.",
            red=True,
            bold=True,
        )
