"""A document as one self-contained page: no request leaves it."""

import base64
import hashlib
import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import singledispatch
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from plotly.offline import get_plotlyjs

from hbvm_bench.measure.metrics import Metric
from hbvm_bench.report import pack
from hbvm_bench.report.document import (
    VERDICTS,
    Block,
    Claims,
    Commands,
    Details,
    Document,
    Failed,
    Files,
    Items,
    Note,
    Notice,
    Ranked,
    Results,
    Section,
    is_call,
    pieces,
)
from hbvm_bench.report.figures.canvas import Picture, inline_svg
from hbvm_bench.report.figures.style import DARK_NEUTRALS, NEUTRALS, Look
from hbvm_bench.summaries.rows import Cell, Row, seconds
from hbvm_bench.summaries.table import Table

HERE = "hbvm_bench.report"
SCRIPTS = ("script.js", "table.js", "motion.js", "explore.js")
INLINE = 1_000_000  # characters of drawings in a page; what is more would make it slow to open
FITTING = 9  # columns of metrics in a window of 1280 pixels; of more, these wait behind a switch
MINOR = ("compile_seconds", "z_end")
DIGITS = 16  # of a double: a bar of this many digits is full
OUTCOMES = {"on": "on the trajectory", "off": "on another one", "ended": "not to the end"}
ENLARGED = 1.72  # pixels per point: a figure of a whole line fills the page's column
LEAST = 1.3  # pixels per point below which a drawing is scrolled rather than made smaller

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

POWER = re.compile(r"(?<![\w.=])(-?\d+(?:\.\d+)?)e([+-]?\d+)(?![\w.]*\w)")
MINUS = re.compile(r"(?<![\w.=(])-(?=\d)")


@dataclass(frozen=True)
class Place:
    """Where in a page a block stands.

    Attributes
    ----------
    level : int
        Of the next heading.
    colours : mapping of str to str
        From the colour of a case to the name of the page's variable.
    inlined : collection of str
        Keys of the figures that stand in the page itself; the others are beside it.
    """

    level: int
    colours: Mapping[str, str]
    inlined: Collection[str]


def page(document: Document) -> str:
    """Return a document as HTML that asks nothing of the network and runs no script but its own."""
    looks = document.looks
    script = "".join(text(name) for name in SCRIPTS)
    environment = Environment(
        loader=PackageLoader(HERE),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    return environment.get_template("base.html.j2").render(
        document=document,
        title=words(document.title),
        lead=[words(paragraph) for paragraph in document.lead],
        nav=[block for block in document.walk() if isinstance(block, Section) and block.nav],
        main=_joined(
            document.blocks, Place(2, {x.light: f"--m{x.number}" for x in looks}, _within(document.pictures))
        ),
        css=Markup(text("style.css")),
        script=Markup(script),
        scripts=Markup(f"{_source(script)} {_source(get_plotlyjs())}"),
        data=Markup(pack.data(document)),
        library=Markup(pack.library()),
        light=variables({v: k for k, v in NEUTRALS.items()}, {f"--m{x.number}": x.light for x in looks}),
        dark=variables(DARK_NEUTRALS, {f"--m{x.number}": x.dark for x in looks}),
        keys=[(look.number, key(look)) for look in looks],
        symbols=symbols(looks),
    )


@singledispatch
def printed(block: Block, at: Place) -> Markup:
    """Return a block as HTML."""
    raise TypeError(f"{type(block).__name__} is no block of a document.")


@printed.register
def _(block: str, at: Place) -> Markup:
    return Markup('<p class="text">{}</p>').format(words(block))


@printed.register
def _(block: Note, at: Place) -> Markup:
    return Markup('<p class="note">{}</p>').format(words(block.text))


@printed.register
def _(block: Notice, at: Place) -> Markup:
    head, said = words(block.head), words(block.text)
    return Markup('<p class="missing" role="note"><b>{}</b> {}</p>').format(head, said)


@printed.register
def _(block: Failed, at: Place) -> Markup:
    return printed(Notice(f"Not made: {block.title}.", block.reason), at)


@printed.register
def _(block: Items, at: Place) -> Markup:
    items = Markup("").join(Markup("<li>{}</li>").format(words(item)) for item in block.items)
    if block.kind == "numbered":
        return Markup("<ol>{}</ol>").format(items)
    return Markup("<ul{}>{}</ul>").format(_class("summary" if block.kind == "cards" else ""), items)


@printed.register
def _(block: Commands, at: Place) -> Markup:
    form = Markup('<pre tabindex="0" role="region" aria-label="Command"><code>{}</code></pre>')
    return form.format(block.text)


@printed.register
def _(block: Files, at: Place) -> Markup:
    links = [
        Markup('<a href="{0}" download="{1}"{2}>{1}</a>').format(
            path,
            path.split("/")[-1],
            Markup("") if data is None else Markup(' data-save="{}"').format(path.split(".")[-1]),
        )
        for path, data in block.files.items()
    ]
    return Markup('<p class="text">{}: {}.</p>').format(words(block.text), Markup(", ").join(links))


@printed.register
def _(block: Details, at: Place) -> Markup:
    form = Markup("<details{}>\n<summary>{}</summary>\n{}\n</details>")
    return form.format(Markup(" open" * block.open), words(block.summary), _joined(block.blocks, at))


@printed.register
def _(block: Section, at: Place) -> Markup:
    code = Markup(" <code>{}</code>").format(block.code) if block.code else ""
    form = Markup('<section aria-labelledby="{0}">\n<h{1} id="{0}">{2}{3}</h{1}>\n{4}\n</section>')
    inner = _joined(block.blocks, replace(at, level=at.level + 1))
    return form.format(block.key, at.level, words(block.title), code, inner)


@printed.register
def _(block: Table, at: Place) -> Markup:
    """Return a table with its note; what a number's cell has in brackets is set small."""
    over = Markup("").join(
        Markup('<th{} colspan="{}">{}</th>').format(
            Markup(' scope="colgroup"' * bool(label)), width, words(label)
        )
        for label, width in block.groups
    )
    head = Markup("").join(
        Markup('<th scope="col"{}>{}</th>').format(_class("" if i in block.words else "num"), words(label))
        for i, label in enumerate(block.head)
    )
    rows = Markup("\n").join(
        Markup("<tr>{}</tr>").format(
            Markup("").join(_table_cell(cell, i, i in block.words) for i, cell in enumerate(row))
        )
        for row in block.rows
    )
    save = Markup(' <a href="data/{0}.csv" download="{0}.csv">CSV</a>').format(block.key) if block.key else ""
    return Markup(
        '<div class="scroll table {}" tabindex="0" role="region" aria-label="{}">\n<table class="words">\n'
        "{}<thead>{}<tr>{}</tr></thead>\n<tbody>\n{}\n</tbody>\n</table>\n</div>\n{}"
    ).format(
        block.key,
        block.title or block.head[0],
        Markup("<caption>{}</caption>").format(words(block.title)) if block.title else "",
        Markup('<tr class="over">{}</tr>').format(over) if over else "",
        head,
        rows,
        Markup('<p class="note">{}{}</p>').format(words(block.note), save) if block.note or save else "",
    )


def _table_cell(cell: str, column: int, is_words: bool) -> Markup:
    if not is_words:
        number, bracket, rest = cell.partition(" (")
        small = Markup(" <small>({}</small>").format(words(rest)) if bracket else ""
        return Markup('<td class="num">{}{}</td>').format(words(number), small)
    inner = Markup("<code>{}</code>").format(call(cell)) if is_call(cell) else words(cell)
    return Markup('<th scope="row">{}</th>' if column == 0 else "<td>{}</td>").format(inner)


@printed.register
def _(block: Picture, at: Place) -> Markup:
    """Return a figure with its summary, its drawing, its table of numbers and its files."""
    key, title, plot = block.key, words(block.title), block.plot is not None
    beside = Markup(
        '<p class="note">This picture is beside the page, in <a href="figures/{0}.svg">figures/{0}.svg</a>; '
        "Explore draws it here.</p>"
    ).format(key)
    drawn = key in at.inlined
    region = Markup(' tabindex="0" role="region" aria-label="{}"').format(block.title) if drawn else ""
    return Markup(
        '<figure id="{key}"{plot}>\n<div class="figure-head">\n'
        '<h3 id="{key}-title">{title}</h3>\n{views}</div>\n'
        '<p class="sr" id="{key}-desc">{summary}</p>\n'
        '<div class="scroll picture{values}"{region}>{drawing}</div>\n<div class="plot" hidden></div>\n'
        '<figcaption>{caption} <span class="save">Save: {files}</span></figcaption>\n{numbers}</figure>'
    ).format(
        key=key,
        plot=Markup(' data-plot="{}"').format(key) if plot else "",
        title=title,
        views=VIEWS if plot else "",
        summary=block.summary,
        values=" values" if block.values else "",
        region=region,
        drawing=drawing(block, at.colours) if drawn else beside,
        caption=words(block.caption),
        files=Markup(" ").join(
            Markup('<a href="{0}/{1}.{2}" download="{1}.{2}" data-save="{3}">{4}</a>').format(
                folder, key, ending, what, label
            )
            for folder, ending, what, label in (
                ("figures", "svg", "svg", "SVG"),
                ("figures", "png", "png", "PNG"),
                *([("data", "csv", "numbers", "its data (CSV)")] if plot else []),
            )
        ),
        numbers=NUMBERS if plot else "",
    )


VIEWS = Markup(
    '<span class="views" role="group" aria-label="How to see it" hidden>\n'
    '<button type="button" data-view="picture" aria-pressed="true">Picture</button>'
    '<button type="button" data-view="explore" aria-pressed="false">Explore</button>\n</span>\n'
)
NUMBERS = Markup('<details class="numbers" hidden><summary>Table of its numbers</summary></details>\n')


@printed.register
def _(block: Claims, at: Place) -> Markup:
    """Return how many claims have which verdict, and the table of all."""
    found = [claim.verdict for _, _, claims in block.groups for claim in claims]
    counts = Markup("").join(
        Markup('<li class="{}"><b>{}</b><span>{}</span></li>').format(key, found.count(key), said)
        for key, said in VERDICTS.items()
    )
    bodies = Markup("\n").join(
        Markup(
            '<tbody>\n<tr class="group"><th scope="rowgroup" colspan="4"><span><a href="#{}">{}</a></span>'
            "</th></tr>\n{}\n</tbody>"
        ).format(
            anchor,
            words(title),
            Markup("\n").join(
                Markup(
                    '<tr><th scope="row">{}</th><td class="paper">{}</td><td>{}</td>'
                    '<td class="verdict"><i class="{}">{}</i></td></tr>'
                ).format(words(c.words), words(c.paper), words(c.here), c.verdict, VERDICTS[c.verdict])
                for c in claims
            ),
        )
        for title, anchor, claims in block.groups
    )
    head = Markup("").join(
        Markup('<th scope="col">{}</th>').format(label) for label in ("claim", "paper", "here", "verdict")
    )
    return Markup(
        '<ul class="counts" aria-label="{} claims">{}</ul>\n'
        '<div class="scroll" tabindex="0" role="region" aria-label="Claims">\n'
        '<table class="claims">\n<thead><tr>{}</tr></thead>\n{}\n</table>\n</div>'
    ).format(len(found), counts, head, bodies)


@printed.register
def _(block: Results, at: Place) -> Markup:
    """Return the form that filters the rows, and the table of all problems, which sorts."""
    minor = {m.key for m in block.columns} & set(MINOR) if len(block.columns) > FITTING else set[str]()
    several = len(block.problems) > 1
    bodies = [
        _group(block, number, problem, title, rows, minor, several=several)
        for number, problem in enumerate(block.problems, 1)
        for title, rows in problem.groups
    ]
    heads = Markup("").join(
        Markup('<th scope="col"{} title="{}" data-sort>{}</th>').format(
            _class("num", "minor" if m.key in minor else ""), m.description, m.short
        )
        for m in block.columns
    )
    return Markup(
        '{}\n<div class="scroll table" tabindex="0" role="region" aria-label="Results">\n'
        '<table class="results">\n'
        '<caption class="sr">Every case is a row. Numbers in brackets are void.</caption>\n<thead><tr>'
        '<th scope="col" class="num" data-sort><span class="sr">number</span>#</th>'
        '<th scope="col" class="method" data-sort="text">method</th>{}</tr></thead>\n{}\n</table>\n</div>\n'
        '<p class="note">Sorted by the position error at the end; a click on a head sorts within the '
        "groups. The bar under an error is the number of digits it leaves right, of a double's 16. Brackets: "
        "void, for the row is another trajectory, or only a part of the one asked for. Times are medians "
        "over all rounds with their quartiles.</p>"
    ).format(_filter(block, bool(minor)), heads, Markup("\n").join(bodies))


def _filter(block: Results, minor: bool) -> Markup:
    rows = [row for problem in block.problems for _, rows in problem.groups for row in rows]
    libraries = dict.fromkeys(row.record.library for row in rows)
    problems = Markup("").join(
        Markup('<option value="{}">{}: {}</option>').format(i, problem.title, problem.problem)
        for i, problem in enumerate(block.problems, 1)
    )
    boxes = Markup("\n").join(
        Markup('<label><input type="checkbox" name="group" value="{}" checked> {}</label>').format(key, said)
        for key, said in OUTCOMES.items()
    )
    return Markup(
        '<form id="filter" hidden>\n<label>Find <input type="search" name="words" autocomplete="off" '
        'placeholder="method, remark, status"></label>\n{}'
        '<label>Library <select name="library"><option value="">all</option>{}</select></label>\n'
        '<span class="boxes" role="group" aria-label="How it ended">\n{}\n</span>\n{}'
        '<button type="reset">Clear</button>\n<output aria-live="polite"></output>\n</form>'
    ).format(
        Markup(
            '<label>Problem <select name="problem"><option value="">all</option>{}</select></label>\n'
        ).format(problems)
        if len(block.problems) > 1
        else "",
        Markup("").join(Markup("<option>{}</option>").format(library) for library in libraries),
        boxes,
        Markup('<label><input type="checkbox" name="all"> all columns</label>\n') if minor else "",
    )


def _group(
    block: Results,
    number: int,
    problem: Ranked,
    title: str,
    rows: Sequence[Row],
    minor: set[str],
    *,
    several: bool,
) -> Markup:
    before = Markup('<a href="#problem-{}">{}</a> <code>{}</code> – ').format(
        number, problem.title, problem.problem
    )
    lines = Markup("\n").join(_line(block, number, row, minor) for row in rows)
    return Markup(
        '<tbody data-problem="{}" data-group="{}">\n<tr class="group"><th scope="rowgroup" colspan="{}">'
        "<span>{}{}</span></th></tr>\n{}\n</tbody>"
    ).format(number, rows[0].group, len(block.columns) + 2, before if several else "", title, lines)


def _line(block: Results, number: int, row: Row, minor: set[str]) -> Markup:
    record, look = row.record, block.looks[row.record.case.method]
    remark = f" {row.remark}." if row.remark else ""
    cells = Markup("").join(_cell(metric, row, metric.key in minor) for metric in block.columns)
    return Markup(
        '<tr id="case-{}-{}" class="{} {}" data-library="{}"><td class="id">{}</td>'
        '<th scope="row" class="method">{}<code>{}</code><span class="remark">'
        '<span class="settings">{}</span>{}</span></th>{}</tr>'
    ).format(
        number, record.id[:12], record.role, row.group, record.library, look.number,
        chip(look), call(record.case.method), record.case.settings, remark, cells,
    )  # fmt: skip


def _cell(metric: Metric, row: Row, minor: bool) -> Markup:
    cell = row.cells.get(metric.key)
    kinds = _class("void" if cell and cell.void else "", "minor" if minor else "")
    if cell is None:
        return Markup("<td{}>–</td>").format(kinds)
    if cell.void:
        return Markup('<td{}{}>({})<span class="sr"> void</span></td>').format(
            kinds, sort_key(cell), cell.text
        )
    width, extra = bar(metric, cell, row), spread(metric, row)
    return Markup("<td{}{}{}>{}{}{}</td>").format(
        kinds,
        sort_key(cell),
        Markup(' title="{}"').format(cell.why) if cell.why else "",
        cell.text,
        "" if width is None else Markup('<i style="--w:{}%"></i>').format(width),
        Markup("<small>{}</small>").format(extra) if extra else "",
    )


def call(text: str) -> Markup:
    """Return a method's text so that lines break between its arguments only."""
    return Markup(", ").join(Markup('<span class="arg">{}</span>').format(one) for one in text.split(", "))


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


def sort_key(cell: Cell) -> Markup:
    """Return the attribute that the page's script sorts by, where the text itself is not the number."""
    if math.isinf(cell.sort) or re.fullmatch(r"[\d.e+-]+", cell.text):
        return Markup("")
    return Markup(' data-v="{}"').format(repr(cell.sort))


def words(text: object) -> Markup:
    """Escape a text; what stands between backquotes becomes code, ``3.4e-15`` a power of ten."""
    return Markup("").join(
        Markup("<code>{}</code>").format(piece) if is_code else typeset(piece)
        for piece, is_code in pieces(text)
    )


def typeset(text: str) -> Markup:
    """Escape a text and set ``3.4e-15`` as a power of ten."""
    return Markup(MINUS.sub("−", POWER.sub(_power, str(escape(text)))))


def _power(match: re.Match[str]) -> str:
    if float(match[1]) == 0.0:
        return "0"
    mantissa, exponent = match[1].replace("-", "−"), str(int(match[2])).replace("-", "−")
    front = mantissa.removesuffix("1") if mantissa in ("1", "−1") else f"{mantissa}·"
    return f'<span class="power">{front}10<sup>{exponent}</sup></span>'


def drawing(picture: Picture, colours: Mapping[str, str]) -> Markup:
    """Return the SVG of a figure for the page, at sizes at which its text can be read."""
    width = float(re.findall(r'viewBox="0 0 ([\d.]+)', picture.svg)[0])
    size = f"max-width:{width * ENLARGED:.0f}px;min-width:{width * LEAST:.0f}px"
    return Markup(inline_svg(picture, colours).replace("<svg ", f'<svg style="{size}" ', 1))


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


def text(name: str) -> str:
    """Return one of the files that every page carries."""
    return (files(HERE) / "templates" / name).read_text(encoding="utf-8")


def _joined(blocks: Sequence[Block], at: Place) -> Markup:
    return Markup("\n").join(printed(block, at) for block in blocks)


def _class(*names: str) -> Markup:
    given = " ".join(name for name in names if name)
    return Markup(' class="{}"').format(given) if given else Markup("")


def _source(script: str) -> str:
    """Return what lets a browser run exactly this script; no other that stands in the page runs."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def _within(pictures: Sequence[Picture]) -> set[str]:
    """Return the keys of the figures that stand in the page itself; the others are beside it."""
    room, kept = INLINE, set()
    for picture in pictures:
        if len(picture.svg) <= room:
            room -= len(picture.svg)
            kept.add(picture.key)
    return kept


def _marker(look: Look) -> int:
    return list(MARKERS).index(look.marker)
