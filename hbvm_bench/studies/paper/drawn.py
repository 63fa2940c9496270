"""What all figures on the paper share: colours, sizes, the numbers that a page reads off them."""

from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from hbvm_bench.report.figures import canvas
from hbvm_bench.report.figures.canvas import Picture, new
from hbvm_bench.report.figures.read_off import read_off
from hbvm_bench.report.figures.style import TRUTH, looks

# What is a property of the motion, not of a method, has a look of its own; the true motion is neutral.
LOOKS = tuple(looks(("Gauss", "HBVM", "Motion")).values())
GAUSS, HBVM, MOTION = (look.light for look in LOOKS)
NAMES = {1: "Gauss", 2: "HBVM", 3: "the motion itself"}
FAMILIES = {"gauss": GAUSS, "hbvm": HBVM, "truth": TRUTH}
SEQUENTIAL = LinearSegmentedColormap.from_list(
    "dusk", ["#f2d9b8", "#d98f4e", "#ab4a3f", "#6b2f5e", "#3a2c66"]
)
WIDTH = 10.4  # inches, of a whole line


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


def picture(
    figure: Figure, key: str, title: str, caption: str, summary: str, *, values: bool = False
) -> Picture:
    """Render a figure with the numbers that are read off it; the same figure gives the same bytes."""
    plot = read_off(figure, {look.light: look.number for look in LOOKS}, NAMES)
    return canvas.picture(figure, key, title, caption, summary, plot, values=values)
