"""The edge of a period annulus: the paper's bisection, Table 1, and why its entries are what they are."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM
from integrators.protocol import Array, MethodBase, Program
from problems import targets
from problems.catalogue.period_annulus import C_STAR, H_STAR, P1, period_annulus

from .departure import departure, step_states

TOLERANCE = 2.0**-52
SPAN, SHORT_SPAN = 2500.0, 100.0
FAR = 1.0  # |q| or |p| of an orbit that departs; the annulus lies within 0.69
DEGREES = (2, 3, 4, 5)
NODES: dict[int, int] = dict(zip(DEGREES, (5, 8, 10, 13), strict=True))  # k >= 5 s / 2
STEPS = (1.0, 0.5)
ENDS = tuple(1.0 + i / 64 for i in range(12))  # of the segment; the paper's first
PROBLEM = period_annulus()
DRAWN = {"gauss": Gauss(s=2, h=1.0), "hbvm": HBVM(k=5, s=2, h=1.0)}
PERIOD_STEP = 1 / 16
PERIOD_METHOD = HBVM(k=15, s=6, h=PERIOD_STEP)

# Table 1 of the paper: (h, s) -> Gauss point, its error in H, HBVM point, its error in H.
PRINTED = {
    (1.0, 2): ("3.723580509957994e-1", 2.15e-2, "3.757055929263451e-1", 7.66e-16),
    (1.0, 3): ("3.748759009745006e-1", 5.38e-3, "3.757055929263451e-1", 4.60e-16),
    (1.0, 4): ("3.754691919292651e-1", 1.53e-3, "3.757055929263450e-1", 1.22e-15),
    (1.0, 5): ("3.756914213384024e-1", 9.20e-5, "3.757055929263451e-1", 4.60e-16),
    (0.5, 2): ("3.756045691696934e-1", 6.56e-4, "3.757055929263451e-1", 4.60e-16),
    (0.5, 3): ("3.756828289241957e-1", 1.47e-4, "3.757055929263451e-1", 4.60e-16),
    (0.5, 4): ("3.757049796804918e-1", 3.98e-6, "3.757055929263451e-1", 4.60e-16),
    (0.5, 5): ("3.757055571549585e-1", 2.32e-7, "3.757055929263451e-1", 4.60e-16),
}
Path = tuple[Array, Array]  # times (n,) and states (n, 2)


@dataclass(frozen=True)
class Edge:
    """Where a method puts the edge of the annulus: (0, low) stays, (0, high) departs."""

    low: float
    high: float

    @property
    def c(self) -> float:
        """The middle of the last interval."""
        return (self.low + self.high) / 2

    @property
    def error(self) -> float:
        """The error in H of that point."""
        return error_of(self.c)


def edge(method: MethodBase, span: float, *, end: float = 1.0) -> Edge:
    """Find the edge by the paper's steps 1 to 5, on the segment from the origin to Q = (0, 1).

    The printed step 2 lets the segment end in P1; it has to end in Q. With another Q = (0, end) the
    bisection visits other points. Orbits are followed over the span.
    """
    program = method.compile(PROBLEM.system)
    low, high = 0.0, end
    while high - low >= TOLERANCE and (middle := (low + high) / 2) not in (low, high):
        stays = fate(program, middle, span) is None
        low, high = (middle, high) if stays else (low, middle)
    return Edge(low, high)


def fate(program: Program, c: float, span: float) -> float | None:
    """Return when the numerical orbit from (0, c) departs, or ``None``."""
    stepper = program.start(np.array([0.0, c]), PROBLEM.par)
    return departure(stepper, span, _departed, stretch=SHORT_SPAN)


def cell(s: int, h: float) -> dict[str, Edge]:
    """Return the entries of Table 1 for one s and h: ``gauss`` and ``hbvm``, each over both spans."""
    methods = {"gauss": Gauss(s=s, h=h), "hbvm": HBVM(k=NODES[s], s=s, h=h)}
    return {
        name + suffix: edge(method, span)
        for name, method in methods.items()
        for suffix, span in (("", SPAN), ("_short", SHORT_SPAN))
    }


def limit(s: int, h: float) -> tuple[float, float]:
    """Return when the first start beyond the edge by HBVM departs, and how far H/H* rises until then."""
    method = HBVM(k=NODES[s], s=s, h=h)
    t, y = orbit(method, edge(method, SPAN).high)
    values = energy(y)
    return float(t[-1]), float((values - values[0]).max() / H_STAR)


def spread(s: int, h: float, ends: Sequence[float] = ENDS) -> list[float]:
    """Return the errors in H of Gauss(s) over the paper's span, from bisections with other ends."""
    return [edge(Gauss(s=s, h=h), SPAN, end=end).error for end in ends]


def error_of(c: float) -> float:
    """Return |H(0, c) - H*|/H*, with H evaluated in double-double."""
    return float(abs(energy(np.array([[0.0, c]]))[0] - H_STAR) / H_STAR)


def energy(y: Array) -> Array:
    """Return H of states (n, 2), evaluated in double-double."""
    return PROBLEM.invariants(y)["energy"]


def fates(method: MethodBase, gaps: Sequence[float], span: float = SPAN) -> list[tuple[float, float | None]]:
    """Return, for each gap, the gap and when the orbit from c = (1 - gap) c* departs."""
    program = method.compile(PROBLEM.system)
    return [(gap, fate(program, C_STAR * (1 - gap), span)) for gap in gaps]


def orbit(method: MethodBase, c: float, span: float = SPAN) -> Path:
    """Return the times and states at the steps of the orbit from (0, c), up to its departure."""
    t, y, _ = step_states(PROBLEM, method, np.array([0.0, c]), span)
    far = np.flatnonzero(_departed(y))
    return (t[: far[0]], y[: far[0]]) if far.size else (t, y)


def drawn() -> dict[str, Path]:
    """Return the orbits of Figure 2: each method from the last point it finds periodic."""
    return {family: orbit(method, edge(method, SPAN).low) for family, method in DRAWN.items()}


def periods(gaps: Sequence[float]) -> list[tuple[float, float]]:
    """Return, for c = (1 - gap) c*, the relative distance of H from H* and the orbit's period."""
    return [(error_of(c), _period(c)) for c in (C_STAR * (1 - gap) for gap in gaps)]


def field(point: Sequence[float]) -> Array:
    """Return (q', p') at a point (q, p)."""
    return targets.numpy(PROBLEM.system, "field")(0.0, np.array(point), PROBLEM.par)


def eigenvalues(point: Sequence[float]) -> NDArray[np.complex128]:
    """Return the two eigenvalues of the field linearised at a point (q, p), by central differences."""
    steps = 1e-5 * np.eye(2)
    J = np.stack([(field(point + step) - field(point - step)) / 2e-5 for step in steps], axis=1)
    return np.linalg.eigvals(J).astype(complex)


def saddle_rate() -> float:
    """Return the positive eigenvalue at P1; the period grows as log(1/gap)/rate."""
    return float(eigenvalues(P1).real.max())


def _period(c: float) -> float:
    """Return when the orbit from (0, c) is back on the positive p axis, by secants over partial steps."""
    # Any: a Stepper that has Checkpoints too
    stepper: Any = PERIOD_METHOD.compile(PROBLEM.system).start(np.array([0.0, c]), PROBLEM.par)
    while True:
        kept = stepper.checkpoint()
        samples = stepper.advance(np.array([stepper.t + 64 * PERIOD_STEP]), sample="steps")
        q, p = samples.y.T
        back = np.flatnonzero((q[:-1] < 0) & (q[1:] >= 0) & (p[1:] > 0))
        if back.size:
            break
    (a, b), (qa, qb) = samples.t[back[0] :][:2].tolist(), q[back[0] :][:2].tolist()
    for _ in range(20):
        middle = b - qb * (b - a) / (qb - qa)
        stepper.restore(kept)
        a, qa, b, qb = b, qb, middle, float(stepper.advance(np.array([middle])).y[0, 0])
        if abs(b - a) < 1e-13 * b or qa == qb:
            break
    return b


def _departed(y: Array) -> NDArray[np.bool_]:
    return ~(np.abs(y).max(axis=1) <= FAR)
