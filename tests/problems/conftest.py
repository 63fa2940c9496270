"""Systems of every shape."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import problems
from problems import Hamiltonian, System, VectorField
from problems.catalogue import sitnikov


@dataclass(frozen=True)
class Case:
    """A system with the function it was made from."""

    name: str
    system: System
    function: Callable[..., Any]
    algebraic: bool = True  # + - * / sqrt and integer powers only
    ulps: float = 8.0


def _case(name: str, function: Callable[..., Any], dof: int, **options: Any) -> Case:
    flags = {key: options.pop(key) for key in ("algebraic", "ulps") if key in options}
    return Case(name, Hamiltonian(function, dof=dof, name=name, **options), function, **flags)


def henon_heiles(q, p):
    return (p[0] ** 2 + p[1] ** 2) / 2 + (q[0] ** 2 + q[1] ** 2) / 2 + q[0] ** 2 * q[1] - q[1] ** 3 / 3


def pendulum(q, p, par, m):
    return p[0] ** 2 / (2 * par.mass) - par.k * m.cos(q[0])


def kepler(q, p, m):
    return (p[0] ** 2 + p[1] ** 2) / 2 - 1 / m.sqrt(q[0] ** 2 + q[1] ** 2)


def double_pendulum(q, p, m):
    c = m.cos(q[0] - q[1])
    return (
        (p[0] ** 2 + 2 * p[1] ** 2 - 2 * p[0] * p[1] * c) / (2 * (2 - c * c)) - 2 * m.cos(q[0]) - m.cos(q[1])
    )


def magnetic(q, p, par, m):
    r2 = q[0] ** 2 + q[1] ** 2 + q[2] ** 2
    return (
        ((p[0] + par.b * q[1]) ** 2 + (p[1] - par.b * q[0]) ** 2 + p[2] ** 2) / 2 + r2**-1.5 + q[2] ** 5 / 7
    )


def zoo(q, p, par, m):
    """Every function, with products and quotients of shared subexpressions."""
    x, y = q[0], q[1]
    r = m.sqrt(x * x + y * y)
    return (
        p[0] ** 2 * par.a
        + p[1] ** 2 / 2
        + m.exp(-r) / r
        + m.log(1 + x * x) * m.sin(y) / (2 + m.cos(x))
        + m.tan(x / 8)
        + m.abs(y) * r**3
        + 1.5 * (r - 1) ** 2
        + (x / r) ** 4
        + par.w[1] * x / (par.w[0] + y**2)
    )


def forced(q, p, t, m):
    return p[0] ** 2 / 2 + q[0] ** 4 / 4 - q[0] * m.cos(t)


def quartic(q, p):
    return (p[0] ** 2 + p[1] ** 2) ** 2 / 4 + p[0] * q[0] ** 7 - q[1] ** 6


def gravity(n: int) -> Callable[..., Any]:
    def H(q, p, par, m):
        def kinetic(i):
            return (p[3 * i] ** 2 + p[3 * i + 1] ** 2 + p[3 * i + 2] ** 2) / (2 * par.m[i])

        def potential(i, j):
            x, y, z = (q[3 * i + c] - q[3 * j + c] for c in range(3))
            return par.m[i] * par.m[j] / m.sqrt(x * x + y * y + z * z)

        pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
        return m.sum(kinetic, range(n)) - par.G * m.sum(potential, pairs)

    return H


def chain(n: int, *, periodic: bool) -> Callable[..., Any]:
    def H(q, p, par, m):
        def bond(i, j):
            d = q[j] - q[i]
            return d**2 / 2 + par.alpha * d**3 / 3 + par.beta * d**4 / 4

        bonds = [(i, (i + 1) % n) for i in range(n if periodic else n - 1)]
        ends = 0 if periodic else q[0] ** 2 / 2 + q[n - 1] ** 2 / 2
        return m.sum(lambda i: p[i] ** 2 / 2, range(n)) + m.sum(bond, bonds) + ends

    return H


def lennard_jones(n: int) -> Callable[..., Any]:
    def H(q, p, m):
        def pair(i, j):
            x, y = q[2 * i] - q[2 * j], q[2 * i + 1] - q[2 * j + 1]
            inverse = 1 / (x * x + y * y)
            sixth = inverse**3
            return 4 * (sixth * sixth - sixth)

        # A list that is no product of ranges: the pairs in a scrambled order.
        pairs = [(i, j) for i in range(n) for j in range(i)]
        pairs = [pairs[(7 * k) % len(pairs)] for k in range(len(pairs))]
        return m.sum(lambda i: (p[2 * i] ** 2 + p[2 * i + 1] ** 2) / 2, range(n)) + m.sum(pair, pairs)

    return H


def mean_field(n: int) -> Callable[..., Any]:
    """A product of sums: their derivatives need the sums themselves."""

    def H(q, p, par, m):
        x = m.sum(lambda i: m.cos(q[i]), range(n))
        y = m.sum(lambda i: m.sin(q[i]) * (i + 1), range(n))
        coupling = m.sum(lambda i: q[i] * q[0] * x, range(1, n))
        return m.sum(lambda i: p[i] ** 2 / 2, range(n)) - par.k * (x * x + y * y) / (2 * n) + coupling

    return H


def lorentz_like(t, y, par, m):
    return [par.s * (y[1] - y[0]), y[0] * (par.r - y[2]) - y[1], y[0] * y[1] - y[2] * m.cos(t) / 3]


MASSES = (1.0, 0.3, 2.5, 0.7, 1.1, 0.2, 3.0)
CASES = [
    _case("henon_heiles", henon_heiles, 2),
    _case("pendulum", pendulum, 1, parameters={"mass": 1.3, "k": 0.7}, algebraic=False),
    _case("kepler", kepler, 2),
    _case("double_pendulum", double_pendulum, 2, algebraic=False),
    _case("magnetic", magnetic, 3, parameters={"b": 0.3}),
    _case("zoo", zoo, 2, parameters={"a": 0.7, "w": [1.5, -0.4]}, algebraic=False),
    _case("forced", forced, 1, algebraic=False),
    _case("quartic", quartic, 2),
    _case("gravity", gravity(7), 21, parameters={"m": MASSES, "G": 0.9}),
    _case("chain", chain(40, periodic=False), 40, parameters={"alpha": 0.25, "beta": 1.0}),
    _case("ring", chain(9, periodic=True), 9, parameters={"alpha": 0.25, "beta": 1.0}),
    _case("lennard_jones", lennard_jones(5), 10, ulps=20.0),
    _case("mean_field", mean_field(6), 6, parameters={"k": 0.8}, algebraic=False),
    Case(
        "lorentz_like",
        VectorField(lorentz_like, dim=3, parameters={"s": 10.0, "r": 28.0}, name="lorentz_like"),
        lorentz_like,
        algebraic=False,
    ),
    Case("sitnikov", problems.load("sitnikov").system, sitnikov._energy),
]


@pytest.fixture(params=CASES, ids=[case.name for case in CASES])
def case(request: pytest.FixtureRequest) -> Case:
    return request.param


@pytest.fixture
def cases() -> dict[str, Case]:
    return {case.name: case for case in CASES}


@pytest.fixture
def states(case: Case) -> np.ndarray:
    """200 random states, one per row."""
    rng = np.random.default_rng(20261121)
    return rng.uniform(-2.0, 2.0, (200, case.system.dim))
