"""A fit: frequency, damping and start of a pendulum from 60 noisy angles, beside diffrax."""

from functools import partial

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares
from side_by_side import Comparison, tolerances

import integrators
import problems

jax.config.update("jax_enable_x64", True)
TIMES, NOISE = np.linspace(0.25, 15.0, 60), 0.01
TRUE, GUESS = np.array([1.3, 0.08, 1.2, 0.3]), np.array([1.2, 0.0, 1.0, 0.0])


def damped(y, par, m):
    """Return the derivative of a damped pendulum."""
    return [y[1], -(par.w**2) * m.sin(y[0]) - par.c * y[1]]


SYSTEM = problems.VectorField(damped, dim=2, parameters={"w": 1.0, "c": 0.0})


def ours(angles: np.ndarray, tol: float) -> np.ndarray:
    """Return the fit; the Jacobian comes from `variations`."""
    problem = problems.Problem(SYSTEM, y0=TRUE[2:], t_end=15.0)

    def solved(x: np.ndarray) -> integrators.Solution:
        at = problem.replace(y0=x[2:], parameters={"w": x[0], "c": x[1]})
        return integrators.integrate(at, integrators.HBVM(tol=tol), TIMES, variations=["w", "c", "y0"])

    return least_squares(
        lambda x: solved(x).y[:, 0] - angles, GUESS, lambda x: solved(x).variations[:, 0], xtol=1e-12
    ).x


@jax.jit
def angles_of(x: jax.Array, tol: float) -> jax.Array:
    """Return the angles at `TIMES` by diffrax."""
    term = diffrax.ODETerm(lambda t, y, x: jnp.stack([y[1], -(x[0] ** 2) * jnp.sin(y[0]) - x[1] * y[1]]))
    made = diffrax.diffeqsolve(
        term, diffrax.Dopri8(), 0.0, 15.0, None, x[2:], args=x, adjoint=diffrax.ForwardMode(),
        saveat=diffrax.SaveAt(ts=TIMES), stepsize_controller=diffrax.PIDController(tol, tol),
    )  # fmt: skip
    return made.ys[:, 0]


jacobian_of = jax.jit(jax.jacfwd(angles_of))


def by_diffrax(angles: np.ndarray, tol: float) -> np.ndarray:
    """Return the fit; the Jacobian is that of the program, forwards."""
    return least_squares(
        lambda x: np.asarray(angles_of(x, tol)) - angles, GUESS,
        lambda x: np.asarray(jacobian_of(x, tol)), xtol=1e-12,
    ).x  # fmt: skip


def compare() -> Comparison:
    """Fit with both."""
    true = problems.Problem(SYSTEM, y0=TRUE[2:], t_end=15.0, parameters={"w": TRUE[0], "c": TRUE[1]})
    exact = integrators.integrate(true, integrators.HBVM(), TIMES).y[:, 0]
    angles = exact + NOISE * np.random.default_rng(0).standard_normal(TIMES.size)
    best = ours(angles, tol=1e-14)
    made = Comparison("A fit: four numbers of a pendulum from 60 angles", "of the numbers", 1e-6)

    def error(x: np.ndarray) -> float:
        return np.abs(x - best).max()

    made.add("HBVM, variations", tolerances(partial(ours, angles), 1e-12, 1e-10, 1e-8, 1e-6), error)
    diffraxs = tolerances(partial(by_diffrax, angles), 1e-12, 1e-10, 1e-8, 1e-6)
    made.add("diffrax's Dopri8, jacfwd", diffraxs, error)
    return made


if __name__ == "__main__":
    print(compare())
