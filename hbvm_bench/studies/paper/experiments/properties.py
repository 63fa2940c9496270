"""What the paper says of the methods themselves, measured on its own polynomial problems."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss

from integrators import integrate
from integrators.coefficients.legendre import legendre
from integrators.coefficients.tableau import tableau
from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM
from integrators.protocol import Array, MethodBase
from problems import targets
from problems.catalogue.henon_heiles import henon_heiles
from problems.catalogue.period_annulus import period_annulus

DEGREES = (1, 2, 3, 4, 5)
BIG = 24  # more nodes than any degree here needs
PAIRS = tuple((k, s) for s in DEGREES for k in (s, s + 1, 2 * s, 3 * s, BIG))
REVERSED = (Gauss(s=2, h=0.5), HBVM(k=4, s=2, h=0.5), HBVM(k=9, s=4, h=0.5))
COLLOCATED = ((2, 2), (3, 2), (4, 2), (5, 2), (6, 2), (3, 3), (8, 3), (10, 4), (13, 5))
MAPPED = (
    *(Gauss(s=2, h=1.0), HBVM(k=4, s=2, h=1.0), HBVM(k=4, s=2, h=0.5)),
    *(Gauss(s=3, h=1.0), HBVM(k=6, s=3, h=1.0)),
)

# Where the error is asymptotic and above round-off: the finest step and the ratio of two steps.
ORDER_SPAN = 6.0
ORDER_STEPS = {1: (64, 512), 2: (24, 192), 3: (16, 96), 4: (12, 48), 5: (10, 30)}
ErrorRow = tuple[int, int, float]


@dataclass(frozen=True)
class Order:
    """Measured order of HBVM(k, s): errors against steps and the slope of the fit."""

    s: int
    k: int
    h: list[float]
    error: list[float]
    slope: float


def orders() -> list[Order]:
    """Measure the order on the Henon-Heiles problem for k = s, s + 1, 2s and 3s."""
    problem = henon_heiles(energy=0.12, t_end=ORDER_SPAN)

    def end(method: MethodBase) -> Array:
        return integrate(problem, method, times=[ORDER_SPAN]).y[0]

    truth = end(HBVM(k=20, s=10, h=0.05))
    orders_ = []
    for s in DEGREES:
        h = ORDER_SPAN / np.unique(np.geomspace(*ORDER_STEPS[s], 5).round().astype(int))
        for k in sorted({s, s + 1, 2 * s, 3 * s}):
            errors = [float(np.abs(end(HBVM(k=k, s=s, h=step)) - truth).max()) for step in h]
            slope = float(np.polyfit(np.log(h), np.log(errors), 1)[0])
            orders_.append(Order(s, k, h.tolist(), errors, slope))
    return orders_


def reversals(t_end: float = 100.0) -> list[tuple[str, float]]:
    """Return how far runs to ``t_end`` and back miss their start."""
    problem = henon_heiles(energy=0.12, t_end=t_end)
    rows = []
    for method in REVERSED:
        stepper = method.compile(problem.system).start(problem.y0, problem.par)
        stepper.advance(np.array([t_end]))
        back = stepper.advance(np.array([0.0])).y[-1]
        rows.append((repr(method), float(np.abs(back - problem.y0).max())))
    return rows


def stability() -> tuple[float, float]:
    """Return the largest | |R(iy)| - 1 |, and the largest |R| in the left half plane, over `PAIRS`.

    |y| up to 1e4, and 2000 points with real parts down to -1e4.
    """
    y = np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 400)])
    rng = np.random.default_rng(7)
    real, sign = 10.0 ** rng.uniform(-3, 4, 2000), rng.choice([-1, 1], 2000)
    left = -real + 1j * sign * 10.0 ** rng.uniform(-3, 4, 2000)
    edge, inside = 0.0, 0.0
    for k, s in PAIRS:
        method = tableau(k, s)
        edge = max(edge, float(np.abs(np.abs(method.stability(1j * y)) - 1.0).max()))
        inside = max(inside, float(np.abs(method.stability(left)).max()))
    return edge, inside


def collocation_gap() -> float:
    """Return the largest difference of the HBVM(s, s) tableau from the paper's a_ij = int_0^{c_i} l_j."""
    worst = 0.0
    for s in range(1, 9):
        method = tableau(s, s)
        x, w = leggauss(s)
        for i in range(s):
            u = method.c[i] * (1 + x) / 2
            for j in range(s):
                others = np.delete(method.c, j)
                lagrange = np.prod((u[:, None] - others) / (method.c[j] - others), axis=1)
                worst = max(worst, abs(method.c[i] * (w @ lagrange) / 2 - method.A[i, j]))
    return worst


def same_bits(t_end: float = 200.0) -> bool:
    """Whether Gauss(s) and HBVM(s, s) give the same doubles, s = 1 .. 5."""
    problem = henon_heiles(energy=0.12, t_end=t_end)

    def states(method: MethodBase) -> Array:
        return integrate(problem, method, times=[t_end], sample="steps").y

    return all(np.array_equal(states(Gauss(s=s, h=0.5)), states(HBVM(k=s, s=s, h=0.5))) for s in DEGREES)


def conservation(nu: int) -> list[ErrorRow]:
    """Return (s, k, largest relative error of H over [0, 50]) for k = s .. s + 10, of H of degree nu."""
    problem = {3: henon_heiles(energy=0.12), 5: period_annulus(start=0.3)}[nu]

    def error(k: int, s: int) -> float:
        run = integrate(problem, HBVM(k=k, s=s, h=1.0), times=[50.0], sample="steps")
        return float(run.errors()["energy"].max())

    return [(s, k, error(k, s)) for s in DEGREES for k in range(s, s + 11)]


def ranks() -> list[int]:
    """Return the ranks of the stage matrices A of the HBVM(k, s), of all `PAIRS`."""
    return [int(np.linalg.matrix_rank(tableau(k, s).A, tol=1e-10)) for k, s in PAIRS]


def iterations() -> list[tuple[int, float]]:
    """Return k and the fixed-point iterations per step of HBVM(k, 2) on Henon-Heiles."""
    problem, rows = henon_heiles(energy=0.12), []
    for k in (2, 3, 4, 6, 9, 12, 18, 24, 36):
        stats = integrate(problem, HBVM(k=k, s=2, h=0.5), times=[500.0], sample="steps").stats
        rows.append((k, (stats.iterations or 0) / stats.steps))
    return rows


def extended() -> list[ErrorRow]:
    """Return (k, s, residual of the extended collocation conditions)."""
    return [(k, s, _residual(k, s)) for k, s in COLLOCATED]


def _residual(k: int, s: int, h: float = 0.5) -> float:
    """Return the largest residual at the nodes of sigma' = sum_j P_j int P_j f(sigma) over one step.

    sigma comes from dense output at s + 1 points; the integrals from a rule with `BIG` nodes.
    """
    problem = period_annulus(start=0.3)
    points = np.linspace(0.0, 1.0, s + 1)[1:]
    program = HBVM(k=k, s=s, h=h).compile(problem.system)
    values = program.start(problem.y0, problem.par).advance(points * h, sample="dense").y
    powers = np.vander(points, s + 1, increasing=True)[:, 1:]
    sigma = np.linalg.solve(powers, values - problem.y0)  # coefficients of c, c^2, ...
    c, b = (leggauss(BIG)[0] + 1) / 2, leggauss(BIG)[1] / 2
    path = problem.y0 + np.vander(c, s + 1, increasing=True)[:, 1:] @ sigma
    field = targets.numpy(problem.system, "field")
    f = np.stack([field(0.0, y, problem.par) for y in path])
    gamma = legendre(c, s).T @ (b[:, None] * f)
    nodes = tableau(k, s).c
    slope = np.arange(1, s + 1) * np.vander(nodes, s, increasing=True) @ sigma / h
    return float(np.abs(slope - legendre(nodes, s) @ gamma).max())


def defects() -> list[tuple[str, float]]:
    """Return how far one step of each method is from symplectic."""
    return [(repr(method), _defect(method)) for method in MAPPED]


def _defect(method: MethodBase, delta: float = 1e-3) -> float:
    """Return the largest entry of M' J M - J, M the derivative of one step on Henon-Heiles.

    M from differences of order 4, which leave about 1e-12.
    """
    problem = henon_heiles(energy=0.12)
    program = method.compile(problem.system)

    def step(y0: Array) -> Array:
        stepper = program.start(y0, problem.par)
        stepper.step()
        return stepper.y

    M = np.empty((4, 4))
    for j, unit in enumerate(delta * np.eye(4)):
        near = step(problem.y0 + unit) - step(problem.y0 - unit)
        far = step(problem.y0 + 2 * unit) - step(problem.y0 - 2 * unit)
        M[:, j] = (8 * near - far) / (12 * delta)
    J = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    return float(np.abs(M.T @ J @ M - J).max())
