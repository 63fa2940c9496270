"""What a part of the paper report is made of; the page and the markdown are printed from it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from hbvm_bench.report.figures import canvas
from hbvm_bench.report.figures.canvas import Picture, new
from hbvm_bench.report.figures.read_off import read_off
from hbvm_bench.report.figures.style import MARKERS, OTHERS, UNKNOWN_MARKER, Look, base_colours
from hbvm_bench.summaries.table import Table

VERDICTS = {
    "holds": "confirmed",
    "partly": "confirmed in part",
    "no": "not found",
}

# Colours of the figures' families: light, dark. The true motion has the neutral colour of D's figures.
GAUSS, GAUSS_DARK = base_colours("Gauss")
HBVM, HBVM_DARK = base_colours("HBVM")
MOTION, MOTION_DARK = OTHERS[0]  # of what is a property of the motion, not of a method
LOOKS = (
    Look(1, GAUSS, GAUSS_DARK, (), MARKERS["Gauss"]),
    Look(2, HBVM, HBVM_DARK, (), MARKERS["HBVM"]),
    Look(3, MOTION, MOTION_DARK, (), UNKNOWN_MARKER),
)
NAMES = {1: "Gauss", 2: "HBVM", 3: "the motion itself"}
SEQUENTIAL = LinearSegmentedColormap.from_list(
    "dusk", ["#f2d9b8", "#d98f4e", "#ab4a3f", "#6b2f5e", "#3a2c66"]
)
WIDTH = 10.4  # inches, of a whole line


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper beside what was measured.

    Attributes
    ----------
    words : str
        The claim.
    paper : str
        What the paper gives for it: a number, a figure.
    here : str
        What came out.
    verdict : {"holds", "partly", "no"}
        See `VERDICTS`.
    """

    words: str
    paper: str
    here: str
    verdict: str


@dataclass(frozen=True)
class Part:
    """One of the paper's experiments.

    Attributes
    ----------
    key, title : str
        Anchor and heading.
    lead : sequence of str
        Paragraphs; text in backquotes is code.
    claims : sequence of Claim
        What the paper says and what came out.
    blocks : sequence of str, Picture or Table
        In order; a table has a key.
    """

    key: str
    title: str
    lead: Sequence[str]
    claims: Sequence[Claim]
    blocks: Sequence["str | Picture | Table"] = field(default_factory=list)

    @property
    def pictures(self) -> list[Picture]:
        """Return the figures, in order."""
        return [block for block in self.blocks if isinstance(block, Picture)]

    @property
    def tables(self) -> list[Table]:
        """The tables, in order."""
        return [block for block in self.blocks if isinstance(block, Table)]


def number(value: float | None, digits: int = 2) -> str:
    """Write a number for a sentence: ``3.4e-3``, ``0.25``, ``–`` for none."""
    if value is None or value != value:
        return "–"
    if value == 0:
        return "0"
    if 1e3 <= abs(value) < 1e6:
        return f"{value:,.0f}"
    if 1e-2 <= abs(value) < 1e3:
        return f"{value:.{max(digits, 3)}g}"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def sheet(width: float, height: float) -> Figure:
    """Return an empty figure of ``width`` × ``height`` inches that makes room for its labels."""
    figure = new(width, height)
    figure.set_layout_engine("constrained")
    return figure


def picture(figure: Figure, key: str, title: str, caption: str, summary: str) -> Picture:
    """Render a figure with the numbers that are read off it; the same figure gives the same bytes."""
    plot = read_off(figure, {look.light: look.number for look in LOOKS}, NAMES)
    return canvas.picture(figure, key, title, caption, summary, plot)
