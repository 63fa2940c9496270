"""Hamiltonians drawn at random: eight families of five formulas, each with five draws of its numbers.

The formula (which terms, which couplings, how many degrees of freedom) is drawn once for five problems, so
that every library compiles it once; coefficients, start and integration interval are drawn for each.
Everything follows from `SEED`, the family and the two counters: problem 17 is the same for everybody.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from problems import Hamiltonian, Problem

SEED = 20261123
FORMULAS = 5  # of each family
DRAWS = 5  # of each formula
Random = np.random.Generator


@dataclass(frozen=True)
class Drawn:
    """A formula, and how its numbers are drawn.

    Attributes
    ----------
    H : callable
        As `problems.Hamiltonian` takes it; ``par.c`` are its coefficients.
    dof : int
        Degrees of freedom.
    numbers : callable
        ``numbers(random) -> (c, q0, p0, t_end)``.
    """

    H: Callable[..., Any]
    dof: int
    numbers: Callable[[Random], tuple[Any, Any, Any, float]]


def _kinetic(p: Any) -> Any:
    return sum(momentum**2 for momentum in p) / 2


def _squares(q: Any) -> Any:
    return sum(coordinate**2 for coordinate in q)


def _span(random: Random, low: float = 20.0, high: float = 60.0) -> float:
    return round(float(random.uniform(low, high)), 2)


def _powers(random: Random, dof: int, count: int) -> list[tuple[int, ...]]:
    """Return so many different monomials of degree 2 to 4."""
    known = [powers for powers in itertools.product(range(5), repeat=dof) if 2 <= sum(powers) <= 4]
    return [known[i] for i in random.choice(len(known), size=min(count, len(known)), replace=False)]


def _monomial(q: Any, powers: tuple[int, ...]) -> Any:
    product = 1.0
    for coordinate, power in zip(q, powers, strict=True):
        if power:
            product = coordinate**power * product
    return product


def polynomial(random: Random) -> Drawn:
    """Return a particle in a polynomial well, closed by the square of |q|^2."""
    dof = int(random.integers(1, 4))
    terms = _powers(random, dof, int(random.integers(2, 7)))

    def H(q, p, par):
        well = sum(par.c[i] * _monomial(q, powers) for i, powers in enumerate(terms))
        return _kinetic(p) + well + par.c[len(terms)] * _squares(q) ** 2

    def numbers(random: Random) -> tuple[Any, Any, Any, float]:
        c = random.uniform(-1.0, 1.0, len(terms))
        quartic = sum(abs(value) for value, powers in zip(c, terms, strict=True) if sum(powers) == 4)
        c = [*c, quartic + random.uniform(0.1, 0.5)]  # so that no trajectory escapes
        return c, random.uniform(-1.2, 1.2, dof), random.uniform(-1.0, 1.0, dof), _span(random)

    return Drawn(H, dof, numbers)


def trigonometric(random: Random) -> Drawn:
    """Return pendulums and rotors: a sum of cosines of whole combinations of the angles."""
    dof = int(random.integers(1, 4))
    waves = random.integers(-2, 3, (int(random.integers(1, 5)) + dof, dof)).tolist()
    waves[:dof] = np.eye(dof, dtype=int).tolist()

    def H(q, p, par, m):
        potential = 0.0
        for i, wave in enumerate(waves):
            angle = sum(k * coordinate for k, coordinate in zip(wave, q, strict=True) if k)
            potential = potential - par.c[2 * i] * m.cos(angle + par.c[2 * i + 1])
        return _kinetic(p) + potential

    def numbers(random: Random) -> tuple[Any, Any, Any, float]:
        c = np.stack([random.uniform(0.2, 1.5, len(waves)), random.uniform(0, 2 * np.pi, len(waves))], 1)
        return c.ravel(), random.uniform(-3.0, 3.0, dof), random.uniform(-2.0, 2.0, dof), _span(random)

    return Drawn(H, dof, numbers)


def central(random: Random) -> Drawn:
    """Return attraction by centres, singular there: eccentric orbits, with other forces added."""
    dof, logarithm = int(random.integers(2, 4)), bool(random.integers(3) == 0)
    added = str(random.choice(["none", "inverse cube", "field", "anisotropic", "second centre"]))

    def H(q, p, par, m):
        r2 = _squares(q)
        total = _kinetic(p) + (m.log(r2) / 2 if logarithm else -1.0 / m.sqrt(r2))
        if added == "inverse cube":
            return total - par.c[0] / (r2 * m.sqrt(r2))
        if added == "field":
            return total + par.c[0] * q[0]
        if added == "anisotropic":
            return total + par.c[0] * p[0] ** 2
        if added == "second centre":
            away = (q[0] - 3.0) ** 2 + _squares(q[1:])
            return total - par.c[0] / m.sqrt(away)
        return total + par.c[0] * r2

    def numbers(random: Random) -> tuple[Any, Any, Any, float]:
        c = [random.uniform(1e-3, 0.05)]
        q, p = np.zeros(dof), np.zeros(dof)
        q[0], p[1] = random.uniform(0.7, 1.3), random.uniform(0.2, 1.1)  # 0.2: to a fiftieth of the distance
        q[2:], p[2:] = random.uniform(-0.2, 0.2, dof - 2), random.uniform(-0.2, 0.2, dof - 2)
        return c, q, p, _span(random)

    return Drawn(H, dof, numbers)


def nonseparable(random: Random) -> Drawn:
    """Return a mass matrix that depends on the position, or a magnetic field, in a well."""
    dof = int(random.integers(2, 4))
    kind = str(random.choice(["cosine", "rational", "exponential", "magnetic"]))
    first, second = random.choice(dof, size=2, replace=False).tolist()
    factor = random.integers(1, 3)

    def H(q, p, par, m):
        well = sum(par.c[2 + i] * q[i] ** 2 for i in range(dof)) / 2 + par.c[1] * _squares(q) ** 2
        if kind == "cosine":
            return _kinetic(p) + par.c[0] * p[first] * p[second] * m.cos(factor * q[first]) + well
        if kind == "rational":
            return _kinetic(p) + par.c[0] * p[first] ** 2 / (1.0 + q[second] ** 2) + well
        if kind == "exponential":
            return _kinetic(p) * m.exp(-par.c[0] * _squares(q)) + well
        strength = par.c[0] * (1.0 + q[first] * q[second])
        return _kinetic(p) + strength * (q[first] * p[second] - q[second] * p[first]) + well

    def numbers(random: Random) -> tuple[Any, Any, Any, float]:
        c = [random.uniform(0.1, 0.7), random.uniform(0.05, 0.3), *random.uniform(0.3, 2.0, dof)]
        return c, random.uniform(-1.0, 1.0, dof), random.uniform(-1.0, 1.0, dof), _span(random)

    return Drawn(H, dof, numbers)


def lattice(random: Random) -> Drawn:
    """Return a ring of sites with nonlinear springs and a potential at each site."""
    n = int(random.integers(4, 9))
    spring = str(random.choice(["quartic", "exponential", "cosine"]))
    site = str(random.choice(["none", "quartic", "cosine"]))

    def H(q, p, par, m):
        total = _kinetic(p)
        for i in range(n):
            r = q[(i + 1) % n] - q[i]
            if spring == "quartic":
                total = total + r**2 / 2 + par.c[0] * r**3 / 3 + par.c[1] * r**4 / 4
            elif spring == "exponential":
                total = total + m.exp(par.c[1] * r) - par.c[1] * r
            else:
                total = total + 1.0 - m.cos(par.c[1] * r)
            if site == "quartic":
                total = total + par.c[2] * q[i] ** 2 / 2 + par.c[2] * q[i] ** 4 / 4
            elif site == "cosine":
                total = total - par.c[2] * m.cos(q[i])
        return total

    def numbers(random: Random) -> tuple[Any, Any, Any, float]:
        c = [random.uniform(-0.5, 0.5), random.uniform(0.5, 1.0), random.uniform(0.1, 1.0)]
        p = random.uniform(-1.0, 1.0, n)
        return c, random.uniform(-0.7, 0.7, n), p - p.mean(), _span(random, 15.0, 40.0)

    return Drawn(H, n, numbers)


def driven(random: Random) -> Drawn:
    """Return wells and pendulums with a periodic force: no energy is conserved."""
    dof = int(random.integers(1, 3))
    angle, parametric = bool(random.integers(2)), bool(random.integers(2))
    waves = int(random.integers(1, 3))

    def H(t, q, p, par, m):
        force = sum(par.c[2 + 2 * i] * m.cos(par.c[3 + 2 * i] * t) for i in range(waves))
        rest = [-m.cos(term) if angle else term**4 / 4 - term**2 / 2 for term in q]
        couple = par.c[0] * _monomial(q, (1,) * dof) if dof > 1 and not angle else 0.0
        first = (1.0 + force) * rest[0] if parametric else rest[0] - force * q[0]
        return _kinetic(p) + first + sum(par.c[1] * term for term in rest[1:]) + couple

    def numbers(random: Random) -> tuple[Any, Any, Any, float]:
        forces = np.stack([random.uniform(0.05, 0.5, waves), random.uniform(0.5, 5.0, waves)], 1)
        c = [random.uniform(-0.2, 0.2), random.uniform(0.5, 1.5), *forces.ravel()]
        return c, random.uniform(-1.0, 1.0, dof), random.uniform(-0.7, 0.7, dof), _span(random)

    return Drawn(H, dof, numbers)


def particles(random: Random) -> Drawn:
    """Return two or three particles in the plane that attract and repel each other, in a weak trap."""
    n = int(random.integers(2, 4))
    force = str(random.choice(["Lennard-Jones", "Morse", "screened", "softened"]))

    def H(q, p, par, m):
        total = _kinetic(p) + par.c[0] * _squares(q)
        for i, j in itertools.combinations(range(n), 2):
            r2 = (q[2 * i] - q[2 * j]) ** 2 + (q[2 * i + 1] - q[2 * j + 1]) ** 2
            if force == "Lennard-Jones":
                s = 1.0 / r2**3
                total = total + par.c[1] * (s * s - 2.0 * s)
            elif force == "Morse":
                away = m.exp(-2.0 * (m.sqrt(r2) - 1.0))
                total = total + par.c[1] * (away * away - 2.0 * away)
            elif force == "screened":
                r = m.sqrt(r2)
                total = total + par.c[1] * m.exp(-par.c[2] * r) / r
            else:
                total = total - par.c[1] / m.sqrt(r2 + par.c[2] ** 2 / 25.0)
        return total

    def numbers(random: Random) -> tuple[Any, Any, Any, float]:
        c = [random.uniform(0.01, 0.1), random.uniform(0.5, 2.0), random.uniform(0.2, 1.0)]
        around = 2 * np.pi * np.arange(n) / n
        q = (
            np.stack([np.cos(around), np.sin(around)], 1)
            / (2 * np.sin(np.pi / n))
            * random.uniform(0.95, 1.3)
        )
        q, p = q.ravel() + random.uniform(-0.1, 0.1, 2 * n), random.uniform(-0.5, 0.5, 2 * n)
        return c, q, p, _span(random, 10.0, 30.0)

    return Drawn(H, 2 * n, numbers)


def stiff(random: Random) -> Drawn:
    """Return fast oscillators, 10 to 100 times as fast as the slow motion that they are coupled to."""
    slow, fast = int(random.integers(1, 3)), int(random.integers(1, 3))
    coupling = str(random.choice(["square", "cosine", "product"]))

    def H(q, p, par, m):
        total = _kinetic(p)
        for i in range(slow):
            total = total + q[i] ** 2 / 2 + par.c[0] * q[i] ** 4
        for j in range(slow, slow + fast):
            total = total + (par.c[j - slow + 1] * q[j]) ** 2 / 2
            if coupling == "square":
                total = total + q[0] ** 2 * q[j] ** 2 * par.c[1]
            elif coupling == "cosine":
                total = total + m.cos(q[0] + q[j])
            else:
                total = total + q[0] ** 2 * q[j]
        return total

    def numbers(random: Random) -> tuple[Any, Any, Any, float]:
        frequencies = 10.0 ** random.uniform(1.0, 2.0, fast)
        c = [random.uniform(0.05, 0.3), *frequencies]
        q = np.append(random.uniform(-1.0, 1.0, slow), random.uniform(-1.0, 1.0, fast) / frequencies)
        return c, q, random.uniform(-1.0, 1.0, slow + fast), _span(random, 4.0, 10.0)

    return Drawn(H, slow + fast, numbers)


FAMILIES: dict[str, Callable[[Random], Drawn]] = {
    "polynomial wells": polynomial,
    "pendulums and rotors": trigonometric,
    "singular central forces": central,
    "non-separable": nonseparable,
    "lattices": lattice,
    "driven": driven,
    "particles": particles,
    "two time scales": stiff,
}
COUNT = len(FAMILIES) * FORMULAS * DRAWS


def family_of(number: int) -> str:
    """Return the family of a problem."""
    return list(FAMILIES)[number // (FORMULAS * DRAWS)]


@lru_cache(maxsize=8)  # the draws of a formula follow each other
def _formula(number: int) -> tuple[Drawn, dict[int, Hamiltonian]]:
    family = number // FORMULAS
    random = np.random.default_rng([SEED, family, number % FORMULAS])
    return list(FAMILIES.values())[family](random), {}


def problem(number: int) -> Problem:
    """Return a random problem.

    Parameters
    ----------
    number : int
        From 0 to ``COUNT - 1``; `DRAWS` problems in a row have one formula.
    """
    formula, draw = divmod(number, DRAWS)
    drawn, system = _formula(formula)
    random = np.random.default_rng([SEED, formula // FORMULAS, formula % FORMULAS, 1 + draw])
    c, q0, p0, t_end = drawn.numbers(random)
    c = np.round(np.asarray(c, dtype=float), 6).tolist()
    if not system:
        system[0] = Hamiltonian(drawn.H, dof=drawn.dof, parameters={"c": c}, name=f"random_{formula}")
    start = {"q0": np.round(q0, 6), "p0": np.round(p0, 6)}
    return Problem(
        system[0], **start, parameters={"c": c}, t_end=t_end, title=f"{family_of(number)}, {number}"
    )
