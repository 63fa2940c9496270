"""Draw the animation of the README: Sitnikov's binary by Gauss and by HBVM, of the same order and step.

    python docs/pictures/sitnikov.py        writes docs/pictures/sitnikov.svg

It is the run of the original paper (docs/theory/paper.md). Viewers that do not animate SVG show all of
both trajectories: they are drawn in full, and the stars move along them.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import problems
from integrators import HBVM, Gauss, integrate
from integrators.protocol import MethodBase

H, END, SECONDS = 0.5, 1500.0, 40
METHODS: tuple[tuple[MethodBase, str], ...] = (
    (Gauss(s=2, h=H), "#c23b22"),
    (HBVM(k=18, s=2, h=H), "#1f6fb2"),
)
PANEL, GAP, TOP, PLOT = 340, 20, 46, 150
REACH = 4.0  # what a panel shows of the plane, in each direction
MOST = 30.0  # the largest separation that the plot shows
WIDTH, HEIGHT = 2 * PANEL + 3 * GAP, TOP + PANEL + PLOT + 70

Array = NDArray[np.float64]


def trajectory(method: MethodBase) -> tuple[Array, Array, float]:
    """Return positions of the first star in the plane, the separation, and the largest energy error."""
    times = np.arange(0.0, END + H / 2, H)
    solution = integrate(problems.load("sitnikov", e=0.75), method, times)
    assert solution.q is not None
    stars = solution.q.reshape(times.size, 3, 3)[:, :2]
    apart = np.linalg.norm(stars[:, 0] - stars[:, 1], axis=1)
    return stars[:, 0, :2], apart, float(solution.errors()["energy"].max())


def numbers(values: Array, digits: int) -> list[str]:
    """Return numbers as short texts."""
    return [f"{value:.{digits}f}".rstrip("0").rstrip(".") for value in values.tolist()]


def path(x: Array, y: Array, digits: int = 1) -> str:
    """Return points as the data of a path."""
    return "M" + "L".join(map(" ".join, zip(numbers(x, digits), numbers(y, digits), strict=True)))


def moving(name: str, values: Array, digits: int = 1) -> str:
    """Return the element that animates an attribute."""
    return (
        f'<animate attributeName="{name}" dur="{SECONDS}s" repeatCount="indefinite" '
        f'values="{";".join(numbers(values, digits))}"/>'
    )


def panel(method: MethodBase, colour: str, left: float, place: Array, error: float, end: str) -> str:
    """Return the orbits of the two stars, which are each other's mirror image, in a frame."""
    scale, middle = PANEL / 2 / REACH, PANEL / 2
    x, y = place.T * scale
    way = moving("cx", x) + moving("cy", y)
    star = f'<circle r="6" fill="{colour}" cx="{x[0]:.1f}" cy="{y[0]:.1f}">{way}</circle>'
    stars = f'<path d="{path(x, y)}" fill="none" stroke="{colour}" stroke-width=".5" opacity=".35"/>{star}'
    return (
        f'<text x="{left}" y="20" font-weight="bold">{method!r}</text>'
        f'<text x="{left}" y="38" fill="{colour}">energy error up to {error:.0e}: {end}</text>'
        f'<svg x="{left}" y="{TOP}" width="{PANEL}" height="{PANEL}">'
        f'<rect width="{PANEL}" height="{PANEL}" fill="white" stroke="#999"/>'
        f'<g transform="translate({middle} {middle})"><g id="star{left}">{stars}</g>'
        f'<use href="#star{left}" transform="scale(-1)"/></g></svg>'
    )


def plot(separations: list[Array]) -> str:
    """Return the separations of the stars against time, with a line at the present."""
    top, left, width = TOP + PANEL + 40, 2 * GAP + 10, WIDTH - 3 * GAP - 10
    parts = [f'<text x="{GAP}" y="{top - 10}">distance of the two stars against time</text>']
    for value in (0, 10, 20, 30):
        y = top + PLOT * (1 - value / MOST)
        parts.append(
            f'<line x1="{left}" x2="{left + width}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>'
            f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{value}</text>'
        )
    for time in (0, 500, 1000, 1500):
        x = left + width * time / END
        parts.append(f'<text x="{x:.0f}" y="{top + PLOT + 18}" text-anchor="middle">{time}</text>')
    for (_, colour), apart in zip(METHODS, separations, strict=True):
        x = np.linspace(left, left + width, apart.size)
        line = path(x, top + PLOT * (1 - np.minimum(apart, MOST) / MOST))
        parts.append(f'<path d="{line}" fill="none" stroke="{colour}" stroke-width="1"/>')
    present = moving("x1", np.array([left, left + width])) + moving("x2", np.array([left, left + width]))
    parts.append(f'<line x1="{left}" x2="{left}" y1="{top}" y2="{top + PLOT}" stroke="#333">{present}</line>')
    return "".join(parts)


def drawn() -> str:
    """Return the picture."""
    runs = [trajectory(method) for method, _ in METHODS]
    ends = [
        "the binary is lost" if apart[-200:].max() > 2 * apart[0] else "the binary stays"
        for _, apart, _ in runs
    ]
    panels = [
        panel(method, colour, GAP + i * (PANEL + GAP), place, error, end)
        for i, ((method, colour), (place, _, error), end) in enumerate(zip(METHODS, runs, ends, strict=True))
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'height="{HEIGHT}" font-family="sans-serif" font-size="14" role="img">'
        "<title>Sitnikov's problem: the two stars, by Gauss and by HBVM with the same order and step</title>"
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>{"".join(panels)}'
        f"{plot([apart for _, apart, _ in runs])}</svg>\n"
    )


if __name__ == "__main__":
    Path(__file__).with_suffix(".svg").write_text(drawn(), encoding="utf-8")
