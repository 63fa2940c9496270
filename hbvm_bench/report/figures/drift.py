"""The energy error, rms over initial conditions, and the growth fitted to it where it is clear."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure import drift
from hbvm_bench.report.figures.canvas import Picture, log_axis, picture, power_range
from hbvm_bench.report.figures.over_time import Drawn, family_panels, panel_legend
from hbvm_bench.report.figures.plots import named
from hbvm_bench.store.records import ErrorGrowth
from hbvm_bench.summaries.growth import FEWEST_STARTS, NOT_CLEAR, clear, text
from hbvm_bench.summaries.rows import reached

Array = NDArray[np.float64]

PER_DECADE = 6  # windows of time in which the error is drawn
LAW_POINTS = 40
MOST_CASES = 60
POWERS = (-18, 3)  # an error beyond is no drift but a failure, and is in the table

Found = tuple[Array, Array, ErrorGrowth]


def drift_figure(cases: Sequence[Drawn]) -> Picture | None:
    """Draw the energy error, rms over initial conditions and time windows, with its growth; else ``None``."""
    drifts = {c.record.id: got for c in cases[:MOST_CASES] if (got := _drift(c)) is not None}
    shown = [case for case in cases if case.record.id in drifts and _visible(drifts[case.record.id][1])]
    if not shown:
        return None
    growths = {key: growth for key, (_, _, growth) in drifts.items()}
    said = {key: text(growth) for key, growth in growths.items() if growth.kind is not None}
    curves = {key: _windows(t, rows) for key, (t, rows, _) in drifts.items()}
    label = "energy error, rms"
    notes = {key: words.replace(" to ", "–") for key, words in said.items()}
    figure, grid = family_panels(shown, label, notes)
    low, high = power_range([y for _, y in curves.values()], *POWERS)
    times = np.concatenate([t for t, _ in curves.values()])
    for axes, members in grid:
        log_axis(axes, "y", low, high)
        left, right = power_range([times], -6, 12)
        log_axis(axes, "x", left, right, most=4)
        axes.set_xlim(times.min() / 1.3, times.max() * 1.3)
        for case in members:
            key, look = case.record.id, case.look
            t, error = curves[key]
            at, fitted = _fitted(growths[key], t)
            name = named(look.number, case.record.case.method)
            axes.plot(t, error, look.marker, color=look.light, markersize=2.4, linestyle="", label=name)
            axes.plot(at, fitted, color=look.light, linewidth=1.1, dashes=look.dash)
        panel_legend(axes, members, markers=True, notes=notes)
    starts = max(growth.starts for growth in growths.values())
    over = (
        f"{starts} initial conditions (the problem's, and others changed in their last digits)"
        if starts > 1
        else "time windows, from one initial condition"
    )
    lines = (
        " Lines: the fitted growth, a constant floor with a power of t, printed with its 95 % interval. "
        "Rounding errors without bias grow as t^1/2. The fit describes these samples and proves nothing "
        "beyond them."
        if said
        else f" A growth is fitted from {FEWEST_STARTS} initial conditions on."
    )
    return picture(
        figure,
        "drift",
        "Growth of the energy error",
        f"Markers: root mean square of the error over {over}."
        + lines
        + (f" {drift.told(starts)}." if said else ""),
        "Growth of each case. "
        + "; ".join(f"{c.record.case.method}: {said.get(c.record.id, NOT_CLEAR)}" for c in shown)
        + ".",
    )


def _visible(rows: Array) -> bool:
    positive = np.abs(rows[np.isfinite(rows) & (rows != 0.0)])
    return positive.size > 0 and float(np.median(positive)) < 10.0 ** POWERS[1]


def _drift(case: Drawn) -> Found | None:
    """Return times, errors of shape (starts, n) and their growth, which a single trajectory has not."""
    stored = case.record.result.growth.get("energy")
    if stored is not None and "drift.energy" in case.series:
        t, rows = case.series["drift.t"], np.atleast_2d(case.series["drift.energy"])
        return (t, rows, clear(stored)) if t.size > 1 else None
    if not reached(case.record) or "error.energy" not in case.series:
        return None
    t, error = np.abs(case.series["t"] - case.series["t"][0]), case.series["error.energy"]
    return (t[1:], error[None, 1:], ErrorGrowth()) if t.size > 2 and np.isfinite(error).all() else None


def _windows(t: Array, rows: Array) -> tuple[Array, Array]:
    """Return the rms over trajectories in windows that are equally long in log t; zeros are left out."""
    good = np.isfinite(rows).all(axis=0) & (t > 0)
    t, each = t[good], drift.rms(rows[:, good])
    if not t.size:
        return np.empty(0), np.empty(0)
    number = np.floor(np.log10(t / t[0]) * PER_DECADE + 1e-9)
    windows = np.unique(number)
    middle = np.array([np.exp(np.mean(np.log(t[number == n]))) for n in windows])
    error = np.array([drift.rms(each[number == n][:, None])[0] for n in windows])
    return middle[error > 0], error[error > 0]


def _fitted(growth: ErrorGrowth, t: Array) -> tuple[Array, Array]:
    if growth.kind is None or t.size < 2:
        return np.empty(0), np.empty(0)
    at = np.geomspace(t[0], t[-1], LAW_POINTS)
    fitted = drift.curve(growth, at)
    good = fitted > 0
    return at[good], fitted[good]
