"""What every page shares: one style, one theme button, the figures' interaction, downloads and tables."""

import base64
import hashlib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from hbvm_bench.report import pack
from hbvm_bench.report.figures.canvas import Picture, inline_svg
from hbvm_bench.report.figures.style import DARK_NEUTRALS, NEUTRALS, Look
from hbvm_bench.report.markdown import block, plain

HERE = "hbvm_bench.report"
INLINE = 1_000_000  # characters of drawings in a page; what is more would make it slow to open

# Paths of the markers in a box of 12 by 12, as the figures draw them.
MARKERS = {
    "o": '<circle cx="6" cy="6" r="4.2"/>',
    "d": '<path d="M6 1 9.2 6 6 11 2.8 6z"/>',
    "8": '<path d="M4.1 1.4h3.8l2.7 2.7v3.8l-2.7 2.7H4.1L1.4 7.9V4.1z"/>',
    "D": '<path d="M6 1 11 6 6 11 1 6z"/>',
    "s": '<path d="M2 2h8v8H2z"/>',
    "^": '<path d="M6 1.5 10.8 10H1.2z"/>',
    "v": '<path d="M6 10.5 10.8 2H1.2z"/>',
    "P": '<path d="M4.3 1h3.4v3.3H11v3.4H7.7V11H4.3V7.7H1V4.3h3.3z"/>',
    "X": '<path d="M3.2 1 6 3.8 8.8 1 11 3.2 8.2 6 11 8.8 8.8 11 6 8.2 3.2 11 1 8.8 3.8 6 1 3.2z"/>',
    "<": '<path d="M1.5 6 10 1.2v9.6z"/>',
    ">": '<path d="M10.5 6 2 1.2v9.6z"/>',
    "p": '<path d="M6 1 11 4.8 9 10.6H3L1 4.8z"/>',
    "h": '<path d="M6 .8 10.5 3.4v5.2L6 11.2 1.5 8.6V3.4z"/>',
    "H": '<path d="M3.4 1.5h5.2L11.2 6 8.6 10.5H3.4L.8 6z"/>',
    "*": '<path d="M6 .8 7.4 4.4 11.2 4.6 8.2 7 9.3 10.8 6 8.6 2.7 10.8 3.8 7 .8 4.6 4.6 4.4z"/>',
}


def environment(package: str, *, autoescape: bool) -> Environment:
    """Return the templates of a package, and those that all pages share."""
    made = Environment(
        loader=ChoiceLoader([PackageLoader(package), PackageLoader(HERE)]),
        autoescape=autoescape,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    made.filters |= {"plain": plain, "block": block}
    return made


def values(
    pictures: Sequence[Picture],
    looks: Sequence[Look],
    *,
    names: Mapping[int, str] | None = None,
    data: Mapping[str, Any] | None = None,
    css: str = "",
    scripts: Sequence[str] = (),
) -> dict[str, Any]:
    """Return what the shared templates need.

    Parameters
    ----------
    pictures : sequence of Picture
        All figures of the page.
    looks : sequence of Look
        Of what has a colour in them; no two have one number.
    names : mapping of int to str, optional
        What the legends call a look by its number, where that is not what its curves are called.
    data : mapping, optional
        What else the page carries: ``csv`` and ``json``, the raw data to save.
    css : str
        Style of this page alone.
    scripts : sequence of str
        Templates' names of scripts of this page alone.
    """
    colours = {look.light: f"--m{look.number}" for look in looks}
    script = "".join(text(HERE, name) for name in ("script.js", *scripts, "explore.js"))
    inlined = within(pictures)
    return {
        "drawing": lambda picture: Markup(inline_svg(picture, colours)),
        "inlined": inlined,
        "css": Markup(text(HERE, "style.css") + css),
        "script": Markup(script),
        "scripts": Markup(f"{_source(script)} {_source(get_plotlyjs())}"),
        "data": Markup(pack.figures_data(pictures, looks, names or {}, data or {})),
        "library": Markup(pack.library()),
        "light": variables({v: k for k, v in NEUTRALS.items()}, {f"--m{x.number}": x.light for x in looks}),
        "dark": variables(DARK_NEUTRALS, {f"--m{x.number}": x.dark for x in looks}),
        "keys": [(look.number, key(look)) for look in looks],
        "symbols": symbols(looks),
    }


def _source(script: str) -> str:
    """Return what lets a browser run exactly this script; no other that stands in the page runs."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def within(pictures: Sequence[Picture]) -> set[str]:
    """Return the keys of the figures that stand in the page itself; the others are beside it."""
    room, kept = INLINE, set()
    for picture in pictures:
        if len(picture.svg) <= room:
            room -= len(picture.svg)
            kept.add(picture.key)
    return kept


def chip(look: Look) -> Markup:
    """Return the marker of a case in its colour."""
    use = f'<use href="#k{_marker(look)}"/>'
    return Markup(f'<svg class="chip k{look.number}" aria-hidden="true">{use}</svg>')


def key(look: Look) -> Markup:
    """Return the line and marker of a case, for the legend of an interactive figure."""
    dashes = f' stroke-dasharray="{" ".join(f"{length:g}" for length in look.dash)}"' if look.dash else ""
    return Markup(
        f'<svg class="line k{look.number}" viewBox="0 0 40 12" width="40" height="12" aria-hidden="true">'
        f'<path d="M0 6h40" fill="none" stroke="currentColor" stroke-width="2"{dashes}/>'
        f'<use href="#k{_marker(look)}" x="14" width="12" height="12"/></svg>'
    )


def symbols(looks: Sequence[Look]) -> Markup:
    """Return the markers once, for all rows, and the colours of the cases."""
    shapes = "".join(
        f'<symbol id="k{number}" viewBox="0 0 12 12">{shape}</symbol>'
        for number, shape in enumerate(MARKERS.values())
    )
    colours = "".join(f".k{look.number}{{color:var(--m{look.number})}}" for look in looks)
    return Markup(f'<style>{colours}</style><svg class="symbols" aria-hidden="true">{shapes}</svg>')


def variables(*groups: Mapping[str, str]) -> Markup:
    """Return the colours of a theme as variables of the page."""
    return Markup("".join(f"{name}:{value};" for group in groups for name, value in group.items()))


def text(package: str, name: str) -> str:
    """Return a file of a package's templates."""
    return (files(package) / "templates" / name).read_text(encoding="utf-8")


def _marker(look: Look) -> int:
    return list(MARKERS).index(look.marker)
