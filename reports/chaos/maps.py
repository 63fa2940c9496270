"""Maps of MEGNO: Sitnikov's problem, sections of Henon and Heiles's, and the restricted three-body problem.

MEGNO is 2 on regular orbits and grows in proportion to the time on chaotic ones.
"""

import math
from collections.abc import Sequence

import numpy as np

from hbvm_bench.studies.paper.experiments import axis_motion
from integrators.dynamics.maps import indicator_map
from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM
from integrators.protocol import Array
from problems import Problem
from problems.catalogue.cr3bp import cr3bp
from problems.catalogue.henon_heiles import henon_heiles

SAMPLES = 256  # of MEGNO along an orbit, of which the last is drawn

PER_TURN = 32
SITNIKOV = Gauss(s=6, h=axis_motion.TURN / PER_TURN)  # in the eccentric anomaly

ENERGIES = (1 / 12, 1 / 8, 1 / 6)
HENON_HEILES = HBVM(k=9, s=6, h=0.5)  # k = 3s/2: it conserves the energy, a cubic, so that none escapes

JUPITER = 9.5388e-4  # share of the mass of Sun and Jupiter
RESTRICTED = HBVM(tol=1e-10)


def sitnikov(es: Sequence[float], speeds: Sequence[float], turns: int) -> list[Array]:
    """Return MEGNO by eccentricity, each shape (len(speeds),), of planetoids that start at the apocentre.

    They move on the axis, from z = 0; NaN where one goes far away, which is no chaos of a bounded motion.
    """
    return [_sitnikov(e, speeds, turns) for e in es]


def _sitnikov(e: float, speeds: Sequence[float], turns: int) -> Array:
    starts = np.stack([np.full(len(speeds), axis_motion.START[0]), speeds], axis=1)
    stays = np.isnan(axis_motion.stays([e], speeds, turns)[0])
    t_end = math.pi + turns * axis_motion.TURN
    system = axis_motion.AXIS
    problem = Problem(system, y0=starts[0], parameters={"e": e}, t0=math.pi, t_end=t_end)
    values = np.full(len(speeds), np.nan)
    if stays.any():
        here = indicator_map(problem, "megno", SITNIKOV, starts=starts[stays], samples=SAMPLES)
        values[stays] = here.values
    return values


def henon_heiles_section(
    momenta: Sequence[float], positions: Sequence[float], energy: float, t_end: float
) -> list[Array]:
    """Return MEGNO by the momentum p2, each shape (len(positions),), on the section q1 = 0, p1 > 0.

    NaN outside the energy surface.
    """
    problem = henon_heiles(energy=1 / 12, q2=0.0, t_end=t_end)
    rows = []
    for p2 in momenta:
        q2 = np.asarray(positions)
        squared = 2 * energy - p2 * p2 - q2 * q2 + 2 * q2**3 / 3
        inside = (squared > 0.0) & (q2 < 1.0)
        row = np.full(q2.size, np.nan)
        if inside.any():
            here = q2[inside]
            starts = np.stack(
                [np.zeros(here.size), here, np.sqrt(squared[inside]), np.full(here.size, p2)], 1
            )
            row[inside] = indicator_map(problem, "megno", HENON_HEILES, starts=starts, samples=SAMPLES).values
        rows.append(row)
    return rows


def asteroids(eccentricities: Sequence[float], axes: Sequence[float], turns: int) -> list[Array]:
    """Return MEGNO by eccentricity, each shape (len(axes),), of asteroids between the Sun and Jupiter.

    They start at the pericentre, on the other side of the Sun than Jupiter, whose distance is 1 and whose
    revolution takes 2 pi. NaN where the integration did not reach its end.
    """
    problem = cr3bp(mu=JUPITER, t_end=turns * 2 * math.pi)
    rows = []
    for e in eccentricities:
        near = np.asarray(axes) * (1 - e)
        speed = np.sqrt((1 - JUPITER) * (1 + e) / near)
        nothing = np.zeros(near.size)
        starts = np.stack([-JUPITER - near, nothing, nothing, -speed - JUPITER], axis=1)
        rows.append(indicator_map(problem, "megno", RESTRICTED, starts=starts, samples=SAMPLES).values)
    return rows
