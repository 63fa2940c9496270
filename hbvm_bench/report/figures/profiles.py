"""Performance profiles: on which share of the problems a family is within a factor of the best."""

from collections.abc import Sequence

import numpy as np
from matplotlib.ticker import PercentFormatter

from hbvm_bench.measure.metrics import find
from hbvm_bench.report.figures.canvas import Picture, log_axis, new, picture, styled
from hbvm_bench.report.figures.over_time import WIDTH
from hbvm_bench.report.figures.style import DASHES, INK, base
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.needs import ACCURACIES, profile
from hbvm_bench.summaries.points import work_of

FEWEST_PROBLEMS = 3  # a profile over fewer says nothing that the table does not
NEVER = 6.0  # decades: the end of the axis where a family is not within any factor


@styled
def profiles(records: Sequence[Record]) -> Picture | None:
    """Draw the profiles, ``None`` for too few problems."""
    work = work_of(records)
    shown = [profile(records, accuracy, work) for accuracy in ACCURACIES]
    shown = [item for item in shown if item.problems >= FEWEST_PROBLEMS]
    if not shown:
        return None
    label = find(work).label
    figure = new(WIDTH, 4.2)
    figure.subplots_adjust(left=0.06, right=0.86, top=0.92, bottom=0.12, wspace=0.14)
    grid = figure.subplots(1, len(shown), squeeze=False, sharey=True)[0]
    handles = {}
    for axes, item in zip(grid, shown, strict=True):
        worst = max((r for ratios in item.ratios.values() for r in ratios if np.isfinite(r)), default=10.0)
        end = 10.0 ** min(NEVER, max(1.0, np.ceil(np.log10(worst))))
        for index, family in enumerate(item.ratios):
            taus, shares = item.curve(family)
            if not item.solved(family):
                continue
            x = np.repeat([*taus, end], 2)[1:]
            y = np.repeat(shares, 2)
            x, y = x[: y.size], y[: x.size]
            colour, _, marker = base(family)
            same = [name for name in list(item.ratios)[:index] if base(name)[0] == colour]
            every = (index % 3, max(3, x.size // 6))
            (line,) = axes.plot(
                x, y, color=colour, marker=marker, markevery=every, markersize=4, label=family
            )
            line.set(linewidth=1.6, dashes=DASHES[len(same)], clip_on=False)
            handles.setdefault(family, line)
        log_axis(axes, "x", 0, round(np.log10(end)))
        axes.set_ylim(-0.02, 1.02)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.set_title(item.words, color=INK, fontsize=8)
        axes.set_xlabel(f"{label}, relative to the best family")
    figure.legend(handles.values(), handles.keys(), loc="center left", bbox_to_anchor=(0.87, 0.5))
    said = " ".join(
        f"{item.words}, {item.problems} problems: "
        + ", ".join(
            f"{name} best on {item.wins(name)}, solves {item.solved(name)} of {item.ran(name)}"
            for name in item.ratios
        )
        + "."
        for item in shown
    )
    return picture(
        figure,
        "profiles",
        "Performance profiles",
        "The share of the problems on which the best setting of a family needs at most this multiple of "
        f"the {label} of the best of all. The right end of a line is the share of problems that it "
        "solves at all. "
        "Only problems on which a family ran count for it. "
        "Dolan and Moré, Mathematical Programming 91 (2002).",
        said,
    )
