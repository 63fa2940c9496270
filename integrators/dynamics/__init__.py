"""What a trajectory depends on: Lyapunov exponents, indicators of chaos, gradients, periodic orbits."""

from integrators.dynamics.adjoint import gradient
from integrators.dynamics.indicators import Indicator, finite_time_exponent, gali, megno, sali
from integrators.dynamics.lyapunov import Exponents, lyapunov
from integrators.dynamics.maps import ExponentMap, IndicatorMap, indicator_map, lyapunov_map, megno_map
from integrators.dynamics.orbits import PeriodicOrbit, continued, periodic

__all__ = [
    "ExponentMap",
    "Exponents",
    "Indicator",
    "IndicatorMap",
    "PeriodicOrbit",
    "continued",
    "finite_time_exponent",
    "gali",
    "gradient",
    "indicator_map",
    "lyapunov",
    "lyapunov_map",
    "megno",
    "megno_map",
    "periodic",
    "sali",
]
