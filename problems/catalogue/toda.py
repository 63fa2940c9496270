"""The periodic Toda lattice, with all its integrals.

    H(q, p) = sum_{i=1..n} p_i^2/2 + sum_{i=1..n} exp(q_i - q_{i+1}),   q_{n+1} = q_1

Integrable, as Henon and Flaschka found: the integrals are the coefficients of the
characteristic polynomial of the periodic Jacobi matrix L with the diagonal p_i and the
squared off-diagonals exp(q_i - q_{i+1}).
"""

from typing import Annotated, Any

from problems import limits
from problems.catalogue import _starts as starts
from problems.checks import Positive, at_least
from problems.entry import Expected, entry
from problems.picture import Lattice
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian

MOST_INTEGRALS = 16  # their formulas grow with n^2


def _continuant(diagonal: list[Any], squares: list[Any]) -> list[Any]:
    """Return the coefficients, the highest power (1) left out, of det(x - J) for a Jacobi matrix J.

    ``K_j = (x - d_j) K_{j-1} - s_{j-1} K_{j-2}``; coefficients from the power
    len - 1 down to 0.
    """
    before: list[Any] = []
    now: list[Any] = [-diagonal[0]] if diagonal else []
    for j in range(1, len(diagonal)):
        # 1 stands before each list: K_{j-1} = x^j + now, K_{j-2} = x^{j-1} + before.
        shifted = [*now, 0]
        scaled = [diagonal[j] * c for c in [1, *now]]
        lower = [0, *(squares[j - 1] * c for c in [1, *before])]
        before, now = now, [a - b - c for a, b, c in zip(shifted, scaled, lower, strict=True)]
    return now


def _integrals(n: int) -> Any:
    def integrals(q, p, m):
        diagonal = list(p)
        squares = [m.exp(q[i] - q[(i + 1) % n]) for i in range(n)]
        whole = _continuant(diagonal, squares)
        inner = [1, *_continuant(diagonal[1:-1], squares[1:-2])]
        # The corner of the periodic matrix takes s_n times the inner determinant off the powers
        # n - 2 to 0, and a constant off the last one.
        return whole[:1] + [a - squares[-1] * b for a, b in zip(whole[1:], inner, strict=True)]

    return integrals


@entry(
    title="the Toda lattice",
    references=(
        "M. Toda, Vibration of a chain with nonlinear interaction, Journal of the Physical "
        "Society of Japan 22 (1967) 431-436",
        "M. Henon, Integrals of the Toda lattice, Physical Review B 9 (1974) 1921-1923",
        "H. Flaschka, The Toda lattice II, Physical Review B 9 (1974) 1924-1925",
    ),
    notes="Integrable: every integral can be watched. Exponential forces.",
    shows=("n",),
    picture=Lattice(moving=True, span=40.0, points=300),
    expected=Expected(h=0.1, energy=3e-16, default=2e-15, small={"n": 5}),
)
def toda(
    *,
    n: Annotated[int, at_least(3)] = 8,
    spread: Positive = 1.0,
    seed: Annotated[int, at_least(0)] = 1,
    t_end: float = 100.0,
) -> Problem:
    """Return the periodic Toda lattice from equal distances and random momenta.

    Tests an integrable system: n integrals in involution can all be watched.

    Parameters
    ----------
    n : int
        Number of masses, at least 3.
    spread : float
        Standard deviation of the random momenta at the start.
    seed : int
        Of the momenta.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[q_1 .. q_n, p_1 .. p_n]``; invariants: energy, momentum, and for
        n <= 16 the vector ``integrals`` of all n: the coefficients of
        det(x - L) from x^{n-1} to 1, of which the first is minus the momentum and the
        second is half its square less H. (The constant 2 that the corners add to the
        last one is left out.)
    """
    limits.check_problem("toda", 2 * n, n=n)

    def energy(q, p, m):
        kinetic = m.sum(lambda i: p[i] * p[i] / 2, range(n))
        neighbours = [(i, (i + 1) % n) for i in range(n)]
        return kinetic + m.sum(lambda i, j: m.exp(q[i] - q[j]), neighbours)

    invariants: dict[str, Any] = {"momentum": lambda p, m: m.sum(lambda i: p[i], range(n))}
    if n <= MOST_INTEGRALS:
        invariants["integrals"] = _integrals(n)
    return Problem(
        Hamiltonian(energy, dof=n, invariants=invariants, name=f"toda_{n}"),
        q0=[0.0] * n,
        p0=[spread * draw for draw in starts.gaussians(seed, n)],
        t_end=t_end,
    )
