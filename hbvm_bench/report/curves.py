"""What figures over time are drawn from: a few points of each error, small enough to lie beside a report.

A page is drawn from these alone, be it of a run or of what lies beside a report, so that both are the same.
"""

from collections.abc import Mapping

import numpy as np

from hbvm_bench.campaign.own import NOTHING, Known
from hbvm_bench.measure import drift, reading
from hbvm_bench.store.records import Record
from integrators.protocol import Array

PREFIX = "curve."
GROWTH = PREFIX + "growth"
POINTS = 60  # of a curve: the largest value in each of so many equal time intervals
PER_DECADE = 6  # windows of time in which a growth is drawn
BAND = (16, 84)  # percentiles over the initial conditions: one standard deviation of a normal distribution
DRAWN = ("error.", "guard.", "distance", "position")
"""With what the names of the series begin that have a curve."""


def curves(record: Record, series: Mapping[str, Array], known: Known = NOTHING) -> dict[str, Array]:
    """Return the curves of a case by name, each of shape (2, n): times and values, at most `POINTS`.

    ``curve.growth`` is of shape (4, n): times, rms over the initial conditions, and the percentiles `BAND`.
    """
    if there := {name: values for name, values in series.items() if name.startswith(PREFIX)}:
        return there
    if record.case.ensemble is not None:
        return {}
    found: dict[str, Array] = {}
    drawn = reading.drawn(record, dict(series), known)
    for name, values in drawn.items():
        t = drawn.get("position_t" if name == "position" else "t", np.empty(0))
        if name.startswith(DRAWN) and name != "position_t" and t.size and values.shape == t.shape:
            finite = np.isfinite(values)
            found[PREFIX + name] = np.array(envelope(t[finite], np.abs(values[finite])))
    if {"drift.t", "drift.energy"} <= {*drawn}:
        found[GROWTH] = windows(drawn["drift.t"], np.atleast_2d(drawn["drift.energy"]))
    return found


def envelope(t: Array, values: Array, bins: int = POINTS) -> tuple[Array, Array]:
    """Return the largest value in each of ``bins`` equal time intervals, at the place where it is."""
    if t.size <= bins:
        return t, values
    edges = np.linspace(t[0], t[-1], bins + 1)
    which = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, bins - 1)
    order = np.lexsort((values, which))
    last = np.flatnonzero(np.diff(which[order], append=bins))
    chosen = np.sort(order[last])
    return t[chosen], values[chosen]


def windows(t: Array, rows: Array) -> Array:
    """Return times, rms and percentiles, shape (4, n), of errors (starts, m) in windows of equal log t.

    Windows in which all errors are 0 or not finite are left out.
    """
    good = np.isfinite(rows).all(axis=0) & (t > 0)
    t, rows = t[good], np.abs(rows[:, good])
    number = np.floor(np.log10(t / t[0]) * PER_DECADE + 1e-9) if t.size else t
    found = []
    for window in np.unique(number):
        here = rows[:, number == window]
        low, high = np.percentile(here, BAND)
        middle = np.exp(np.log(t[number == window]).mean())
        found.append((middle, drift.rms(here.reshape(-1, 1))[0], low, high))
    made = np.array(found).reshape(-1, 4).T
    return made[:, made[1] > 0]
