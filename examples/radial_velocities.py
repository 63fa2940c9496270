"""A fit of two planets to radial velocities of their star: ten numbers from 80 velocities, beside diffrax."""

from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize
from side_by_side import Comparison, tolerances

from integrators import HBVM
from integrators.plugins.diffrax import states
from problems import nbody
from problems.bodies import Orbit, Units, bodies_of

jax.config.update("jax_enable_x64", True)
UNIT, STAR, DAYS = "au, day, Msun", 0.33, 400.0
G = Units(UNIT).G
TIMES, NOISE = np.sort(np.random.default_rng(1).uniform(1.0, DAYS, 80)), 1e-6  # days, au a day (1.7 m/s)
ORBITS = [Orbit(a=0.21, e=0.05, f=0.4), Orbit(a=0.335, e=0.08, omega=1.0, f=2.0)]
TOLERANCES = (1e-10, 1e-8)
SYSTEM = nbody([STAR, 2.2e-3, 7e-4], orbits=ORBITS, unit=UNIT, t_end=DAYS)


def bodies(x: Any) -> tuple[Any, Any, Any]:
    """Return masses, positions and velocities about the centre of mass of planets in the plane.

    x: masses, positions (two numbers each) and velocities of the planets.
    """
    masses = jnp.concatenate([jnp.array([STAR]), x[:2]])
    planets = jnp.pad(x[2:].reshape(2, 2, 2), ((0, 0), (0, 0), (0, 1)))
    star = -jnp.einsum("i,kij->kj", x[:2], planets)[:, None] / STAR
    return masses, *jnp.concatenate([star, planets], axis=1)


def by_states(tol: float) -> Callable[[Any], Any]:
    """Return the star's velocities along the first axis as a function of x, by the native steps."""
    at = states(SYSTEM, HBVM(tol=tol), TIMES)

    def velocities(x: Any) -> Any:
        masses, q, v = bodies(x)
        y0 = jnp.concatenate([q.ravel(), (masses[:, None] * v).ravel()])
        return at(y0, jnp.append(masses, G))[:, 9] / STAR

    return velocities


def by_diffrax(tol: float) -> Callable[[Any], Any]:
    """Return the same function by diffrax."""

    def field(t: Any, y: Any, masses: Any) -> Any:
        between = y[0][None] - y[0][:, None]
        cubed = (jnp.sum(between**2, axis=2) + jnp.eye(3)) ** 1.5
        return jnp.stack([y[1], G * jnp.einsum("j,ijk,ij->ik", masses, between, 1.0 / cubed)])

    def velocities(x: Any) -> Any:
        masses, q, v = bodies(x)
        made = diffrax.diffeqsolve(
            diffrax.ODETerm(field), diffrax.Dopri8(), 0.0, DAYS, None, jnp.stack([q, v]), args=masses,
            saveat=diffrax.SaveAt(ts=TIMES),
            stepsize_controller=diffrax.PIDController(rtol=tol, atol=1e-3 * tol),
        )  # fmt: skip
        return made.ys[:, 1, 0, 0]

    return velocities


def fitted(velocities: Callable[[Any], Any], measured: Any, guess: Any, scale: Any) -> Any:
    """Return ``(x - guess) / scale`` of the best x, by BFGS with gradients in reverse."""

    def misfit(z: Any) -> Any:
        return jnp.sum(((velocities(guess + scale @ z) - measured) / NOISE) ** 2) / 2.0

    both = jax.jit(jax.value_and_grad(misfit))
    found = minimize(
        lambda z: tuple(map(np.asarray, both(z))), np.zeros(guess.size), jac=True, options={"gtol": 1e-5}
    )
    return found.x


def compare() -> Comparison:
    """Fit with both."""
    masses, q, v = bodies_of(SYSTEM)
    true = np.concatenate([masses[1:], q[1:, :2].ravel(), v[1:, :2].ravel()])
    random, precise = np.random.default_rng(2), by_states(1e-14)
    measured = np.asarray(precise(true)) + NOISE * random.standard_normal(TIMES.size)
    guess = true * (1.0 + 1e-3 * random.standard_normal(true.size))
    # Directions that the measurements tell apart, in their standard errors: BFGS needs few iterations.
    slopes = np.asarray(jax.jacrev(precise)(guess)) / NOISE
    scale = np.linalg.inv(np.linalg.qr(slopes).R)
    best = fitted(precise, measured, guess, scale)
    made = Comparison("A fit: two planets from 80 radial velocities", "in standard errors", 1e-3)
    for library, velocities in (("HBVM, states", by_states), ("diffrax's Dopri8, reverse", by_diffrax)):

        def fit(tol: float, velocities: Any = velocities) -> Any:
            return fitted(velocities(tol), measured, guess, scale)

        made.add(library, tolerances(fit, *TOLERANCES), lambda z: np.abs(z - best).max())
    return made


if __name__ == "__main__":
    print(compare())
