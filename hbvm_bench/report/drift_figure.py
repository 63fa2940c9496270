"""The drift of an invariant: its error over the starts, and the law that was fitted to it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hbvm_bench import drift
from hbvm_bench.laws import Law
from hbvm_bench.report.canvas import Picture, log_axis, picture, power_range
from hbvm_bench.report.figures import Drawn, family_panels, panel_legend, trace
from hbvm_bench.report.plots import Axis, Panel, Plot, Trace
from hbvm_bench.summaries.laws import text

Array = NDArray[np.float64]

PER_DECADE = 6  # windows of time in which the error is drawn
LAW_POINTS = 40


def drift_figure(cases: Sequence[Drawn], invariant: str = "energy") -> Picture | None:
    """Draw the error of an invariant, rms over starts and windows of time, with its law; else ``None``."""
    shown = [case for case in cases if _has(case, invariant)]
    if not shown:
        return None
    curves = {case.record.id: _windows(case, invariant) for case in shown}
    label = f"error of {invariant.replace('_', ' ')}, rms"
    figure, grid = family_panels(shown, label)
    low, high = power_range([y for _, y in curves.values()], -18, 3)
    times = np.concatenate([t for t, _ in curves.values()])
    traces: list[Trace] = []
    for axes, members in grid:
        log_axis(axes, "y", low, high)
        left, right = power_range([times], -6, 12)
        log_axis(axes, "x", left, right, most=4)
        axes.set_xlim(times.min() / 1.3, times.max() * 1.3)
        for case in members:
            t, error = curves[case.record.id]
            law = case.record.result.laws[invariant]
            at, fitted = _law(law, t)
            axes.plot(t, error, case.look.marker, color=case.look.light, markersize=2.4, linestyle="")
            (line,) = axes.plot(at, fitted, color=case.look.light, linewidth=1.1)
            if case.look.dash:
                line.set_dashes(case.look.dash)
            traces += [
                trace(case, t, error),
                Trace(case.look.number, case.record.case.method, at, fitted, "law", text(law)),
            ]
        panel_legend(
            axes,
            members,
            markers=True,
            notes={case.record.id: text(case.record.result.laws[invariant]) for case in members},
        )
    starts = max(case.record.result.laws[invariant].starts for case in shown)
    return picture(
        figure,
        "drift" if invariant == "energy" else f"drift-{invariant.replace('_', '-')}",
        f"Drift of the {invariant.replace('_', ' ')} and its law",
        f"Markers: root mean square of the error over {starts} starts (the problem's own, the others changed "
        "in their last digits) and over windows of time. Lines: the law that was fitted, "
        "a floor with a growth; its power of t stands with its 95 % interval. Bounded or t^1/2 is the best "
        "there is; a law is what these samples show, not a proof.",
        "Law of each case. "
        + "; ".join(f"{c.record.case.method}: {text(c.record.result.laws[invariant])}" for c in shown)
        + ".",
        Plot([Panel("", Axis("time", log=True, both=True), Axis(label, log=True), traces)]),
    )


def _has(case: Drawn, invariant: str) -> bool:
    return (
        invariant in case.record.result.laws
        and case.series.get("drift.t", np.empty(0)).size > 1
        and f"drift.{invariant}" in case.series
    )


def _windows(case: Drawn, invariant: str) -> tuple[Array, Array]:
    """Return the rms over starts in windows that are equally long in log t; what is 0 is left out."""
    t, rows = case.series["drift.t"], np.atleast_2d(case.series[f"drift.{invariant}"])
    good = np.isfinite(rows).all(axis=0)
    t, each = t[good], drift.rms(rows[:, good])
    if not t.size:
        return np.empty(0), np.empty(0)
    number = np.floor(np.log10(t / t[0]) * PER_DECADE + 1e-9)
    windows = np.unique(number)
    middle = np.array([np.exp(np.mean(np.log(t[number == n]))) for n in windows])
    error = np.array([drift.rms(each[number == n][:, None])[0] for n in windows])
    return middle[error > 0], error[error > 0]


def _law(law: Law, t: Array) -> tuple[Array, Array]:
    if law.law is None or t.size < 2:
        return np.empty(0), np.empty(0)
    at = np.geomspace(t[0], t[-1], LAW_POINTS)
    fitted = law.curve(at)
    good = fitted > 0
    return at[good], fitted[good]
