"""Reports whose figures are not looked at: drawing is most of what a report costs."""

import io

import pytest
from matplotlib.figure import Figure


@pytest.fixture
def undrawn(monkeypatch):
    """Draw nothing."""
    monkeypatch.setattr(
        Figure, "savefig", lambda self, file, **_: isinstance(file, io.StringIO) and file.write("<svg/>")
    )
