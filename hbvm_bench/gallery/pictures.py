"""One picture of each problem: orbits, a phase portrait, a curve in time or a lattice in space and time."""

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import integrators
import problems
from hbvm_bench.report.figures.style import GRID, INK, MUTED
from problems.errors import InputError
from problems.problem import Problem

Array = NDArray[np.float64]

COLORS = ("#0a58b5", "#c8500a", "#17753a", "#8a2160", "#6b4bb8", "#86720c", "#55606b", "#0a8f9c", "#a8324a")
POINTS = 1500


@dataclass(frozen=True)
class Picture:
    """How a problem is drawn.

    Attributes
    ----------
    draw : callable
        ``draw(axes, problem, t, y)``.
    span : float, optional
        How much of the problem's span is shown.
    points : int
        Samples.
    arguments : mapping
        Of the problem, where it has no default ones.
    """

    draw: Callable[[Any, Problem, Array, Array], None]
    span: float | None = None
    points: int = POINTS
    arguments: Mapping[str, Any] = field(default_factory=dict)


def _bodies(dimension: int, first: int = 0, last: int | None = None) -> Callable[..., None]:
    def draw(ax: Any, problem: Problem, t: Array, y: Array) -> None:
        n = (problem.system.dof or 0) // dimension
        for i in range(n)[first:last]:
            x, z = y[:, dimension * i], y[:, dimension * i + 1]
            color = COLORS[i % len(COLORS)]
            ax.plot(x, z, lw=0.8, color=color)
            ax.plot(x[0], z[0], "o", ms=4, color=color)
        ax.set(xlabel="x", ylabel="y", aspect="equal")

    return draw


def _plane(
    i: int = 0, j: int = 1, labels: tuple[str, str] = ("q₁", "q₂"), **look: Any
) -> Callable[..., None]:
    def draw(ax: Any, problem: Problem, t: Array, y: Array) -> None:
        ax.plot(y[:, i], y[:, j], color=COLORS[0], **{"lw": 0.7, **look})
        ax.plot(y[0, i], y[0, j], "o", ms=4, color=COLORS[1])
        ax.set(xlabel=labels[0], ylabel=labels[1], aspect="equal")

    return draw


def _time(parts: tuple[tuple[int, str], ...]) -> Callable[..., None]:
    def draw(ax: Any, problem: Problem, t: Array, y: Array) -> None:
        for (part, label), color in zip(parts, COLORS, strict=False):
            ax.plot(t, y[:, part], lw=0.9, color=color, label=label)
        ax.set(xlabel="t")
        _legend(ax, len(parts))

    return draw


def _legend(ax: Any, columns: int) -> None:
    """Put the legend above the axes, where no curve is."""
    ax.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.0)


def _lattice(ax: Any, problem: Problem, t: Array, y: Array) -> None:
    values = y[:, : problem.system.dof]
    size = np.abs(values).max()
    ax.pcolormesh(
        t, np.arange(values.shape[1]), values.T, cmap="RdBu_r", vmin=-size, vmax=size, rasterized=True
    )
    ax.set(xlabel="t", ylabel="number along the chain")


def _moving_lattice(ax: Any, problem: Problem, t: Array, y: Array) -> None:
    dof = problem.system.dof or 0
    _lattice(ax, problem, t, y[:, :dof] - y[:, :dof].mean(axis=1, keepdims=True))


def _phase(ax: Any, problem: Problem, t: Array, y: Array) -> None:
    """Level curves of an energy in one degree of freedom, with the orbit."""
    reach = 1.6 * np.abs(y).max(axis=0) + 0.2
    q, p = np.linspace(-reach[0], reach[0], 161), np.linspace(-reach[1], reach[1], 161)
    grid = np.array([[a, b] for b in p for a in q])
    level = problem.invariants(grid)["energy"].reshape(161, 161)
    here = problem.invariants(problem.y0)["energy"][0]
    low = level.min()
    step = max((here - low) / 3, 1e-9)
    ax.contour(
        q, p, level, levels=low + step * np.arange(0.3, 8.0), colors=GRID, linewidths=0.7, linestyles="-"
    )
    ax.plot(y[:, 0], y[:, 1], lw=1.2, color=COLORS[0])
    ax.set(xlabel="q", ylabel="p")


def _triangle(ax: Any, problem: Problem, t: Array, y: Array) -> None:
    from problems.catalogue.henon_heiles import SADDLES

    corners = np.array([*SADDLES, SADDLES[0]])
    ax.plot(corners[:, 0], corners[:, 1], color=MUTED, lw=0.8)
    _plane(lw=0.4)(ax, problem, t, y)


def _sitnikov(ax: Any, problem: Problem, t: Array, y: Array) -> None:
    ax.plot(t, y[:, 8], lw=0.9, color=COLORS[0], label="height of the planetoid")
    ax.plot(
        t, np.hypot(y[:, 0] - y[:, 3], y[:, 1] - y[:, 4]), lw=0.7, color=COLORS[1], label="primaries apart"
    )
    ax.set(xlabel="t")
    _legend(ax, 2)


def _pythagorean(ax: Any, problem: Problem, t: Array, y: Array) -> None:
    _bodies(2)(ax, problem, t, y)
    ax.set(xlim=(-6.0, 6.0), ylim=(-6.0, 6.0))  # the escape at the end leaves the picture


def _planets(ax: Any, problem: Problem, t: Array, y: Array) -> None:
    _bodies(3, 5)(ax, problem, t, y)
    ax.set_xlim(-35.0, 75.0)
    inner = ax.inset_axes((0.66, 0.28, 0.34, 0.5))
    _bodies(3, 1, 5)(inner, problem, t, y[t <= 1.9])  # a year of Mars
    inner.set(xlabel="", ylabel="", title="Mercury to Mars")


def _sphere(ax: Any, problem: Problem, t: Array, y: Array) -> None:
    around = np.linspace(0, 2 * np.pi, 200)
    ax.plot(np.cos(around), np.sin(around), color=MUTED, lw=0.8)
    _plane(0, 2, ("y₁", "y₃"))(ax, problem, t, y)


PICTURES = {
    "charged_particle": Picture(_plane(), 300.0),
    "cluster": Picture(_bodies(3), 5.0),
    "cr3bp": Picture(_plane(), None, 4000),
    "diatomic": Picture(_plane(), 60.0),
    "double_pendulum": Picture(_plane(labels=("angle 1", "angle 2"))),
    "expression": Picture(
        _phase, 12.0, 600, {"H": "p^2/2 + k*q^4/4", "q0": [1.0], "p0": [0.0], "parameters": "k=2"}
    ),
    "figure_eight": Picture(_bodies(2), 6.3259140097821386, 600),
    "fput": Picture(_lattice, None, 400),
    "henon_heiles": Picture(_triangle, 400.0, 3000),
    "kepler": Picture(_plane(), 6.5, 600),
    "lennard_jones": Picture(_bodies(2), 0.02, 800),
    "lotka_volterra": Picture(_time(((0, "y₁"), (1, "y₂"), (2, "y₃"))), 20.0, 500),
    "morse": Picture(_phase, 8.0, 600),
    "nonlinear_wave": Picture(_lattice, 30.0, 300),
    "outer_solar_system": Picture(_bodies(3, 1), 260.0, 2500),
    "pendulum": Picture(_phase, 11.0, 600),
    "penning_trap": Picture(_plane(labels=("x", "y")), 80.0, 3000),
    "period_annulus": Picture(_phase, 30.0, 4000),
    "pythagorean": Picture(_pythagorean, 66.0, 6000),
    "rigid_body": Picture(_sphere, 40.0, 600),
    "sine_gordon": Picture(_lattice, 40.0, 300),
    "sitnikov": Picture(_sitnikov, 200.0, 2000),
    "solar_system": Picture(_planets, 165.0, 6000),
    "spring_pendulum": Picture(_plane(labels=("x", "y")), 40.0, 2000),
    "stiff_chain": Picture(_time(((3, "x₄"), (4, "x₅"), (5, "x₆"))), 200.0, 3000),
    "toda": Picture(_moving_lattice, 40.0, 300),
}


def draw(name: str) -> str:
    """Draw one of the built-in problems as SVG.

    Parameters
    ----------
    name : str
        Its name; drawn at its default arguments, a system given as text at those of the table.

    Returns
    -------
    str
        The picture.

    Raises
    ------
    problems.errors.InputError
        If the problem has no picture, or its trajectory cannot be computed.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    if name not in PICTURES:
        raise InputError(f"{name} has no picture; it has to be told how it is drawn.")
    picture = PICTURES[name]
    problem = problems.load(name, **picture.arguments)
    end = problem.t_end if picture.span is None else problem.t0 + picture.span
    times = np.linspace(problem.t0, end, picture.points)
    found = integrators.integrate(problem, integrators.DOP853(rtol=1e-9, atol=1e-11), times=times)
    if found.status.failed:
        raise InputError(f"{name} cannot be drawn: {found.reason}")
    look: dict[Any, Any] = {
        "svg.hashsalt": "hbvm-bench",  # the same file from the same numbers
        "svg.fonttype": "none",
        "font.size": 8,
        "axes.edgecolor": MUTED,
        "text.color": INK,
        "axes.labelcolor": INK,
        "xtick.color": MUTED,
        "ytick.color": MUTED,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "path.simplify_threshold": 0.5,
    }
    with plt.rc_context(look):
        figure, ax = plt.subplots(figsize=(4.2, 3.0), layout="constrained")
        picture.draw(ax, problem, found.t, found.y)
        svg = io.StringIO()
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None}, dpi=110)
        plt.close(figure)
    return "\n".join(line.rstrip() for line in svg.getvalue().splitlines()) + "\n"
