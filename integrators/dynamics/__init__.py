"""What a trajectory depends on: Lyapunov exponents, gradients."""

from integrators.dynamics.gradient import gradient
from integrators.dynamics.lyapunov import Exponents, lyapunov

__all__ = ["Exponents", "gradient", "lyapunov"]
