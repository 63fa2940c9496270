"""Which HBVM(k, s) a tolerance calls for: the choice of `integrators.HBVM` without k and s.

The cheapest one by a model of what a unit of time costs, under the condition that the error of the
quadrature, by which the energy changes, is at rounding. The model has two halves. How long a step may be:
where Legendre coefficients of the field fall off like r^j, a step of length h in units of the distance of the
nearest singularity has r = rho^{-1}, h = 4 r / (1 - r^2) (rho: of Bernstein's ellipse); its error
allows ``r^(2s-1) = tol`` and its quadrature ``r^(2k-3) = quadrature_error``. What it costs: operations on
vectors of eight stages, of the field and of the product, in each of so many iterations, and the rest of a
step. All numbers were fitted, by least squares and in part by hand, to eighteen runs of sixteen problems with
HBVM(8, 5), (8, 7), (16, 10) and (16, 14), on one processor without AVX-512 (Zen 3) beside other work; ratios
of two methods' costs are right to a third there. Other processors were not measured.
"""

from dataclasses import dataclass

from integrators.kernel.tolerance import error_order
from problems.analysis.structure import degree, degree_of
from problems.analysis.switches import depends_on_time_between_switches
from problems.derive.function import Function
from problems.graph.nodes import STATE, T, reachable
from problems.systems.base import System

NARROW, WIDE = 8, 16
"""Vector widths: numbers of stages at which the field is evaluated together; fewer cost as much."""

BETWEEN = 12
"""Stages in lanes where the energy is a polynomial: steps gain more from the degree than the stages cost.

HBVM(12, 11) takes 0.73 to 0.81 of the time of HBVM(8, 7) on Henon and Heiles' problem, FPUT and a quartic
oscillator at 1e-14 to 1e-6, but 1.2 of it on Kepler's and Morse's problems (Zen 3, without AVX-512). The
energy is as good: 7.1e-15 instead of 6.9e-15 (rms) in Henon and Heiles' problem at t = 20,000."""

SPARE = 2
"""Nodes of `WIDE` that are left over for the estimates; of `NARROW`, one."""

QUADRATURE_ERROR = 3e-17
"""Largest error allowed to a step's quadrature, as the last coefficient that k nodes see estimates it.

The error itself is smaller than this estimate, with fewer nodes by more."""

QUADRATURE_ERRORS = {NARROW: 1e-14, BETWEEN: 3e-16, WIDE: QUADRATURE_ERROR}
"""The same for each number of nodes.

The energy of the outer Solar System, of Kepler's, Henon and Heiles', Sitnikov's and twelve other problems
is then as good as with `HBVM()`. With 1e-13 and eight nodes the outer Solar System's drifts
by 1.5e-17 of itself per step, with 1e-15 and sixteen by 1e-16."""

ACCURATE_IN_LANES = 1e-14
"""Tolerance with which HBVM(8, 7) and (12, 11) are as accurate as doubles allow: estimates exceed errors.

It takes a fifth fewer steps than 3e-16. The positions of 32 to 512 trajectories at the end of Kepler's
problem and Henon and Heiles' (t = 2000), Morse's, Lotka and Volterra's, FPUT and the outer Solar System err
by 5 % more at most (rms), those of the double pendulum by 2.6e-15 instead of 1.6e-15 (heyoka: 2.1e-15);
energies by half more at most. With 3e-14 three of the seven positions err 3 to 20 times as much."""

GAIN = 0.86
"""Part of the usual method's cost that another one's is to be at most: the model is no better than that."""

# Nanoseconds: a step besides its iterations; the same for each row, and so many stages; an iteration, an
# operation of the field, a multiplication and addition of the product, each on eight stages.
STEP, ROW, ITERATION, OPERATION, PRODUCT = 210.0, 16.0, 39.0, 0.43, 1.1
# Operations that one of these is worth; a function, such as the sine; and a field whose formula is not known.
WEIGHTS = {
    "symbol": 0,
    "index": 0,
    "entry": 0,
    "element": 0,
    "add": 1,
    "sub": 1,
    "mul": 1,
    "neg": 1,
    "sum": 1,
    "pow": 3,
    "div": 6,
    "sqrt": 6,
}
FUNCTION, OPAQUE = 25, 500
# Iterations of a step: A + (B + C / s) h in the second-order form, more by a factor in the first-order form.
A, B, C, FIRST_ORDER = 3.5, 2.8, 12.0, 2.4
# On average, where the iteration limits the steps; these are then as long as 0.083 s.
MEAN_ITERATIONS, LENGTH_PER_DEGREE = 14.0, 0.083
# Systems of so many rows are as likely as not to have modes so fast that the iteration limits the steps.
MANY_ROWS = 16

LOOSE = 1e-10
"""With a projection of the energy HBVM(8, 7) is the cheaper one from this tolerance on.

Its cost relative to `HBVM()` without AVX-512, median of the nine problems of `automatic`: 0.45 at 1e-3, 0.60
at 1e-6, 0.78 at 1e-9; that of HBVM(16, 14) 0.80 at 1e-9 and 0.85 at 1e-12. HBVM(8, 5), (8, 6), (16, 10) and
(16, 12) cost more than the better of the two."""


def choose_projected(tol: float) -> tuple[int, int, None]:
    """Return k and s for steps that end with a projection of the energy; see `choose`."""
    return (NARROW, NARROW - 1, None) if tol >= LOOSE else (WIDE, WIDE - SPARE, None)


def exact_k(nu: int, s: int) -> int:
    """Return the least k with which HBVM(k, s) keeps a polynomial energy of degree nu exactly.

    ``k >= nu s/2`` makes the line integral exact (L. Brugnano, F. Iavernaro, T.
    Susca, "Numerical comparisons between Gauss-Legendre methods and Hamiltonian
    BVMs defined over Gauss points"); never less than s.

    Parameters
    ----------
    nu, s : int
        Degree of the energy, and of the method's polynomial.
    """
    return max(s, -(-nu * s // 2))


def nodes_of(system: System, s: int) -> int:
    """Return the k of ``HBVM(s=s, tol=...)``: the exact one where the energy is a polynomial, else 2s.

    More than s in any case: the estimate of a step's error is gamma_s, which s nodes do not determine.
    """
    nu = _degree(system)
    return max(2 * s if nu is None else exact_k(nu, s), s + 1)


def _degree(system: System) -> int | None:
    """Return the degree of what the steps keep, the energy or all invariants, if they are polynomials."""
    if system.on_manifold:
        return degree_of(root for invariant in system.invariants.values() for root in invariant.roots)
    return None if system.energy is None else degree(system)


def operations(function: Function) -> int:
    """Count the operations of a function that differ from stage to stage, expensive ones as several."""
    count = sum(len(terms) for terms in function.outputs)
    for node in reachable(function.roots):
        if node.flags & (STATE | T):
            count += WEIGHTS.get(node.op, FUNCTION) * (len(node.loop) if node.loop else 1)
    return count


@dataclass(frozen=True)
class Work:
    """What the cost of a system's steps depends on.

    Attributes
    ----------
    rows : int
        Components of a stage.
    second : bool
        Whether stages hold positions only.
    field : int
        Operations of the field, at one stage.
    lanes : bool
        Whether trajectories go side by side and their stages one after another, or the
        stages of one trajectory side by side.
    """

    rows: int
    second: bool
    field: int
    lanes: bool = False

    @classmethod
    def counted(cls, system: System, *, lanes: bool = False) -> "Work":
        """Count the operations of a system's field."""
        second = system.separable
        rows = system.dof if second and system.dof is not None else system.dim
        field = operations(system.function("force" if second else "field")) if system.traced else OPAQUE
        return cls(rows, second, field, lanes)

    def per_time(self, k: int, s: int, tol: float, quadrature_error: float | None) -> float:
        """Return the cost of a unit of time, relative.

        Parameters
        ----------
        k, s : int
            Of the method; k is a multiple of eight.
        tol, quadrature_error : float
            What bounds the step; ``None``: its quadrature is exact, or of no interest.
        """
        r = tol ** (1.0 / error_order(s - 1))
        if quadrature_error is not None:
            r = min(r, quadrature_error ** (1.0 / error_order(k - 2)))
        factor = 1.0 if self.second else FIRST_ORDER
        per_length = B + C / s
        length = min(4 * r / (1 - r * r), (MEAN_ITERATIONS / factor - A) / per_length)
        iterations = factor * (A + per_length * length)
        fast = self.rows / (self.rows + MANY_ROWS)
        by_error = self._step(k, iterations) / length
        by_iteration = self._step(k, MEAN_ITERATIONS) / (LENGTH_PER_DEGREE * s)
        return (1 - fast) * by_error + fast * by_iteration

    def _step(self, k: int, iterations: float) -> float:
        """Return the cost of a step of so many iterations."""
        if self.lanes:
            stage = OPERATION * self.field + PRODUCT * self.rows * k
            return k * (iterations * stage + ROW * self.rows / NARROW)
        vectors = k // NARROW
        product = PRODUCT * self.rows * k * vectors
        iteration = ITERATION + OPERATION * self.field * vectors + product
        return STEP + ROW * self.rows * vectors + iterations * iteration


def choose(system: System, tol: float, *, lanes: bool = False) -> tuple[int, int, float | None]:
    """Return k, s and what the quadrature's error is bounded by.

    The cheapest of the methods with 8 and with 16 nodes, by `Work.per_time`; but HBVM(16, 14), or in lanes
    HBVM(8, 7), where no other is much cheaper. In lanes HBVM(12, 11) takes its place where the energy is
    a polynomial whose forces are not linear. A field that depends on the time, or is code, has sixteen
    nodes, which see shorter pulses; not where the time only switches it at times that are known. A
    polynomial energy of degree nu is conserved exactly by k >= nu s/2 nodes and needs no bound on the
    quadrature's error.

    Parameters
    ----------
    system : System
        What to integrate.
    tol : float
        Local error per step.
    lanes : bool
        Whether for many trajectories side by side.

    Returns
    -------
    k, s : int
        Of HBVM(k, s).
    quadrature_error : float or None
        Bound on the estimated error of a step's quadrature; ``None``: it is 0, or there is no
        energy to keep.
    """
    work = Work.counted(system, lanes=lanes)
    nu, keeps = _degree(system), system.energy is not None or bool(system.on_manifold)

    def bound(k: int, s: int) -> float | None:
        exact = not keeps or (nu is not None and exact_k(nu, s) <= k)
        return None if exact else QUADRATURE_ERRORS[k]

    # What a field does between its nodes is not seen; only in time, or where it is code, is it likely.
    seen = system.traced and not depends_on_time_between_switches(system)
    usual = (NARROW, NARROW - 1) if lanes and seen else (WIDE, WIDE - SPARE)
    methods = [(WIDE, s) for s in range(2, WIDE - SPARE + 1)]
    if seen:
        methods += [(NARROW, s) for s in range(2, NARROW)]
    costs = {(k, s): work.per_time(k, s, tol, bound(k, s)) for k, s in methods}
    k, s = min(methods, key=lambda method: (costs[method], -method[1]))
    if costs[k, s] > GAIN * costs[usual]:
        k, s = usual
    if lanes and (k, s) == (NARROW, NARROW - 1) and work.second and nu is not None and nu > 2:
        return BETWEEN, BETWEEN - 1, bound(BETWEEN, BETWEEN - 1)
    # Of methods as cheap, the one of the highest order.
    k, s = max((m for m in methods if m[0] == k and costs[m] <= 1.001 * costs[k, s]), key=lambda m: m[1])
    return k, s, bound(k, s)
