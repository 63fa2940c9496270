"""The paper report as markdown and as one self-contained page."""

import csv
import io
import re
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup, escape

from hbvm_bench.report import shell
from hbvm_bench.report.figures.canvas import Picture, inline_svg
from hbvm_bench.report.markdown import code, plain
from hbvm_bench.studies.paper.document import LOOKS, NAMES, VERDICTS, Part
from hbvm_bench.summaries.table import Table

TITLE = "The seed paper, run again"
PAPER = (
    "L. Brugnano, F. Iavernaro, T. Susca: Numerical comparisons between Gauss–Legendre methods and "
    "Hamiltonian BVMs defined over Gauss points"
)
LEAD = (
    "Every experiment, figure and table of the paper from one command, beside what the paper says. Where "
    "the two differ, the difference is explained; where the paper is silent, it is measured."
)
ENLARGED = 1.72  # pixels per point: a figure of a whole line fills the page's column
COLOURS = {look.light: f"--m{look.number}" for look in LOOKS}


def markdown(parts: Sequence[Part], command: str) -> str:
    """Return the report as markdown with relative links to its figures."""
    environment = shell.environment("hbvm_bench.studies.paper", autoescape=False)
    environment.filters |= {"code": code, "prose": prose}
    environment.globals |= {"kind": kind, "cell": markdown_cell}
    text = environment.get_template("paper.md.j2").render(**_values(parts, command))
    return re.sub(r"\n{3,}", "\n\n", text)


def page(parts: Sequence[Part], command: str) -> str:
    """Return the report as an HTML document from which no request leaves."""
    environment = shell.environment("hbvm_bench.studies.paper", autoescape=True)
    environment.filters |= {"prose": html_prose}
    environment.globals |= {"kind": kind, "cell": html_cell}
    pictures = [picture for part in parts for picture in part.pictures]
    css = shell.text("hbvm_bench.studies.paper", "paper.css")
    shared = shell.values(pictures, LOOKS, names=NAMES, data={"csv": claims_csv(parts)}, css=css)
    return environment.get_template("paper.html.j2").render(
        **_values(parts, command), **shared | {"drawing": drawing}
    )


def claims_csv(parts: Sequence[Part]) -> str:
    """Return all claims as one table."""
    rows = [(part.title, c.words, c.paper, c.here, c.verdict) for part in parts for c in part.claims]
    return as_csv([("part", "claim", "paper", "here", "verdict"), *rows])


def as_csv(rows: Sequence[Sequence[str]]) -> str:
    """Return rows as text."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def drawing(picture: Picture) -> Markup:
    """Return the SVG of a figure for the page, at sizes at which its text can be read."""
    width = float(re.findall(r'viewBox="0 0 ([\d.]+)', picture.svg)[0])
    svg = inline_svg(picture, COLOURS)
    size = f"max-width:{width * ENLARGED:.0f}px;min-width:{width:.0f}px"
    return Markup(svg.replace("<svg ", f'<svg style="{size}" ', 1))


def kind(block: object) -> str:
    """Return what a block of a part is: ``text``, ``picture`` or ``table``."""
    return "picture" if isinstance(block, Picture) else "table" if isinstance(block, Table) else "text"


def prose(text: str) -> str:
    """Make a sentence harmless in markdown; what stands in backquotes stays code."""
    pieces = text.split("`")
    return "".join(code(piece) if i % 2 else _plain_piece(piece) for i, piece in enumerate(pieces)).strip()


def _plain_piece(text: str) -> str:
    # `plain` joins words and drops the spaces at the ends, where code may follow
    return " " * text[:1].isspace() + plain(text) + " " * text[-1:].isspace()


def html_prose(text: str) -> Markup:
    """Escape a sentence for the page; what stands in backquotes becomes code."""
    pieces = text.split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(piece) if i % 2 else html_cell(piece)
        for i, piece in enumerate(pieces)
    )


def html_cell(text: str) -> Markup:
    """Escape a text and set ``3.4e-15`` as a power of ten."""
    return Markup(MINUS.sub("−", POWER.sub(_power, str(escape(text)))))


def markdown_cell(text: str) -> str:
    """Return a table cell for markdown, calls of methods as code."""
    return code(text) if CALL.fullmatch(text) else plain(text)


CALL = re.compile(r"\w+\(.*\)")
POWER = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?)e(-?\d+)(?![\w.]*\w)")


MINUS = re.compile(r"(?<![\w.=(])-(?=\d)")


def _power(match: re.Match[str]) -> str:
    mantissa, exponent = match[1].replace("-", "−"), str(int(match[2])).replace("-", "−")
    front = mantissa.removesuffix("1") if mantissa in ("1", "−1") else f"{mantissa}·"
    return f'<span class="power">{front}10<sup>{exponent}</sup></span>'


def _values(parts: Sequence[Part], command: str) -> Mapping[str, Any]:
    claims = [claim for part in parts for claim in part.claims]
    return {
        "title": TITLE,
        "lead": LEAD,
        "paper": PAPER,
        "parts": parts,
        "command": command,
        "verdicts": VERDICTS,
        "counts": {key: sum(claim.verdict == key for claim in claims) for key in VERDICTS},
        "total": len(claims),
    }
