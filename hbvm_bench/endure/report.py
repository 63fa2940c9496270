"""The report of `endure`: ``README.md`` and one figure, from the stored result alone."""

import math
from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from hbvm_bench import drift
from hbvm_bench.cells import Table, in_markdown
from hbvm_bench.drift import LAWS
from hbvm_bench.endure.law import goals, lines
from hbvm_bench.endure.runs import Endurance, of_method
from hbvm_bench.race.tables import NONE
from hbvm_bench.report.canvas import Picture, drawing, log_axis, new, picture
from hbvm_bench.report.markdown import code, plain
from hbvm_bench.report.style import DASHES, INK, MARKERS, MUTED, base_colours
from hbvm_bench.spec import parse_spec
from hbvm_bench.store import atomic, ensure_writable
from hbvm_bench.table import seconds

FIGURE = "endure.svg"


def write(result: Endurance, directory: Path) -> Path:
    """Write the report and return its path.

    Raises
    ------
    problems.errors.InputError
        If the directory cannot be written.
    """
    made = over_time(result)
    environment = Environment(
        loader=PackageLoader("hbvm_bench.endure", "templates"),
        autoescape=False,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters |= {"plain": plain, "code": code, "table": in_markdown}
    text = environment.get_template("endure.md.j2").render(
        result=result, tables=tables(result), picture=made, figure=FIGURE
    )
    ensure_writable(directory)
    files = {"README.md": text.encode()} | ({FIGURE: made.svg.encode()} if made is not None else {})
    for name, data in files.items():
        with atomic(directory / name) as path:
            path.write_bytes(data)
    return directory / "README.md"


def tables(result: Endurance) -> list[Table]:
    """Return the tables: the errors with their laws, and the goals."""
    found = lines(result)
    years = sorted({year for line in found for year in line.rms})
    rows = []
    for line in found:
        law = line.drift
        rows.append(
            (
                line.method,
                f"{line.starts}" + (f", {line.failed} failed" if line.failed else ""),
                *(f"{line.rms[year]:.1e}" if year in line.rms else NONE for year in years),
                NONE if law is None else LAWS[law.law] if law.law else law.why,
                NONE
                if law is None or not law.law
                else f"{law.slope:.2f} ({law.slope_low:.2f} to {law.slope_high:.2f})",
                NONE if law is None else f"{law.rate:+.1e} ({law.rate_low:+.1e} to {law.rate_high:+.1e})",
                NONE if line.seconds is None else seconds(line.seconds),
                NONE if line.times_ours is None else f"{line.times_ours:.3g}",
            )
        )
    heads = tuple(f"rms at {year:g} yr" for year in years)
    made = [
        Table(
            f"Relative energy error over {result.years:g} years",
            ("method", "starts", *heads, "law", "power of t", "drift per year", "time", "× ours"),
            rows,
            "rms over the starts. Power of t and drift with 95 % intervals over the starts. Time: median of "
            "one trajectory.",
            words=(2 + len(heads),),
        )
    ]
    asked = goals(result)
    if asked:
        made.append(
            Table(
                "Goals declared before the run",
                ("goal", "measured", "verdict"),
                [(goal.words, goal.measured, "reached" if goal.reached else "missed") for goal in asked],
                words=(1, 2),
            )
        )
    return made


def over_time(result: Endurance) -> Picture | None:
    """Draw the rms over the starts against time, with every start behind it; ``None`` without any."""
    t = np.array(result.t)
    shown = [
        (method, np.array([run.errors for run in of_method(result, method)])) for method in result.methods
    ]
    shown = [(method, errors) for method, errors in shown if errors.size]
    if not shown:
        return None
    values = np.concatenate([drift.rms(errors) for _, errors in shown])
    positive = values[values > 0.0]
    low = math.floor(math.log10(positive.min())) if positive.size else -17
    high = math.ceil(math.log10(positive.max())) if positive.size else -14
    with drawing():
        figure = new(8.4, 5.0)
        axes = figure.subplots()
        figure.subplots_adjust(left=0.08, right=0.94, top=0.94, bottom=0.1)
        log_axis(axes, "x", math.floor(math.log10(t[0])), math.ceil(math.log10(t[-1])))
        log_axis(axes, "y", low, max(high, low + 1))
        for index, (method, errors) in enumerate(shown):
            name = parse_spec(method).name
            colour = base_colours(name)[0]
            dash = DASHES[sum(parse_spec(other).name == name for other, _ in shown[:index])]
            for row in np.abs(errors):
                axes.plot(t, np.where(row > 0.0, row, np.nan), color=colour, linewidth=0.4, alpha=0.18)
            axes.plot(
                t,
                drift.rms(errors),
                color=colour,
                dashes=dash or (None, None),
                marker=MARKERS.get(name, "*"),
                markevery=24,
                markersize=5,
                linewidth=1.6,
                label=method,
            )
        guide = t[t >= t[-1] / 1e3]
        axes.plot(guide, 10.0 ** (low + 0.4) * np.sqrt(guide / guide[0]), color=MUTED, linewidth=0.8)
        axes.annotate(" √t", (guide[-1], 10.0 ** (low + 0.4) * math.sqrt(guide[-1] / guide[0])), color=MUTED)
        axes.set_xlabel("years")
        axes.set_title("relative energy error, root mean square over the starts", color=INK)
        axes.legend(loc="upper left")
    said = "; ".join(
        f"{line.method}: {', '.join(f'{value:.1e} at {year:g} years' for year, value in line.rms.items())}"
        for line in lines(result)
    )
    return picture(
        figure,
        "endure",
        "Energy error of the outer Solar System over time",
        "Thick: root mean square over the starts; thin: every start. The grey line grows like the square "
        "root of time, as unbiased round-off does.",
        said,
    )
