"""What a page says of a figure's numbers is what the figure draws."""

import numpy as np

from hbvm_bench.report.figures.canvas import new
from hbvm_bench.report.figures.plots import numbers
from hbvm_bench.report.figures.read_off import MOST, read_off

BLUE = "#0a58b5"


def read(figure):
    return read_off(figure, {BLUE: 2}, {2: "HBVM"})


def test_lines_and_markers_keep_their_points_labels_and_colours():
    figure = new(4.0, 3.0)
    axes = figure.subplots()
    axes.plot([3.0, 2.0, 1.0], [1e-3, 1e-2, 1e-1], color=BLUE, label="_two")
    axes.plot([1.0, 2.0], [0.5, 0.5], "o", color="#000000", label="rings")
    axes.axhline(0.1)
    axes.set_yscale("log")
    axes.set(xlabel="time", title="t")
    plot = read(figure)
    assert plot is not None
    (panel,) = plot.panels
    assert (panel.x.label, panel.x.log, panel.y.log) == ("time", False, True)
    first, second = panel.traces
    assert (first.case, first.name, first.joined, first.x.tolist()) == (2, "two", True, [1.0, 2.0, 3.0])
    assert (second.case, second.name, second.joined, second.y.tolist()) == (0, "rings", False, [0.5, 0.5])


def test_a_figure_without_curves_has_no_numbers():
    figure = new(4.0, 3.0)
    figure.subplots().pcolormesh(np.eye(3))
    assert read(figure) is None


def test_thinning_keeps_the_largest_values():
    figure = new(4.0, 3.0)
    x = np.linspace(0.0, 1.0, 10_001)
    y = np.sin(1e3 * x)
    y[1234] = 7.0
    figure.subplots().plot(x, y)
    plot = read(figure)
    assert plot is not None
    (trace,) = plot.panels[0].traces
    assert trace.x.size <= MOST
    assert trace.y.max() == 7.0


def test_a_curve_is_extended_to_neither_side_in_the_table():
    figure = new(4.0, 3.0)
    axes = figure.subplots()
    axes.plot([0.0, 0.5, 1.0], [1.0, 1.0, 1.0], label="whole")
    axes.plot([0.4, 0.5, 0.6], [2.0, 2.0, 2.0], label="part")
    plot = read(figure)
    assert plot is not None
    whole, part = numbers(plot).rows
    assert whole[3:9] == ("1",) * 6
    assert part[3:9] == ("–", "–", "2", "2", "–", "–")
