"""Reports whose figures are not looked at, or not as images: drawing is most of what a report costs."""

import io

import pytest
from matplotlib.figure import Figure

from hbvm_bench.report.figures import canvas


@pytest.fixture(scope="module")
def no_images():
    """Draw figures as SVG alone: their images lie beside a page, not in it."""
    draw = Figure.savefig
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            Figure, "savefig", lambda self, file, **how: how["format"] == "svg" and draw(self, file, **how)
        )
        patch.setattr(canvas, "small", lambda png: png)
        yield


@pytest.fixture
def undrawn(monkeypatch):
    """Draw nothing."""
    monkeypatch.setattr(
        Figure, "savefig", lambda self, file, **_: isinstance(file, io.StringIO) and file.write("<svg/>")
    )
    monkeypatch.setattr(canvas, "small", lambda png: png)
