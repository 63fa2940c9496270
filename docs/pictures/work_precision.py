"""Draw the work-precision diagram of the README from the stored settings of the race.

python docs/pictures/work_precision.py        writes docs/pictures/work_precision.svg
"""

import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "_ext"))
from first_page import by_width, frame  # noqa: E402 -- beside the extensions

from hbvm_bench.summaries.points import number  # noqa: E402

LINES = {
    "HBVM": "#0072b2",
    "Gauss": "#009e73",
    "Taylor": "#d55e00",
    "WHFast": "#a3568a",
    "WHFast512": "#8a6d00",
    "IAS15": "#333333",
}
LABELS = {"Taylor": "heyoka"}
ABOVE, BELOW = 1e-4, 1e-13  # position errors that are drawn


def settings() -> dict[str, list[tuple[float, float]]]:
    """Return time in seconds and position error of all settings of each method, of the outer Solar System."""
    cases = frame("speed/race")
    here, _ = by_width(cases[cases.title.str.startswith("Outer")])
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in LINES}
    for record in here.record:
        name = record.case.method.partition("(")[0]
        time, error = (number(record, key) for key in ("warm_seconds", "position_end"))
        if name in found and time and error:
            found[name].append((time, error))
    return found


def front(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the points that no other one beats in both, the fastest first."""
    kept: list[tuple[float, float]] = []
    for time, error in sorted(points):
        if BELOW <= error <= ABOVE and (not kept or error < kept[-1][1]):
            kept.append((time, error))
    return kept


def draw(path: Path) -> None:
    """Write the picture."""
    style = {"svg.hashsalt": "work_precision", "svg.fonttype": "none", "font.size": 10}
    with mpl.rc_context(style):
        figure, ax = plt.subplots(figsize=(5.4, 3.8), layout="constrained")
        for name, points in settings().items():
            line = front(points)
            ax.loglog(*zip(*line, strict=True), "o-", color=LINES[name], markersize=3.5, linewidth=1.4)
            alone = len(line) == 1
            ax.annotate(
                LABELS.get(name, name), line[0],
                xytext=(6, -4) if alone else (-7, -4), textcoords="offset points",
                ha="left" if alone else "right", color=LINES[name], fontweight="bold",
            )  # fmt: skip
        ax.set(
            xlabel="time for 12,000 years (s), one core, AVX-512",
            ylabel="position error, relative",
            xlim=(6e-4, None),
            ylim=(1e-13, 1e-4),
        )
        ax.grid(color="#e4e4e4", linewidth=0.6)
        ax.spines[["top", "right"]].set_visible(False)
        figure.savefig(path, metadata={"Date": None}, facecolor="white")
        plt.close(figure)


if __name__ == "__main__":
    draw(HERE / "work_precision.svg")
