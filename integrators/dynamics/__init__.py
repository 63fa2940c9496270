"""What a trajectory depends on: Lyapunov exponents, indicators of chaos, gradients."""

from integrators.dynamics.adjoint import gradient
from integrators.dynamics.indicators import Indicator, finite_time_exponent, gali, megno, sali
from integrators.dynamics.lyapunov import Exponents, lyapunov
from integrators.dynamics.maps import IndicatorMap, indicator_map

__all__ = [
    "Exponents",
    "Indicator",
    "IndicatorMap",
    "finite_time_exponent",
    "gali",
    "gradient",
    "indicator_map",
    "lyapunov",
    "megno",
    "sali",
]
