"""Formulas as drawings inside the page: no script and no font from elsewhere, alike in every browser."""

import re
from typing import Any
from xml.etree import ElementTree

import ziamath
from docutils import nodes
from sphinx.application import Sphinx
from ziamath.nodes import msubsup

SIZE = 18  # pixels of the formula's em; the page's text has 16
SUM = re.compile(r"(\\sum(?:[_^](?:\{[^{}]*\}|\w))*) *")  # with its limits, which may be wider than the sign
KERN = 0.35  # part of the library's kerning of subscripts that is left

ziamath.config.math.color = "currentColor"  # light on dark pages

_place_subscript = msubsup.place_sub


def _spaced(base: Any, subscript: Any, font: Any) -> tuple[float, float, float]:
    """Place a letter's subscript, moved under the letter by a part of what the library does.

    It moves the j of P_j by half an em to the left, into the stem of the P, and what follows as well.
    """
    x, y, advance = _place_subscript(base, subscript, font)
    if base.mtag != "mi" or base.params.get("movablelimits") == "true" or x >= 0.0:
        return x, y, advance
    return KERN * x, y, advance - (1.0 - KERN) * x


msubsup.place_sub = _spaced


def _drawn(latex: str, *, inline: bool) -> str:
    formula = ziamath.Latex(SUM.sub(r"\1\\,", latex), size=SIZE, inline=inline)
    drawing = formula.svgxml()
    drawing.set("role", "img")
    drawing.set("aria-label", latex)
    if inline:
        drawing.set("style", f"vertical-align: {formula.getyofst():.2f}px")
    return ElementTree.tostring(drawing, encoding="unicode")


def _inline(self: Any, node: nodes.math) -> None:
    self.body.append(f'<span class="math">{_drawn(node.astext(), inline=True)}</span>')
    raise nodes.SkipNode


def _block(self: Any, node: nodes.math_block) -> None:
    latex = node.astext()
    if "\\\\" in latex:  # several lines
        latex = rf"\begin{{aligned}}{latex}\end{{aligned}}"
    self.body.append(f'<div class="math" tabindex="0">{_drawn(latex, inline=False)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register how Sphinx's HTML pages print both kinds of formulas."""
    app.add_html_math_renderer("drawn", inline_renderers=(_inline, None), block_renderers=(_block, None))
    app.config.html_math_renderer = "drawn"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
