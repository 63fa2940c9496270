"""Forces between bodies besides Newton's attraction.

A force adds accelerations to a `Motion`. One that has an energy in positions and momenta returns it too, and
then bodies that all have masses are a Hamiltonian system.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from problems.checks import CheckedOptions, Positive, at_least, refusal
from problems.errors import InputError, shown

Vector = list[Any]
Index = Annotated[int, at_least(0)]


class Motion:
    """What a force is a function of, and the accelerations that it adds to.

    Attributes
    ----------
    x, v : list
        Positions and velocities, three components for each body.
    masses : list
        Of the first n bodies, which have one.
    G : node or float
        The constant of gravitation.
    m : module
        Elementary functions.
    a : list
        The accelerations, three components for each body.
    newton : list
        Those of the bodies with mass by Newton's attraction.
    """

    def __init__(self, x: list[Vector], v: list[Vector], masses: list[Any], G: Any, m: Any):
        self.x, self.v, self.masses, self.G, self.m = x, v, masses, G, m
        self.a: list[Vector] = [[0.0] * 3 for _ in x]
        self.newton: list[Vector] = []

    @property
    def n(self) -> int:
        """Number of bodies with mass."""
        return len(self.masses)

    def mu(self, i: int) -> Any:
        """Return G times the mass of a body."""
        return self.G * self.masses[i]

    def between(self, i: int, j: int) -> tuple[Vector, Vector]:
        """Return position and velocity of body j with respect to body i."""
        x, v = self.x, self.v
        return [x[j][c] - x[i][c] for c in range(3)], [v[j][c] - v[i][c] for c in range(3)]

    def attract(self, softening: float | None) -> None:
        """Add Newton's attraction."""
        for j in range(len(self.x)):
            for i in range(min(j, self.n)):
                d, _ = self.between(i, j)
                square = dot(d, d) if softening is None else dot(d, d) + softening**2
                cubed = square * self.m.sqrt(square)
                self.pull(i, j, [-d[c] / cubed for c in range(3)])
        self.newton = [list(row) for row in self.a[: self.n]]

    def push(self, j: int, a: Vector) -> None:
        """Add an acceleration of body j, without a reaction."""
        self.a[j] = [self.a[j][c] + a[c] for c in range(3)]

    def pull(self, i: int, j: int, toward: Vector) -> None:
        """Add the acceleration of body j by body i, for G m_i = 1, and the reaction on body i."""
        for c in range(3):
            self.a[j][c] = self.a[j][c] + self.mu(i) * toward[c]
            if j < self.n:
                self.a[i][c] = self.a[i][c] - self.mu(j) * toward[c]


@dataclass(frozen=True)
class Force(CheckedOptions):
    """Base of the forces."""

    has_energy: ClassVar[bool] = False

    def sources(self) -> Sequence[int]:
        """Return the indices of the bodies that must have a mass."""
        return ()

    def named(self) -> Sequence[int]:
        """Return the indices of all bodies that the force names."""
        return self.sources()

    def act(self, on: Motion) -> None:
        """Add accelerations."""
        raise NotImplementedError

    def energy(self, q: Any, p: Any, masses: Any, G: Any, m: Any) -> Any:
        """Return the energy in positions and momenta, of a force with ``has_energy``."""
        raise NotImplementedError


class Harmonics(Force):
    """Zonal harmonics about the axis of a body."""

    has_energy: ClassVar[bool] = True
    R: float
    body: int
    pole: Sequence[float]

    def __post_init__(self) -> None:
        super().__post_init__()
        pole = np.array(self.pole, dtype=np.float64)
        if pole.shape != (3,) or not np.isfinite(pole).all() or not pole.any():
            raise refusal(type(self).__name__, "pole", self.pole, "three numbers, not all 0")
        object.__setattr__(self, "pole", tuple(pole.tolist()))

    def _coefficients(self) -> Mapping[int, float]:
        """Return the coefficients that are not 0, by degree."""
        degrees = {int(key[1:]): value for key, value in self._values().items() if key[0] == "J"}
        return {degree: value for degree, value in degrees.items() if value}

    def _axis(self) -> list[float]:
        return (np.array(self.pole) / np.linalg.norm(self.pole)).tolist()

    def sources(self) -> Sequence[int]:
        return (self.body,)

    def energy(self, q: Any, p: Any, masses: Any, G: Any, m: Any) -> Any:
        axis, total, i = self._axis(), 0.0, self.body
        for j in range(len(masses)):
            if j != i:
                d = [q[3 * j + c] - q[3 * i + c] for c in range(3)]
                inverse = 1 / m.sqrt(dot(d, d))
                values, _ = _legendre(dot(axis, d) * inverse)
                for degree, J in self._coefficients().items():
                    total = total + masses[j] * J * self.R**degree * values[degree] * inverse ** (degree + 1)
        return G * masses[i] * total

    def act(self, on: Motion) -> None:
        axis = self._axis()
        for j in range(len(on.x)):
            if j != self.body:
                d, _ = on.between(self.body, j)
                inverse = 1 / on.m.sqrt(dot(d, d))
                _, slopes = _legendre(dot(axis, d) * inverse)
                toward: Vector = [0.0] * 3
                for degree, J in self._coefficients().items():
                    size = J * self.R**degree * inverse ** (degree + 2)
                    outward, along = size * inverse * slopes[degree + 1], size * slopes[degree]
                    toward = [toward[c] + (outward * d[c] - along * axis[c]) for c in range(3)]
                on.pull(self.body, j, toward)


@dataclass(frozen=True)
class J2(Harmonics):
    """Oblateness of a body: the P2 term of its gravitational potential; see `Zonal`.

    Parameters
    ----------
    J2, R : float
        The coefficient, and the radius of the body that it belongs to.
    body : int
        Index of the oblate body.
    pole : sequence of float
        Direction of its axis: three numbers, not all 0.

    Examples
    --------
    >>> from problems.bodies import J2
    >>> J2(J2=1.0826e-3, R=6378.137)
    J2(J2=0.0010826, R=6378.137, body=0, pole=(0.0, 0.0, 1.0))
    """

    J2: float
    R: Positive
    body: Index = 0
    pole: Sequence[float] = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Zonal(Harmonics):
    """Zonal harmonics J2 to J6 of the gravitational potential of a body, about any axis.

    The potential energy with a body of mass m at the distance r and the height z above the equator is ``-(G M
    m/r) (1 - sum_n J_n (R/r)^n P_n(z/r))``, with Legendre's polynomials P_n; the forces on both bodies follow
    from it.

    Parameters
    ----------
    R : float
        The radius of the body that the coefficients belong to.
    J2, J3, J4, J5, J6 : float
        The coefficients.
    body : int
        Index of the body.
    pole : sequence of float
        Direction of its axis: three numbers, not all 0.

    References
    ----------
    W. M. Kaula, Theory of Satellite Geodesy, Blaisdell, 1966.

    Examples
    --------
    >>> from problems.bodies import Zonal
    >>> Zonal(R=6378.137, J2=1.0826e-3, J3=-2.53e-6).J3
    -2.53e-06
    """

    R: Positive
    J2: float = 0.0
    J3: float = 0.0
    J4: float = 0.0
    J5: float = 0.0
    J6: float = 0.0
    body: Index = 0
    pole: Sequence[float] = (0.0, 0.0, 1.0)


def _legendre(u: Any) -> tuple[list[Any], list[Any]]:
    """Return Legendre's polynomials of the degrees 0 to 7, and their derivatives."""
    values, slopes = [1.0, u], [0.0, 1.0]
    for n in range(1, 7):
        values.append(((2 * n + 1) * u * values[n] - n * values[n - 1]) / (n + 1))
        slopes.append(slopes[n - 1] + (2 * n + 1) * values[n])
    return values, slopes


@dataclass(frozen=True)
class PostNewtonian(Force):
    """First post-Newtonian corrections, of order 1/c^2, between all bodies (Einstein, Infeld and Hoffmann).

    The Hamiltonian, in ADM coordinates, has the additional terms the sum over a of
    ``-p_a^4/(8 m_a^3) + G^2 m_a (sum_b m_b/r_ab)^2/2`` and over pairs a, b, both ways, of
    ``-(G m_a m_b/(4 r_ab)) (6 p_a^2/m_a^2 - (7 p_a.p_b + (n_ab.p_a)(n_ab.p_b))/(m_a m_b))``, all over c^2.

    Beside massless bodies or forces without an energy it is the acceleration of Einstein, Infeld and
    Hoffmann in positions and velocities, in harmonic coordinates, which are those of ADM to this order. The
    two forms differ by terms of the order 1/c^4, and the energy is conserved to that order only. With other
    forces there are no terms of both.

    With ``body`` it is the field of that body only, at rest: the others have, with r and v relative to it,
    the acceleration ``(G M/(c^2 r^3)) ((4 G M/r - v^2) r + 4 (r.v) v)``, and it has their reaction.

    Parameters
    ----------
    c : float, optional
        The velocity of light, in the units of the bodies; by default that of ``unit=`` of `problems.nbody`.
    body : int, optional
        The only body whose field is relativistic; by default all are.

    References
    ----------
    A. Einstein, L. Infeld, B. Hoffmann, The gravitational equations and the problem of motion, Annals of
    Mathematics 39 (1938), 65-100. For one body: J. D. Anderson et al., Experimental test of general
    relativity using time-delay data from Mariner 6 and Mariner 7, The Astrophysical Journal 200 (1975),
    221-233.

    Examples
    --------
    >>> from problems.bodies import PostNewtonian
    >>> PostNewtonian(c=63241.077)  # au in a year
    PostNewtonian(c=63241.077, body=None)
    """

    c: Positive | None = None
    body: Index | None = None

    @property
    def has_energy(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether it has an energy in positions and momenta."""
        return self.body is None

    def sources(self) -> Sequence[int]:
        return () if self.body is None else (self.body,)

    def energy(self, q: Any, p: Any, masses: Any, G: Any, m: Any) -> Any:
        n = len(masses)
        momenta = [[p[3 * i + c] for c in range(3)] for i in range(n)]
        squares = [dot(momentum, momentum) for momentum in momenta]
        depth: list[Any] = [0.0] * n
        total = 0.0
        for a in range(n):
            total = total - squares[a] * squares[a] / (8 * masses[a] * masses[a] * masses[a])
            for b in range(a):
                d = [q[3 * a + c] - q[3 * b + c] for c in range(3)]
                r = m.sqrt(dot(d, d))
                along = dot(d, momenta[a]) * dot(d, momenta[b]) / (r * r)
                own = 3 * (squares[a] * masses[b] / masses[a] + squares[b] * masses[a] / masses[b])
                total = total - G / r * (own - (7 * dot(momenta[a], momenta[b]) + along)) / 2
                depth[a], depth[b] = depth[a] + masses[b] / r, depth[b] + masses[a] / r
        for a in range(n):
            total = total + G * G * masses[a] * depth[a] * depth[a] / 2
        return total / light(self) ** 2

    def act(self, on: Motion) -> None:
        if self.body is None:
            self._between_all(on)
            return
        mu = on.mu(self.body)
        for j in (j for j in range(len(on.x)) if j != self.body):
            d, v = on.between(self.body, j)
            square = dot(d, d)
            r = on.m.sqrt(square)
            outward, along = 4 * mu / r - dot(v, v), 4 * dot(d, v)
            factor = 1 / (square * r * light(self) ** 2)
            on.pull(self.body, j, [factor * (outward * d[c] + along * v[c]) for c in range(3)])

    def _between_all(self, on: Motion) -> None:
        """Add the accelerations of all bodies by those with mass."""
        x, v, n, total, c = on.x, on.v, on.n, len(on.x), light(self)
        mu = [on.mu(i) for i in range(n)]
        newton = on.newton
        depth: list[Any] = [0.0] * total
        r: dict[tuple[int, int], Any] = {}
        for a in range(total):
            for b in range(min(a, n)):
                d = [x[a][i] - x[b][i] for i in range(3)]
                r[a, b] = r[b, a] = on.m.sqrt(dot(d, d))
                depth[a] = depth[a] + mu[b] / r[a, b]
                if a < n:
                    depth[b] = depth[b] + mu[a] / r[a, b]
        for a in range(total):
            sums: list[Any] = [0.0] * 3
            for b in (b for b in range(n) if b != a):
                d = [x[b][i] - x[a][i] for i in range(3)]
                square = r[a, b] * r[a, b]
                along, inverse = dot(d, v[b]), mu[b] / (square * r[a, b])
                factor = (
                    dot(v[a], v[a]) + 2 * dot(v[b], v[b]) - 4 * dot(v[a], v[b])
                    - 1.5 * along * along / square - 4 * depth[a] - depth[b] + dot(d, newton[b]) / 2
                )  # fmt: skip
                drag = 3 * along - 4 * dot(d, v[a])
                for i in range(3):
                    sums[i] = sums[i] + (
                        inverse * (factor * d[i] + drag * (v[a][i] - v[b][i]))
                        + 3.5 * mu[b] / r[a, b] * newton[b][i]
                    )  # fmt: skip
            on.push(a, [component / c**2 for component in sums])


@dataclass(frozen=True)
class RadiationPressure(Force):
    """Radiation pressure of a body, and the Poynting-Robertson drag.

    The acceleration, with r and v relative to the source and beta the ratio of radiation pressure to gravity,
    is ``beta (G M/r^2) ((1 - v_r/c) r/|r| - v/c)``, to the order v/c. The source has no reaction: the
    radiation takes the momentum.

    Parameters
    ----------
    beta : float or sequence of float
        Of all bodies that it acts on, or of each.
    bodies : sequence of int, optional
        Indices of these; by default all but the source.
    source : int
        Index of the body that shines.
    c : float, optional
        The velocity of light, in the units of the bodies; by default that of ``unit=`` of `problems.nbody`.
    drag : bool
        Whether there are the terms with c; without them the body attracts less, and that is all.

    References
    ----------
    J. A. Burns, P. L. Lamy, S. Soter, Radiation forces on small particles in the solar system, Icarus 40
    (1979), 1-48, equation 5.

    Examples
    --------
    >>> from problems.bodies import RadiationPressure
    >>> RadiationPressure(beta=0.1, bodies=[2]).beta
    (0.1,)
    """

    beta: float | Sequence[float]
    bodies: Sequence[Index] | None = None
    source: Index = 0
    c: Positive | None = None
    drag: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        beta = np.atleast_1d(np.array(self.beta, dtype=np.float64))
        object.__setattr__(self, "beta", tuple(beta.tolist()))

    def sources(self) -> Sequence[int]:
        return (self.source,)

    def named(self) -> Sequence[int]:
        return (self.source, *(self.bodies or ()))

    def act(self, on: Motion) -> None:
        inverse = 1 / light(self) if self.drag else 0.0
        bodies = self.bodies or [j for j in range(len(on.x)) if j != self.source]
        beta: Any = self.beta
        if len(beta) not in (1, len(bodies)):
            raise InputError(
                f"RadiationPressure has {len(beta)} values of beta for {len(bodies)} bodies; give one, or "
                "as many."
            )
        for j, ratio in zip(bodies, beta * len(bodies) if len(beta) == 1 else beta, strict=True):
            d, v = on.between(self.source, j)
            square = dot(d, d)
            r = on.m.sqrt(square)
            outward = (1 - inverse * dot(d, v) / r) / r
            factor = ratio * on.mu(self.source) / square
            on.push(j, [factor * (outward * d[c] - inverse * v[c]) for c in range(3)])


@dataclass(frozen=True)
class Tides(Force):
    """Tides that the other bodies raise on a body, with a constant time lag.

    The force on a body of mass m at r, with the velocity v relative to the body with tides, is
    ``-(3 k2 G m^2 R^5/r^8) (r + tau (2 (r.v) r/r^2 + v + r x Omega))``, and the opposite one acts on the body
    with tides. The spin Omega stays what it is.

    Parameters
    ----------
    k2, R : float
        Love number of degree 2 and radius of the body with tides.
    tau : float
        The time lag.
    body : int
        Index of the body with tides.
    Omega : sequence of float
        Its angular velocity: three components.

    References
    ----------
    F. Mignard, The evolution of the lunar orbit revisited, I, The Moon and the Planets 20 (1979), 301-315;
    P. Hut, Tidal evolution in close binary systems, Astronomy and Astrophysics 99 (1981), 126-140.

    Examples
    --------
    >>> from problems.bodies import Tides
    >>> Tides(k2=0.03, R=0.005, tau=1e-7, body=0).Omega
    (0.0, 0.0, 0.0)
    """

    k2: float
    R: Positive
    tau: float = 0.0
    body: Index = 0
    Omega: Sequence[float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        spin = np.array(self.Omega, dtype=np.float64)
        if spin.shape != (3,) or not np.isfinite(spin).all():
            raise InputError(f"Omega={shown(self.Omega)} of Tides must be three numbers.")
        object.__setattr__(self, "Omega", tuple(spin.tolist()))

    def sources(self) -> Sequence[int]:
        return (self.body,)

    def act(self, on: Motion) -> None:
        spin = self.Omega
        for j in (j for j in range(on.n) if j != self.body):
            d, v = on.between(self.body, j)
            square = dot(d, d)
            turned = [d[a] * spin[b] - d[b] * spin[a] for a, b in ((1, 2), (2, 0), (0, 1))]
            radial = 1 + 2 * self.tau * dot(d, v) / square
            ratio = on.masses[j] / on.masses[self.body]
            factor = -3 * self.k2 * self.R**5 * ratio / (square * square * square * square)
            on.pull(
                self.body, j, [factor * (radial * d[c] + self.tau * (v[c] + turned[c])) for c in range(3)]
            )


@dataclass(frozen=True)
class Migration(Force):
    """Exponential decay of semi-major axis, eccentricity and inclination, as in a disc of gas.

    The acceleration, with r and v relative to the primary, is
    ``-v/(2 tau_a) - 2 (r.v) r/(r^2 tau_e) - 2 v_z z/tau_inc``: a, e and inc decay like exp(-t/tau), each to
    the first order in e and inc. Negative times are those of growth. There is no reaction.

    Parameters
    ----------
    tau_a, tau_e, tau_inc : float, optional
        The times, not 0; by default there is no decay.
    body : int
        Index of the body that migrates.
    primary : int
        Index of the body that its orbit is about.

    References
    ----------
    J. C. B. Papaloizou, J. D. Larwood, On the orbital evolution and growth of protoplanets embedded in a
    gaseous disc, Monthly Notices of the Royal Astronomical Society 315 (2000), 823-833.

    Examples
    --------
    >>> from problems.bodies import Migration
    >>> Migration(tau_a=1e5, tau_e=1e3, body=2).primary
    0
    """

    tau_a: float | None = None
    tau_e: float | None = None
    tau_inc: float | None = None
    body: Index = 1
    primary: Index = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("tau_a", "tau_e", "tau_inc"):
            if getattr(self, name) == 0.0:
                raise InputError(f"{name}=0.0 of Migration must be another time; leave it out for no decay.")
        if self.body == self.primary:
            raise InputError(f"body={self.body} of Migration must be another one than primary.")

    def named(self) -> Sequence[int]:
        return (self.body, self.primary)

    def act(self, on: Motion) -> None:
        d, v = on.between(self.primary, self.body)
        if self.tau_a is not None:
            on.push(self.body, [-v[c] / (2 * self.tau_a) for c in range(3)])
        if self.tau_e is not None:
            factor = -2 * dot(d, v) / (dot(d, d) * self.tau_e)
            on.push(self.body, [factor * d[c] for c in range(3)])
        if self.tau_inc is not None:
            on.push(self.body, [0.0, 0.0, -2 * v[2] / self.tau_inc])


def light(force: PostNewtonian | RadiationPressure) -> float:
    """Return the velocity of light that a force has.

    Raises
    ------
    problems.errors.InputError
        If it has none.
    """
    if force.c is None:
        raise InputError(f"{type(force).__name__} needs c=, or unit= of nbody, such as unit='au, yr, Msun'.")
    return force.c


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Return the product of two vectors in space."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
