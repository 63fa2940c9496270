"""pyhamsys' symplectic compositions of a map and its adjoint, with compiled maps."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np

from integrators.peers import load
from integrators.protocol import Array, cite
from integrators.stepping import FixedStep, March
from problems.problem import System

Type = Literal[
    "Verlet", "FR", "Yo4", "Yo6", "Yo8", "Yos6", "M2", "M4", "EFRL", "PEFRL", "VEFRL",
    "BM4", "BM6", "RKN4b", "RKN6b", "RKN6a", "ABA104", "ABA864", "ABA1064",
]  # fmt: skip
ORDERS = {"Verlet": 2, "M2": 2, "Yo6": 6, "Yos6": 6, "BM6": 6, "RKN6a": 6, "RKN6b": 6, "Yo8": 8}
KICK_LAST = ("PEFRL", "RKN6a", "ABA104", "ABA864", "ABA1064")
"""Types that begin with a drift; the others begin with a kick, or do not care."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Composition(FixedStep):
    """pyhamsys' symplectic compositions: chi(a_1 h), chi*(a_2 h), chi(a_3 h), ... of a map and its adjoint.

    The map chi kicks and drifts, or drifts and kicks for the types made for that; chi* is its adjoint.
    It takes H = sum of c p^2/2 + V(q, t).

    Parameters
    ----------
    h : float
        Length of a step, > 0.
    type : {"Verlet", "FR", "Yo4", ..., "BM4", "BM6", "RKN4b", "RKN6b", "RKN6a", "ABA104", ...}
        Which composition, in pyhamsys' names: BM and RKN are those of Blanes and Moan; ABA, of high
        generalized order for perturbed systems, have order 4 here.

    Notes
    -----
    The loop over the maps is pyhamsys' and runs in Python; each of them, compiled, evaluates the force.

    Examples
    --------
    >>> import problems
    >>> from integrators import Composition, integrate
    >>> pendulum = problems.load("pendulum")
    >>> solution = integrate(pendulum, Composition(h=0.1, type="RKN6b"), [0.0, 10.0])
    >>> bool(solution.errors()["energy"].max() < 1e-9)
    True
    """

    type: Type = "BM6"

    library = "pyhamsys"
    built = "a loop in Python; maps compiled on this machine by numba"
    computes_with = ("numpy", "numba")
    family = "splitting"
    citation = cite("BlanesMoan2002", "pyhamsys")

    @property
    def order(self) -> int:
        """Of the type."""
        return ORDERS.get(self.type, 4)

    @cached_property
    def evaluations(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Of the force in a step: one in each map."""
        return len(_sequence(self.type, 1.0)._sequence)

    def refuses(self, system: System) -> str | None:
        """Return None for H = sum of c p^2/2 + V(q, t), else the reason."""
        if system.separable:
            return None
        return "it needs a separable Hamiltonian, H = sum of c p^2/2 + V(q, t), to drift and to kick in turn."

    def march(self, system: System) -> March:
        """Return what takes steps: pyhamsys' own loop over the compiled maps."""
        chi, adjoint = maps(system, self.type)
        sequences: dict[float, Any] = {}  # by the length of a step

        def march(t: float, h: float, first: int, n: int, y: Array, par: Array) -> None:
            if h not in sequences:
                sequences[h] = _sequence(self.type, h)
            onestep, here = sequences[h]._integrate_onestep, y
            forth, back = (lambda h, t, y: chi(h, t, y, par)), (lambda h, t, y: adjoint(h, t, y, par))
            for number in range(first, first + n):
                _, here = onestep(t + number * h, here, forth, back)
            y[:] = here

        return march


def _sequence(type: str, h: float) -> Any:  # noqa: A002 -- as pyhamsys' users call it
    return load("pyhamsys", "pyhamsys.pyhamsys").SymplecticIntegrator(type, h)


def maps(system: System, type: str) -> tuple[Any, Any]:  # noqa: A002
    """Return chi and chi*, ``f(h, t, y, par) -> y`` as pyhamsys calls them but for the parameters, compiled.

    pyhamsys hands chi the time after the map, chi* that before it. The time goes on with the drift: a kick
    that comes first is at the time before the map, one that comes last at that after it.
    """
    return _maps(system, last=type in KICK_LAST)


@lru_cache(maxsize=16)  # the same for every step and every composition
def _maps(system: System, *, last: bool) -> tuple[Any, Any]:
    import numba

    from problems import targets

    force, scale, n = targets.numba(system, "force"), targets.numba(system, "velocity_scale"), system.dof or 0

    @numba.njit(error_model="numpy")
    def kick_drift(h: float, t: float, y: Array, par: Array) -> Array:
        new, c, F = y.copy(), np.empty(n), np.empty(n)
        scale(t, y, par, c)
        force(t if last else t - h, new[:n], par, F)
        new[n:] += h * F
        new[:n] += h * (c * new[n:])
        return new

    @numba.njit(error_model="numpy")
    def drift_kick(h: float, t: float, y: Array, par: Array) -> Array:
        new, c, F = y.copy(), np.empty(n), np.empty(n)
        scale(t, y, par, c)
        new[:n] += h * (c * new[n:])
        force(t if last else t + h, new[:n], par, F)
        new[n:] += h * F
        return new

    for function in (kick_drift, drift_kick):
        function(0.0, 0.0, np.ones(system.dim), system.pack({}))
    return (drift_kick, kick_drift) if last else (kick_drift, drift_kick)
