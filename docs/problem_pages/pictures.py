"""One picture of each problem, as its catalogue entry says: see `problems.picture`."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

import integrators
import problems
from hbvm_bench.report.figures.style import GRID, INK, MUTED
from problems import registry
from problems.errors import InputError
from problems.picture import Curves, Lattice, Orbits, Phase, Picture, Plane
from problems.problem import Problem

Array = NDArray[np.float64]

COLORS = ("#0a58b5", "#c8500a", "#17753a", "#8a2160", "#6b4bb8", "#86720c", "#55606b", "#0a8f9c", "#a8324a")


def draw(name: str) -> str:
    """Draw a problem as SVG, at its default arguments or at those of its picture.

    Raises
    ------
    problems.errors.InputError
        If the problem has no picture, or its trajectory cannot be computed.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    entry = registry.entry(name)
    if entry is None or entry.picture is None:
        raise InputError(f"{name} has no picture; its entry has to say how it is drawn.")
    picture = entry.picture
    problem = problems.load(name, **picture.arguments)
    end = problem.t_end if picture.span is None else problem.t0 + picture.span
    times = np.linspace(problem.t0, end, picture.points)
    solution = integrators.integrate(problem, integrators.DOP853(rtol=1e-9, atol=1e-11), times=times)
    if solution.status.failed:
        raise InputError(f"{name} cannot be drawn: {solution.reason}")
    look: dict[Any, Any] = {
        "svg.hashsalt": "hbvm-bench",  # the same file from the same numbers
        "svg.fonttype": "none",
        "font.size": 8,
        **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), MUTED),
        **dict.fromkeys(("text.color", "axes.labelcolor"), INK),
        **dict.fromkeys(("axes.spines.top", "axes.spines.right"), False),
        "path.simplify_threshold": 0.5,
    }
    with plt.rc_context(look):
        figure, ax = plt.subplots(figsize=(4.2, 3.0), layout="constrained")
        _draw(ax, picture, problem, solution.t, solution.y)
        svg = io.StringIO()
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None}, dpi=110)
        plt.close(figure)
    return "\n".join(line.rstrip() for line in svg.getvalue().splitlines()) + "\n"


def _draw(ax: Any, picture: Picture, problem: Problem, t: Array, y: Array) -> None:
    match picture:
        case Orbits():
            _orbits(ax, picture, problem, t, y)
        case Plane():
            _plane(ax, picture, y)
        case Curves():
            _curves(ax, picture, t, y)
        case Lattice():
            _lattice(ax, picture, problem, t, y)
        case Phase():
            _phase(ax, problem, y)


def _orbits(ax: Any, picture: Orbits, problem: Problem, t: Array, y: Array) -> None:
    dimension = picture.dimension
    bodies = range((problem.system.dof or 0) // dimension)
    _bodies(ax, bodies[picture.first : picture.last], dimension, y)
    ax.set(xlabel="x", ylabel="y", aspect="equal")
    if picture.limits is not None:
        left, right, bottom, top = picture.limits
        ax.set(xlim=(left, right), ylim=(bottom, top))
    if picture.inset is not None:
        first, last, span, title = picture.inset
        inner = ax.inset_axes((0.66, 0.28, 0.34, 0.5))
        _bodies(inner, bodies[first:last], dimension, y[t <= span])
        inner.set(title=title, aspect="equal")


def _bodies(ax: Any, bodies: range, dimension: int, y: Array) -> None:
    for i in bodies:
        x, z = y[:, dimension * i], y[:, dimension * i + 1]
        color = COLORS[i % len(COLORS)]
        ax.plot(x, z, lw=0.8, color=color)
        ax.plot(x[0], z[0], "o", ms=4, color=color)


def _plane(ax: Any, picture: Plane, y: Array) -> None:
    i, j = picture.places
    if picture.outline is not None:
        outline = np.array(picture.outline)
        ax.plot(outline[:, 0], outline[:, 1], color=MUTED, lw=0.8)
    ax.plot(y[:, i], y[:, j], color=COLORS[0], lw=picture.width)
    ax.plot(y[0, i], y[0, j], "o", ms=4, color=COLORS[1])
    ax.set(xlabel=picture.labels[0], ylabel=picture.labels[1], aspect="equal")


def _curves(ax: Any, picture: Curves, t: Array, y: Array) -> None:
    for (curve, label), color in zip(picture.curves, COLORS, strict=False):
        values = y[:, curve] if isinstance(curve, int) else curve(y)
        ax.plot(t, values, lw=0.9, color=color, label=label)
    ax.set(xlabel="t")
    # The legend above the axes, where no curve is.
    columns = len(picture.curves)
    ax.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.0)


def _lattice(ax: Any, picture: Lattice, problem: Problem, t: Array, y: Array) -> None:
    values = y[:, : problem.system.dof]
    if picture.moving:
        values = values - values.mean(axis=1, keepdims=True)
    size, number = np.abs(values).max(), np.arange(values.shape[1])
    ax.pcolormesh(t, number, values.T, cmap="RdBu_r", vmin=-size, vmax=size, rasterized=True)
    ax.set(xlabel="t", ylabel="number along the chain")


def _phase(ax: Any, problem: Problem, y: Array) -> None:
    """Level curves of an energy in one degree of freedom, with the orbit."""
    reach = 1.6 * np.abs(y).max(axis=0) + 0.2
    q, p = np.linspace(-reach[0], reach[0], 161), np.linspace(-reach[1], reach[1], 161)
    grid = np.array([[a, b] for b in p for a in q])
    level = problem.invariants(grid)["energy"].reshape(161, 161)
    low = level.min()
    step = max((problem.invariants(problem.y0)["energy"][0] - low) / 3, 1e-9)
    levels = low + step * np.arange(0.3, 8.0)
    ax.contour(q, p, level, levels=levels, colors=GRID, linewidths=0.7, linestyles="-")
    ax.plot(y[:, 0], y[:, 1], lw=1.2, color=COLORS[0])
    ax.set(xlabel="q", ylabel="p")
