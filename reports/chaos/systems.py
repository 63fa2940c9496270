"""Fifteen systems whose Lyapunov exponents are published, with the values, and where these stand.

For most systems the divergence of the vector field is a constant, which is the sum of the exponents; a
published spectrum with another sum is wrong in some digit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from problems import Hamiltonian, Problem, VectorField
from problems.catalogue.henon_heiles import henon_heiles

SPROTT, SIMPLE, WOLF = "Sprott 2003", "Sprott 1994", "Wolf et al. 1985"
RUSYN, DYSTS = "Rusyn 2019", "dysts"
SOURCES = {
    SPROTT: "J. C. Sprott, Chaos and Time-Series Analysis, Oxford University Press 2003, as quoted by the "
    "package lorenzpy",
    SIMPLE: "J. C. Sprott, Some simple chaotic flows, Physical Review E 50 (1994), R647, as quoted by "
    "X. Wang, N. V. Kuznetsov, G. Chen (editors), Chaotic Systems with Multistability and Hidden Attractors, "
    "Springer 2021, chapter 1",
    WOLF: "A. Wolf, J. B. Swift, H. L. Swinney, J. A. Vastano, Physica D 16 (1985), 285-317, to base e by "
    "Sprott",
    RUSYN: "V. Rusyn, Journal of Telecommunication, Electronic and Computer Engineering 11 (2019), 43-47, as "
    "quoted by the package lorenzpy",
    DYSTS: "W. Gilpin, the data set dysts, entry `HenonHeiles` of chaotic_attractors.json",
}
"""Where the published values stand."""


@dataclass(frozen=True)
class Published:
    """Exponents as they were published.

    Attributes
    ----------
    exponents : tuple of float
        The largest first, without those that are 0; of the Henon-Heiles problem all four.
    source : str
        A key of `SOURCES`.
    """

    exponents: tuple[float, ...]
    source: str


@dataclass(frozen=True)
class Known:
    """A system with published exponents.

    Attributes
    ----------
    title : str
        Its name, with its parameters.
    field : callable
        The derivative, of the arguments that it names; or the energy, where ``canonical``.
    y0 : tuple of float
        The initial state.
    t_end : float
        The end of the averages, which begin at `SKIP`.
    divergence : float or None
        Of the vector field where it is a constant.
    published : sequence of Published
        The values.
    canonical : bool
        Whether ``field`` is the energy of a system with one degree of freedom.
    """

    title: str
    field: Callable[..., Any]
    y0: tuple[float, ...]
    t_end: float
    divergence: float | None
    published: Sequence[Published]
    canonical: bool = False

    def problem(self, share: float = 1.0) -> Problem:
        """Return the problem over a share of the time."""
        t_end = SKIP + share * (self.t_end - SKIP)
        if self.field is henon_heiles:
            # the start of the data set dysts
            return Problem(henon_heiles().system, y0=self.y0, t_end=t_end)
        if self.canonical:
            return Problem(Hamiltonian(self.field, dof=1), y0=self.y0, t_end=t_end)
        return Problem(VectorField(self.field, dim=len(self.y0)), y0=self.y0, t_end=t_end)


SKIP = 50.0  # time to the attractor


def _lorenz(y: Any) -> Any:
    return [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 * y[2] / 3]


def _lorenz_wolf(y: Any) -> Any:
    return [16 * (y[1] - y[0]), y[0] * (45.92 - y[2]) - y[1], y[0] * y[1] - 4 * y[2]]


def _rossler(y: Any) -> Any:
    return [-y[1] - y[2], y[0] + 0.2 * y[1], 0.2 + y[2] * (y[0] - 5.7)]


def _chen(y: Any) -> Any:
    return [35 * (y[1] - y[0]), -7 * y[0] - y[0] * y[2] + 28 * y[1], y[0] * y[1] - 3 * y[2]]


def _thomas(y: Any, m: Any) -> Any:
    return [m.sin(y[1]) - 0.18 * y[0], m.sin(y[2]) - 0.18 * y[1], m.sin(y[0]) - 0.18 * y[2]]


def _windmi(y: Any, m: Any) -> Any:
    return [y[1], y[2], 2.5 - 0.7 * y[2] - y[1] - m.exp(y[0])]


def _rucklidge(y: Any) -> Any:
    return [6.7 * y[1] - 2 * y[0] - y[1] * y[2], y[0], y[1] ** 2 - y[2]]


def _quadratic_jerk(y: Any) -> Any:
    return [y[1], y[2], y[1] ** 2 - 2.017 * y[2] - y[0]]


def _cubic_jerk(y: Any) -> Any:
    return [y[1], y[2], y[0] * y[1] ** 2 - 2.028 * y[2] - y[0]]


def _driven(t: Any, q: Any, p: Any, m: Any) -> Any:
    return p[0] ** 2 / 2 + q[0] ** 4 / 4 - q[0] * m.sin(1.88 * t)


def _ueda(t: Any, y: Any, m: Any) -> Any:
    return [y[1], 7.5 * m.sin(t) - 0.05 * y[1] - y[0] ** 3]


def _sprott_a(y: Any) -> Any:
    return [y[1], y[1] * y[2] - y[0], 1 - y[1] ** 2]


def _sprott_b(y: Any) -> Any:
    return [y[1] * y[2], y[0] - y[1], 1 - y[0] * y[1]]


def _sprott_f(y: Any) -> Any:
    return [y[1] + y[2], 0.5 * y[1] - y[0], y[0] ** 2 - y[2]]


SYSTEMS = {
    "lorenz": Known(
        "Lorenz, σ = 10, ρ = 28, β = 8/3",
        *(_lorenz, (0.0, -0.01, 9.0), 2000.0, -41 / 3, [Published((0.9056, -14.5723), SPROTT)]),
    ),
    "lorenz_wolf": Known(
        "Lorenz, σ = 16, ρ = 45.92, β = 4",
        *(_lorenz_wolf, (1.0, 1.0, 30.0), 1200.0, -21.0, [Published((1.50, -22.46), WOLF)]),
    ),
    "rossler": Known(
        "Rössler, a = b = 0.2, c = 5.7",
        *(_rossler, (-9.0, 0.0, 0.0), 3000.0, None, [Published((0.0714, -5.3943), SPROTT)]),
    ),
    "chen": Known(
        "Chen, a = 35, b = 3, c = 28",
        *(_chen, (-10.0, 0.0, 37.0), 1500.0, -10.0, [Published((2.0272, -12.0272), SPROTT)]),
    ),
    "thomas": Known(
        "Thomas, b = 0.18",
        *(_thomas, (0.1, 0.0, 0.0), 30000.0, -0.54, [Published((0.0349, -0.5749), SPROTT)]),
    ),
    "windmi": Known(
        "WINDMI, a = 0.7, b = 2.5",
        *(_windmi, (0.0, 0.8, 0.0), 20000.0, -0.7, [Published((0.0755, -0.7755), SPROTT)]),
    ),
    "rucklidge": Known(
        "Rucklidge, κ = 2, λ = 6.7",
        *(_rucklidge, (1.0, 0.0, 4.5), 10000.0, -3.0),
        [Published((0.0643, -3.0643), SPROTT), Published((0.1877, -3.1893), RUSYN)],
    ),
    "quadratic_jerk": Known(
        "simplest quadratic flow, a = 2.017",
        *(_quadratic_jerk, (-0.9, 0.0, 0.5), 16000.0, -2.017, [Published((0.0551, -2.0721), SPROTT)]),
    ),
    "cubic_jerk": Known(
        "simplest cubic flow, a = 2.028",
        *(_cubic_jerk, (0.0, 0.96, 0.0), 16000.0, -2.028, [Published((0.0837, -2.1117), SPROTT)]),
    ),
    "driven": Known(
        "simplest driven flow, ω = 1.88",
        *(_driven, (0.0, 0.0), 40000.0, 0.0, [Published((0.0971, -0.0971), SPROTT)]),
        canonical=True,
    ),
    "ueda": Known(
        "Ueda, b = 0.05, A = 7.5",
        *(_ueda, (2.5, 0.0), 15000.0, -0.05, [Published((0.1034, -0.1534), SPROTT)]),
    ),
    "sprott_a": Known(
        "Sprott A (Nosé–Hoover)",
        *(_sprott_a, (0.0, 5.0, 0.0), 40000.0, None, [Published((0.014, -0.014), SIMPLE)]),
    ),
    "sprott_b": Known(
        "Sprott B",
        *(_sprott_b, (0.05, 0.05, 0.05), 12000.0, -1.0, [Published((0.210, -1.210), SIMPLE)]),
    ),
    "sprott_f": Known(
        "Sprott F",
        *(_sprott_f, (0.05, 0.05, 0.05), 24000.0, -0.5, [Published((0.117, -0.617), SIMPLE)]),
    ),
    "henon_heiles": Known(
        "Hénon–Heiles",
        *(henon_heiles, (-0.29707259, -0.0031367513, 0.42548865, 0.071905482), 20000.0, 0.0),
        [Published((0.0267, 0.0115, 0.0, -0.0112), DYSTS)],
    ),
}
