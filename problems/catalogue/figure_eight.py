"""Three equal masses that chase each other along a figure eight, from the start found by C. Simo."""

from problems.bodies import gravity
from problems.checks import Positive
from problems.entry import Expected, entry
from problems.picture import Orbits
from problems.problem import Problem

# The published eight digits (0.97000436, 0.24308753; 0.93240737, 0.86473146; 6.32591398) hold the
# positions; the velocity of the third body and the period are refined to them by Newton's method.
POSITION = (0.97000436, -0.24308753)
VELOCITY = (-0.93240736813907869742, -0.86473146183495370212)
PERIOD = 6.3259140097821386327


@entry(
    title="the figure eight of three bodies",
    references=(
        "A. Chenciner, R. Montgomery, A remarkable periodic solution of the three-body problem "
        "in the case of equal masses, Annals of Mathematics 152 (2000) 881-901",
    ),
    notes="A stable periodic orbit without a dominant mass.",
    picture=Orbits(span=PERIOD, points=600),
    expected=Expected(h=0.05, energy=5e-16, default=2e-15),
)
def figure_eight(*, momentum: Positive = 1.0, t_end: float = 100 * PERIOD) -> Problem:
    """Return three equal masses that chase each other along a figure eight; G = 1.

    Tests a stable periodic orbit without a dominant mass: after a period every
    body is back.

    Parameters
    ----------
    momentum : float
        Factor of all momenta at the start, > 0. Any other than 1 perturbs the orbit: with 0.8 two bodies
        come within 0.0024 of each other.
    t_end : float
        End of the integration; 100 periods by default.

    Returns
    -------
    Problem
        State: positions in the plane body by body, then momenta. Invariants:
        energy, linear momentum (0), angular momentum (0).
    """
    (x, y), (u, v) = POSITION, [momentum * w for w in VELOCITY]
    return Problem(
        gravity.hamiltonian((1.0, 1.0, 1.0), name="figure_eight", dimension=2),
        q0=[x, y, -x, -y, 0.0, 0.0],
        p0=[-u / 2, -v / 2, -u / 2, -v / 2, u, v],
        t_end=t_end,
    )
