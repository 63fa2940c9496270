"""What a trajectory depends on: Lyapunov exponents, gradients."""

from integrators.dynamics.adjoint import gradient
from integrators.dynamics.lyapunov import Exponents, lyapunov

__all__ = ["Exponents", "gradient", "lyapunov"]
