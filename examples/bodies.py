"""The giant planets and 23 asteroids without mass, from a simulation of REBOUND, and back into it."""

import numpy as np
import rebound
from side_by_side import clocked

import integrators

YEARS = 200.0
GIANTS = ((9.55e-4, 5.20, 0.048), (2.86e-4, 9.58, 0.056), (4.37e-5, 19.2, 0.047), (5.15e-5, 30.1, 0.009))


def simulation() -> rebound.Simulation:
    """Return the simulation: Sun, planets, and then the asteroids between 2.1 and 3.3 au."""
    made = rebound.Simulation()
    made.units = ("au", "yr", "Msun")
    made.add(m=1.0, name="Sun")
    for i, (m, a, e) in enumerate(GIANTS):
        made.add(m=m, a=a, e=e, inc=0.02 * i, f=1.3 * i)
    for i, a in enumerate(np.linspace(2.1, 3.3, 23)):
        made.add(a=a, e=0.05, inc=0.1, f=0.7 * i)
    made.N_active = 1 + len(GIANTS)
    made.move_to_com()
    return made


def ias15() -> rebound.Simulation:
    """Integrate it with REBOUND's own adaptive integrator."""
    made = simulation()
    made.integrator = "ias15"
    made.integrate(YEARS)
    return made


def main() -> None:
    """Integrate it with both, and compare every body."""
    problem = integrators.from_rebound(simulation(), t_end=YEARS)
    ours = clocked("HBVM()", lambda: integrators.integrate(problem, integrators.HBVM(), times=[YEARS]))
    theirs = clocked("REBOUND's IAS15", ias15)
    back = integrators.to_rebound(problem, ours.y[-1], t=YEARS, simulation=simulation())
    apart = max(
        np.abs(np.subtract(one.xyz, other.xyz)).max()
        for one, other in zip(back.particles, theirs.particles, strict=True)
    )
    print(f"largest difference of a place: {apart:.1e} au, of {back.N} bodies")
    print("the same places to 1e-8 au:", bool(apart < 1e-8))
    print("names are kept:", back.particles["Sun"].m == 1.0)


if __name__ == "__main__":
    main()
