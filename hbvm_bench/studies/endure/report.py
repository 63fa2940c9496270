"""The report of `endure`: ``README.md``, ``index.html`` and one figure, from the stored result alone."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure import drift, machine
from hbvm_bench.report import shell
from hbvm_bench.report.figures import canvas
from hbvm_bench.report.figures.canvas import Picture, drawing, log_axis, new, picture
from hbvm_bench.report.figures.plots import Axis, Panel, Plot, Trace, as_csv
from hbvm_bench.report.figures.style import INK, MUTED, Look, base_looks
from hbvm_bench.report.markdown import code, in_markdown
from hbvm_bench.store.files import write_all
from hbvm_bench.studies.endure.law import goals, lines, mean_in_words, rate_in_words
from hbvm_bench.studies.endure.runs import Endurance
from hbvm_bench.studies.race.tables import NONE
from hbvm_bench.summaries import peers
from hbvm_bench.summaries.laws import power_of
from hbvm_bench.summaries.rows import seconds
from hbvm_bench.summaries.table import Table

Array = NDArray[np.float64]

FIGURE = "figures/endure.svg"
TITLE = "Endurance: the energy of the outer Solar System"
LAW_POINTS = 40
FALLS_ON = 30  # a law is drawn over the last part of the span, from this fraction of it


def write(result: Endurance, directory: Path) -> Path:
    """Write the report and return its path.

    Raises
    ------
    problems.errors.InputError
        If the directory cannot be written.
    """
    look = base_looks(result.methods)
    made = over_time(result, look)
    shown = [*tables(result), *filter(None, [peers.kept()])]
    content = {"result": result, "run": result.run, "tables": shown, "picture": made, "figure": FIGURE}
    content["processor"] = machine.sentence(result.run.machine)
    environment = shell.environment("hbvm_bench.studies.endure", autoescape=False)
    environment.filters |= {"code": code, "table": in_markdown}
    files = {"README.md": environment.get_template("endure.md.j2").render(**content).encode()}
    pictures = [made] if made is not None else []
    page = shell.environment("hbvm_bench.studies.endure", autoescape=True).get_template("endure.html.j2")
    data = {"csv": as_csv(made.plot)} if made is not None and made.plot is not None else {}
    more = shell.values(pictures, list(look.values()), data=data)
    files["index.html"] = page.render(title=TITLE, **content, **more).encode()
    files |= canvas.files(pictures)
    write_all({directory / name: text for name, text in files.items()})
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
                NONE if law is None else drift.LAWS[law.law] if law.law else law.why,
                NONE if law is None or not law.law else power_of(law),
                NONE if law is None or law.mean is None else mean_in_words(law),
                NONE if law is None or law.rate is None else rate_in_words(law),
                NONE if line.seconds is None else seconds(line.seconds),
                NONE if line.times_ours is None else f"{line.times_ours:.3g}",
            )
        )
    heads = tuple(f"rms at {year:g} yr" for year in years)
    after = ("law", "power of t", "mean at the end", "drift per year", "time", "× ours")
    made = [
        Table(
            f"Relative energy error over {result.years:g} years",
            ("method", "starts", *heads, *after),
            rows,
            "rms over the starts. Mean at the end: over the starts, with its standard error, after the "
            "offset of each has been taken off. "
            + (f"{drift.told(result.starts)}, whatever the power of t. " if result.starts > 1 else "")
            + "Power of t and drift per year with 95 % "
            "intervals over the starts. Time: median of one trajectory.",
            words=(0, 2 + len(heads)),
        )
    ]
    asked = goals(result)
    if asked:
        made.append(
            Table(
                "Goals declared before the run",
                ("goal", "measured", "verdict"),
                [(goal.words, goal.measured, "reached" if goal.reached else "missed") for goal in asked],
                words=(0, 1, 2),
            )
        )
    return made


def over_time(result: Endurance, look: Mapping[str, Look]) -> Picture | None:
    """Draw the rms over the starts against time, with every start behind it; ``None`` without any."""
    t = result.t
    shown = [(method, errors) for method, errors in result.errors.items() if errors.size]
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
        for method, errors in shown:
            colour, dash = look[method].light, look[method].dash
            for row in np.abs(errors):
                axes.plot(t, np.where(row > 0.0, row, np.nan), color=colour, linewidth=0.4, alpha=0.18)
            axes.plot(
                t,
                drift.rms(errors),
                color=colour,
                dashes=dash or (None, None),
                marker=look[method].marker,
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
        axes.legend(loc="upper left", handlelength=4.5)
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
        Plot([_panel(result, shown, look)]),
    )


def _panel(result: Endurance, shown: Sequence[tuple[str, Array]], look: Mapping[str, Look]) -> Panel:
    t = result.t
    found = {line.method: line.drift for line in lines(result)}
    traces = []
    for method, errors in shown:
        rms = drift.rms(errors)
        traces.append(Trace(look[method].number, method, t, np.where(rms > 0.0, rms, np.nan)))
        law = found[method]
        if law is not None and law.law is not None:
            at = np.geomspace(t[-1] / FALLS_ON, t[-1], LAW_POINTS)
            traces.append(
                Trace(look[method].number, method, at, drift.curve(law, at), "law", drift.LAWS[law.law])
            )
    return Panel(
        "relative energy error, root mean square over the starts",
        Axis("years", log=True, both=True),
        Axis("rms of the relative energy error", log=True),
        traces,
    )
