"""The report as one self-contained page: no request leaves it."""

import math
import re
from collections.abc import Sequence
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from hbvm_bench.metrics import Metric
from hbvm_bench.report import pack
from hbvm_bench.report.canvas import Picture, inline_svg
from hbvm_bench.report.content import Content
from hbvm_bench.report.style import DARK_NEUTRALS, NEUTRALS, Look
from hbvm_bench.table import Cell, Row, seconds

FEW = 3  # problems whose summaries all stand at the top
INLINE = 1_000_000  # characters of drawings in a page; what is more would make it slow to open
FITTING = 9  # columns of metrics in a window of 1280 pixels; of more, these wait behind a switch
MINOR = ("compile_seconds", "z_end")
DIGITS = 16  # of a double: a bar of this many digits is full

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


def page(content: Content) -> str:
    """Return the report as an HTML document."""
    environment = Environment(
        loader=PackageLoader("hbvm_bench.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    colours = {look.light: f"--m{look.number}" for look in _looks(content)}
    environment.globals |= {
        "figure": lambda picture: figure(picture, colours),
        "chip": chip,
        "call": call,
        "bar": bar,
        "spread": spread,
        "sort_key": sort_key,
        "key": key,
    }
    libraries = list(dict.fromkeys(record.library for record in content.records))
    return environment.get_template("report.html.j2").render(
        c=content,
        few=len(content.sections) <= FEW,
        inlined=inlined(content),
        minor=minor(content.columns),
        keys=_looks(content),
        symbols=symbols(_looks(content)),
        libraries=libraries,
        css=Markup(_text("style.css")),
        script=Markup(_text("script.js") + _text("table.js") + _text("motion.js") + _text("explore.js")),
        data=Markup(pack.page_data(content)),
        library=Markup(pack.library()),
        light=_variables(
            {v: k for k, v in NEUTRALS.items()}, {f"--m{x.number}": x.light for x in _looks(content)}
        ),
        dark=_variables(DARK_NEUTRALS, {f"--m{x.number}": x.dark for x in _looks(content)}),
    )


def minor(columns: Sequence[Metric]) -> set[str]:
    """Return the keys of the columns that the page shows on demand only."""
    return {metric.key for metric in columns} & set(MINOR) if len(columns) > FITTING else set()


def inlined(content: Content) -> set[str]:
    """Return the keys of the figures that stand in the page itself; the others are beside it."""
    room, kept = INLINE, set()
    for picture in content.pictures:
        if len(picture.svg) <= room:
            room -= len(picture.svg)
            kept.add(picture.key)
    return kept


def figure(picture: Picture, colours: dict[str, str]) -> Markup:
    """Return the drawing of a figure for the page; all text in it is escaped already."""
    return Markup(inline_svg(picture, colours))


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


def _marker(look: Look) -> int:
    return list(MARKERS).index(look.marker)


def call(text: str) -> Markup:
    """Return a method's text so that lines break between its arguments only."""
    pieces = [Markup('<span class="arg">{}</span>').format(piece) for piece in text.split(", ")]
    return Markup(", ").join(pieces)


def bar(metric: Metric, cell: Cell, row: Row) -> int | None:
    """Return how many percent of a double's digits an error leaves right; ``None`` where not an error."""
    value = row.record.result.metrics.get(metric.key)
    if metric.better != "lower" or metric.unit not in ("relative", "length") or cell.void:
        return None
    if value is None or value.value is None:
        return None
    right = DIGITS if value.value == 0 else -math.log10(value.value)
    return round(100 * min(max(right / DIGITS, 0.0), 1.0))


def spread(metric: Metric, row: Row) -> str:
    """Return the quartiles of a timing, or whether a compilation came from a cache."""
    timing = row.record.timing
    if timing is None or not timing.samples:
        return ""
    if metric.key == "warm_seconds":
        s = timing.summary
        return f"{seconds(s['q1'])} – {seconds(s['q3'])}"
    if metric.key == "compile_seconds" and timing.compile is not None and timing.compile.cached is not None:
        return "from cache" if timing.compile.cached else "cold"
    return ""


def sort_key(cell: Cell | None) -> Markup:
    """Return the attribute that the page's script sorts by, where the text itself is not the number."""
    if cell is None or math.isinf(cell.sort) or re.fullmatch(r"[\d.e+-]+", cell.text):
        return Markup("")
    return Markup(' data-v="{}"').format(repr(cell.sort))


def _looks(content: Content) -> list[Look]:
    return list({look.number: look for look in content.looks.values()}.values())


def _variables(*groups: dict[str, str]) -> Markup:
    return Markup("".join(f"{name}:{value};" for group in groups for name, value in group.items()))


def _text(name: str) -> str:
    return (files("hbvm_bench.report") / "templates" / name).read_text(encoding="utf-8")
