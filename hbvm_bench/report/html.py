"""The report as one self-contained page: no request leaves it."""

import math
import re
from collections.abc import Sequence

from markupsafe import Markup

from hbvm_bench.measure.metrics import Metric
from hbvm_bench.report import pack, shell
from hbvm_bench.report.content import Content
from hbvm_bench.summaries.rows import Cell, Row, seconds

FEW = 3  # problems whose summaries all stand at the top
FITTING = 9  # columns of metrics in a window of 1280 pixels; of more, these wait behind a switch
MINOR = ("compile_seconds", "z_end")
DIGITS = 16  # of a double: a bar of this many digits is full


def page(content: Content) -> str:
    """Return the report as an HTML document."""
    environment = shell.environment(shell.HERE, autoescape=True)
    environment.globals |= {
        "chip": shell.chip,
        "call": call,
        "bar": bar,
        "spread": spread,
        "sort_key": sort_key,
    }
    libraries = list(dict.fromkeys(record.library for record in content.records))
    return environment.get_template("report.html.j2").render(
        c=content,
        few=len(content.sections) <= FEW,
        minor=minor(content.columns),
        libraries=libraries,
        **shell.values(
            content.pictures,
            list({look.number: look for look in content.looks.values()}.values()),
            data=pack.raw(content),
            scripts=("table.js", "motion.js"),
        ),
    )


def minor(columns: Sequence[Metric]) -> set[str]:
    """Return the keys of the columns that the page shows on demand only."""
    return {metric.key for metric in columns} & set(MINOR) if len(columns) > FITTING else set()


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
