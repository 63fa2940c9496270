"""The report of `endure`, from the stored result alone."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure import drift, machine
from hbvm_bench.report.document import Document, Note, attempt
from hbvm_bench.report.figures.canvas import Picture, log_axis, new, picture, styled
from hbvm_bench.report.figures.plots import Axis, Panel, Plot, Trace
from hbvm_bench.report.figures.style import MUTED, Look, looks
from hbvm_bench.report.provenance import PEERS, again
from hbvm_bench.store.records import Law
from hbvm_bench.studies.endure.runs import Endurance, goals, lines
from hbvm_bench.summaries.goals import table as goals_table
from hbvm_bench.summaries.laws import power_of
from hbvm_bench.summaries.rows import seconds
from hbvm_bench.summaries.table import NONE, Table

Array = NDArray[np.float64]

LAW_POINTS = 40
FALLS_ON = 30  # a law is drawn over the last part of the span, from this fraction of it
METHOD = """
The methods run one after the other from each start, in one process on one core. The energy is
evaluated in double-double arithmetic at whole years, log-spaced, at the methods' own steps or by means
that cost them nothing. The time of a trajectory contains these few samples and no compilation. Laws: a
floor and a growth are fitted together to the logarithm of the rms over windows of time
(`hbvm_bench.measure.drift`).
"""


def document(result: Endurance) -> Document:
    """Return the report."""
    look, run = looks(result.methods), result.run
    return Document(
        "Endurance: the energy of the outer Solar System",
        [
            "How the energy error grows with time, ours beside the peers', in one run.",
            f"`{result.problem}` from {result.starts} starts: the problem's own, and others in which every "
            f"position and momentum is changed by up to {result.perturbation} of itself "
            "(`hbvm_bench.measure.starts`).",
        ],
        [
            Note(machine.sentence(run.machine)),
            *attempt(
                ("the tables", lambda: tables(result)), PEERS, ("the figure", lambda: over_time(result, look))
            ),
            Note(METHOD),
            again("endure", run.command, run.started[:10], run.machine, run.versions),
        ],
        list(look.values()),
    )


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
                NONE if law is None else _named(law),
                NONE if law is None or not law.law else power_of(law),
                NONE if law is None or law.mean is None else _mean(law),
                NONE if law is None or law.rate is None else _rate(law),
                NONE if line.seconds is None else seconds(line.seconds),
                NONE if line.times_ours is None else f"{line.times_ours:.3g}",
            )
        )
    heads = tuple(f"{year:g}" for year in years)
    after = ("law", "power of t", "mean", "a year", "time", "× ours")
    made = [
        Table(
            f"Relative energy error over {result.years:g} years",
            ("method", "starts", *heads, *after),
            rows,
            "rms over the starts, at so many years. Mean: over the starts at the end, with its standard "
            "error, after the offset of each has been taken off. "
            + (f"{drift.told(result.starts)}, whatever the power of t. " if result.starts > 1 else "")
            + "Power of t and the drift a year with 95 % "
            "intervals over the starts. Time: median of one trajectory.",
            words=(0, 2 + len(heads)),
            groups=(("", 2), ("rms", len(heads)), ("", 2), ("drift", 2), ("", 2)),
        )
    ]
    if asked := goals(result):
        made.append(goals_table(asked))
    return made


def _named(law: Law) -> str:
    return drift.LAWS[law.law].removeprefix("grows like ") if law.law else law.why


def _mean(law: Law) -> str:
    """Return the mean over the starts with its standard error and the count of signs."""
    spread = "" if law.mean_error is None else f" ± {law.mean_error:.1e}"
    return f"{law.mean:+.1e}{spread} ({law.positive} of {law.starts} positive)"


def _rate(law: Law) -> str:
    """Return the mean drift per year with its interval, which one start does not have."""
    bare = law.rate_low is None or law.rate_high is None
    return f"{law.rate:+.1e}" + ("" if bare else f" ({law.rate_low:+.1e} to {law.rate_high:+.1e})")


@styled
def over_time(result: Endurance, look: Mapping[str, Look]) -> Picture | None:
    """Draw the rms over the starts against time, with every start behind it; ``None`` without any."""
    t = result.t
    shown = [(method, errors) for method, errors in result.errors.items() if errors.size]
    if not shown:
        return None
    values = np.array([drift.rms(errors) for _, errors in shown])
    positive = values[values > 0.0]
    low = math.floor(math.log10(positive.min())) if positive.size else -17
    high = math.ceil(math.log10(positive.max())) if positive.size else -14
    figure = new(8.4, 5.0)
    axes = figure.subplots()
    figure.subplots_adjust(left=0.08, right=0.94, top=0.94, bottom=0.1)
    log_axis(axes, "x", math.floor(math.log10(t[0])), math.ceil(math.log10(t[-1])))
    log_axis(axes, "y", low, max(high, low + 1))
    found, traces = {line.method: line for line in lines(result)}, []
    for (method, errors), rms in zip(shown, values, strict=True):
        number, colour, dash = look[method].number, look[method].light, look[method].dash
        for row in np.abs(errors):
            axes.plot(t, np.where(row > 0.0, row, np.nan), color=colour, linewidth=0.4, alpha=0.18)
        axes.plot(
            t,
            rms,
            color=colour,
            dashes=dash or (None, None),
            marker=look[method].marker,
            markevery=24,
            markersize=5,
            linewidth=1.6,
            label=method,
        )
        traces.append(Trace(number, method, t, np.where(rms > 0.0, rms, np.nan)))
        law = found[method].drift
        if law is not None and law.law is not None:
            at = np.geomspace(t[-1] / FALLS_ON, t[-1], LAW_POINTS)
            traces.append(Trace(number, method, at, drift.curve(law, at), "law", drift.LAWS[law.law]))
    guide = t[t >= t[-1] / 1e3]
    axes.plot(guide, 10.0 ** (low + 0.4) * np.sqrt(guide / guide[0]), color=MUTED, linewidth=0.8)
    axes.annotate(" √t", (guide[-1], 10.0 ** (low + 0.4) * math.sqrt(guide[-1] / guide[0])), color=MUTED)
    title = "relative energy error, root mean square over the starts"
    axes.set(xlabel="years", title=title)
    axes.legend(loc="upper left", handlelength=4.5)
    said = "; ".join(
        f"{line.method}: {', '.join(f'{value:.1e} at {year:g} years' for year, value in line.rms.items())}"
        for line in found.values()
    )
    vertical = Axis("rms of the relative energy error", log=True)
    return picture(
        figure,
        "endure",
        "Energy error of the outer Solar System over time",
        "Thick: root mean square over the starts; thin: every start. The grey line grows like the square "
        "root of time, as unbiased round-off does.",
        said,
        Plot([Panel(title, Axis("years", log=True, both=True), vertical, traces)]),
    )
