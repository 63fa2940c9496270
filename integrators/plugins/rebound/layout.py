"""Where the step finds what it needs in memory that REBOUND owns, and the state of our integrator in it."""

import ctypes

from integrators.peers import load

rebound = load("rebound")

# The state of the integrator, in words of eight bytes: what REBOUND saves, and then what it does not.
K, S, REST, REST_COUNT, FORCES, FORCES_COUNT, LENGTH, ITERATIONS, EVALUATIONS, LARGEST_ERROR, TOL = range(11)
SAVED = 11
TABLES, TABLES_K, TABLES_S, WORK, WORK_COUNT, MEGNO = range(SAVED, SAVED + 6)
WORDS = SAVED + 6


def _place(field: str, size: int = 8) -> int:
    """Return where a simulation keeps a field, in units of ``size`` bytes."""
    return getattr(rebound.Simulation, field).offset // size


TIME, DT, DONE, MEGNO_START = (_place(name) for name in ("t", "dt", "dt_last_done", "_megno_initial_t"))
COUNT, PARTICLES = _place("N"), _place("_particles")
VARIATIONS, VARIATIONAL = _place("N_var"), _place("_particles_var")
STATE = (rebound.Simulation.integrator.offset + rebound.integrator.IntegratorConfiguration.state.offset) // 8
VELOCITY_DEPENDENT = _place("force_is_velocity_dependent", 4)
CALCULATE_MEGNO = _place("_calculate_megno", 4)
GRAVITY, IGNORED_TERMS = _place("_gravity", 4), _place("gravity_ignore", 4)
SIMULATION = ctypes.sizeof(rebound.Simulation) // 8
STRIDE = ctypes.sizeof(rebound.Particle) // 8
TREE = 3  # of REBOUND's kinds of gravity

LARGEST = 1e-3  # by default, the local error that a step may have, relative to the bodies' velocity

# Why a step fails.
UNKNOWN_METHOD, DIVERGED, ROUGH, UNRESOLVED = range(4)

# Machine code compiled for other places is other machine code.
IDENTITY = repr({name: value for name, value in sorted(globals().items()) if name.isupper()})
