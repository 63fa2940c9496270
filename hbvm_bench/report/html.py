"""A document as self-contained pages: no request leaves them."""

import base64
import gzip
import hashlib
import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files

import msgspec
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.markers import MarkerStyle
from matplotlib.transforms import Affine2D

from hbvm_bench.measure.metrics import Metric
from hbvm_bench.report.document import VERDICTS, Block, CaseTable, Document, Links, Section, is_call, pieces
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.figures.style import DARK_NEUTRALS, NEUTRALS, Look
from hbvm_bench.summaries.points import family_of
from hbvm_bench.summaries.rows import Cell, Row, seconds

HERE = "hbvm_bench.report"
PLACE = "problem-"  # how the anchors of the sections of problems begin
SCRIPTS = ("script.js", "table.js", "figures.js")
TOGETHER, ONE_PAGE = 4, 100  # problems and rows; with more of both each problem has a page of its own
INLINE = 150_000  # characters of drawings in the text of a page; a script unpacks the others
FITTING = 9  # columns of metrics in a window of 1280 pixels; of more, these wait behind a switch
MINOR = ("compile_seconds", "observable_end")
DIGITS = 16  # of a double: a bar of this many digits is full
ENLARGED = 1.72  # pixels per point: a figure of a whole line fills the page's column
LEAST = 0.85  # pixels per point below which a drawing is scrolled rather than made smaller

POWER = re.compile(r"(?<![\w.=])(-?\d+(?:\.\d+)?)e([+-]?\d+)(?![\w.]*\w)")
MINUS = re.compile(r"(?<![\w.=(])-(?=\d)")


@dataclass(frozen=True)
class Place:
    """Where in a page a block stands."""

    level: int  # of the next heading
    colours: Mapping[str, str]  # from the colour of a case to the name of the page's variable
    inlined: Collection[str]  # keys of the figures that stand in the text; the others are in its data
    anchors: Collection[str]  # keys of the sections that the page has

    @property
    def below(self) -> "Place":
        """The same under a heading."""
        return replace(self, level=self.level + 1)


def pages(document: Document) -> dict[str, str]:
    """Return the pages of a document by name: ``index.html``, and one for each problem of a long one."""
    sections = [
        section
        for section in document.blocks
        if isinstance(section, Section) and section.key.startswith(PLACE)
    ]
    table = next((block for block in document.walk() if isinstance(block, CaseTable)), None)
    if table is None or len(sections) <= TOGETHER or sum(map(len, _rows_by_problem(table))) <= ONE_PAGE:
        return {"index.html": page(document)}
    names = {section.key: f"{section.key}.html" for section in sections}
    contents = Section(
        "Problems",
        [Links([(section.title, section.code, names[section.key]) for section in sections])],
        "problems",
        nav="Problems",
    )
    kept = [contents if block is sections[0] else block for block in document.blocks]
    first = [_without(block, table) for block in kept if block not in sections]
    texts = {"index.html": page(replace(document, blocks=first))}
    for number, section in enumerate(sections):
        near = {"Previous problem": number - 1, "Next problem": number + 1}
        ways = {title: names[sections[i].key] for title, i in near.items() if 0 <= i < len(sections)}
        rows = replace(table, problems=[table.problems[number]])
        cases = Section("Cases", [rows], "results", nav="Cases")
        alone = replace(
            document,
            title=section.title[:1].upper() + section.title[1:],
            lead=[f"`{section.code}`"] if section.code else [],
            blocks=[cases, *section.blocks],
        )
        texts[names[section.key]] = page(alone, {document.title: "index.html", **ways})
    return texts


def _rows_by_problem(table: CaseTable) -> list[list[Row]]:
    return [[row for _, rows in problem.groups for row in rows] for problem in table.problems]


def _without(block: Block, left_out: Block) -> Block:
    """Return a block without another one that it holds."""
    if not isinstance(block, Section):
        return block
    return replace(
        block, blocks=[_without(inner, left_out) for inner in block.blocks if inner is not left_out]
    )


def page(document: Document, ways: Mapping[str, str] | None = None) -> str:
    """Return a document as HTML that asks nothing of the network and runs no script but its own.

    ``ways`` are links to other pages of the report, by their titles.
    """
    looks = document.looks
    script = "".join(text(name) for name in SCRIPTS)
    light = {f"--m{look.number}": look.light for look in looks}
    anchors = {block.key for block in document.walk() if isinstance(block, Section)}
    top = Place(2, {colour: name for name, colour in light.items()}, _within(document.pictures), anchors)
    waiting = [picture for picture in document.pictures if picture.key not in top.inlined]
    parts = {
        "nav": [block for block in document.walk() if isinstance(block, Section) and block.nav],
        "main": printed(document.blocks, top),
        "css": Markup(text("style.css")),
        "script": Markup(script),
        "scripts": Markup(_source(script)),
        "data": packed({picture_.key: str(drawing(picture_, top.colours)) for picture_ in waiting}),
        "light": variables({name: colour for colour, name in NEUTRALS.items()} | light),
        "dark": variables(DARK_NEUTRALS | {f"--m{look.number}": look.dark for look in looks}),
        "symbols": symbols(looks),
    }
    return templates().get_template("base.html.j2").render(document=document, ways=ways or {}, **parts)


def packed(drawings: Mapping[str, str]) -> str:
    """Return the drawings that are not in a page's text, packed; the same ones give the same text."""
    return base64.b64encode(gzip.compress(msgspec.json.encode(drawings), 9, mtime=0)).decode("ascii")


def printed(blocks: Sequence[Block], at: Place) -> Markup:
    """Return blocks as HTML; the macro of each is called as its class is."""
    macros = templates().get_template("blocks.html.j2").module
    return Markup("\n").join(getattr(macros, type(block).__name__)(block, at) for block in blocks)


@cache
def templates() -> Environment:
    """Return the templates, with what they call."""
    loader = PackageLoader(HERE)
    environment = Environment(
        loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined
    )
    functions = (printed, words, cell, drawing, chip, call, bar, spread, sort_key, minor_columns, family_of)
    environment.globals |= {function.__name__: function for function in functions} | {"verdicts": VERDICTS}
    return environment


def cell(text: str) -> Markup:
    """Return a cell of a table; calls are code."""
    return Markup("<code>{}</code>").format(call(text)) if is_call(text) else words(text)


def minor_columns(columns: Sequence[Metric]) -> set[str]:
    """Return the keys of the columns that the page shows on demand only."""
    return {metric.key for metric in columns} & set(MINOR) if len(columns) > FITTING else set()


def call(text: str) -> Markup:
    """Return a method's text so that lines break between its arguments only."""
    return Markup(", ").join(
        Markup('<span class="arg">{}</span>').format(argument) for argument in text.split(", ")
    )


def bar(metric: Metric, cell: Cell, row: Row) -> int | None:
    """Return how many percent of a double's digits an error leaves right; ``None`` where not an error."""
    error = metric.better == "lower" and metric.unit in ("relative", "length")
    number = row.record.result.metrics[metric.key].value
    if not error or cell.excluded or number is None:
        return None
    right = DIGITS if number == 0 else -math.log10(number)
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


def words(text: object) -> Markup:
    """Escape a text; what stands between backquotes becomes code, ``3.4e-15`` a power of ten."""
    markup = Markup("")
    for piece, is_code in pieces(text):
        plain = Markup(MINUS.sub("−", POWER.sub(_power, str(escape(piece)))))
        markup += Markup("<code>{}</code>").format(piece) if is_code else plain
    return markup


def _power(match: re.Match[str]) -> str:
    if float(match[1]) == 0.0:
        return "0"
    mantissa, exponent = match[1].replace("-", "−"), str(int(match[2])).replace("-", "−")
    front = mantissa.removesuffix("1") if mantissa in ("1", "−1") else f"{mantissa}·"
    return f'<span class="power">{front}10<sup>{exponent}</sup></span>'


def drawing(picture: Picture, colours: Mapping[str, str]) -> Markup:
    """Return the SVG of a figure in the colours of the page, at sizes at which its text can be read."""
    variables = {**NEUTRALS, **colours}
    text = re.sub(
        r"#[0-9a-f]{6}\b",
        lambda match: f"var({variables[match[0]]})" if match[0] in variables else match[0],
        picture.svg,
    )
    width, height = map(float, re.findall(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', text)[0])
    head = (
        f'<svg style="max-width:{width * ENLARGED:.0f}px;min-width:{width * LEAST:.0f}px" role="img" '
        f'aria-labelledby="{picture.key}-title {picture.key}-desc" viewBox="0 0 {width:g} {height:g}" '
        'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
    )
    # ids are unique in a file; in a page they must be unique among all its figures
    text = re.sub(r'\bid="', f'id="{picture.key}-', text)
    text = re.sub(r'(xlink:href="|url\()#', rf"\1#{picture.key}-", text)
    return Markup(re.sub(r"<svg[^>]*>", lambda _: head, text, count=1))


def chip(look: Look) -> Markup:
    """Return the marker of a case in its colour."""
    use = f'<use href="#k{look.number}"/>'
    return Markup(f'<svg class="chip k{look.number}" aria-hidden="true">{use}</svg>')


def symbols(looks: Sequence[Look]) -> Markup:
    """Return the markers once, for all rows, and the colours of the cases."""
    shapes = "".join(
        f'<symbol id="k{look.number}" viewBox="0 0 12 12"><path d="{shape(look.marker)}"/></symbol>'
        for look in looks
    )
    colours = "".join(f".k{look.number}{{color:var(--m{look.number})}}" for look in looks)
    return Markup(f'<style>{colours}</style><svg class="symbols" aria-hidden="true">{shapes}</svg>')


def shape(marker: str) -> str:
    """Return a marker of the figures as the path of an SVG, in a box of 12 by 12."""
    style = MarkerStyle(marker)
    path = style.get_path().transformed(style.get_transform() + Affine2D().scale(8, -8).translate(6, 6))
    lines = ("L".join(f"{x:.1f} {y:.1f}" for x, y in np.asarray(line)) for line in path.to_polygons())
    return "".join(f"M{line}z" for line in lines)


def variables(colours: Mapping[str, str]) -> Markup:
    """Return the colours of a theme as variables of the page."""
    return Markup("".join(f"{name}:{value};" for name, value in colours.items()))


def text(name: str) -> str:
    """Return one of the files that every page carries."""
    return (files(HERE) / "templates" / name).read_text(encoding="utf-8")


def _source(script: str) -> str:
    """Return what lets a browser run exactly this script; no other that stands in the page runs."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def _within(pictures: Sequence[Picture]) -> set[str]:
    """Return the keys of the figures that stand in the text of the page; the others are in its data."""
    room, kept = INLINE, set()
    for picture in pictures:
        if len(picture.svg) <= room:
            room -= len(picture.svg)
            kept.add(picture.key)
    return kept
