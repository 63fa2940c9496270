"""What a trajectory depends on: Lyapunov exponents."""

from integrators.dynamics.lyapunov import Exponents, lyapunov

__all__ = ["Exponents", "lyapunov"]
