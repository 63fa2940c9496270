"""States of trajectories as a function of PyTorch whose derivatives are those of the native steps."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

from numpy.typing import ArrayLike

from integrators.dynamics.states import StatesAt
from integrators.protocol import MethodBase
from problems.errors import InputError, MissingLibraryError
from problems.problem import Problem

try:
    torch: Any = import_module("torch")
except ImportError as error:
    raise MissingLibraryError(
        f"torch is not installed ({error}); install it with pip install torch."
    ) from error

__all__ = ["states"]


def states(
    problem: Problem, method: MethodBase, times: ArrayLike, *, threads: int = 1
) -> Callable[[Any, Any], Any]:
    """Return a function of starts and parameters that PyTorch can differentiate in reverse.

    The steps are the native ones, on the processor, and so is their adjoint (`integrators.gradient`): one
    pass for all derivatives, which are those of the numerical map to rounding. There are no second
    derivatives.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced. The time that it begins at, too.
    method : MethodBase
        `integrators.Gauss` or `integrators.HBVM`.
    times : array_like, shape (m,)
        Times of the states, strictly monotone from ``problem.t0`` on. They change no steps.
    threads : int
        How many trajectories at once.

    Returns
    -------
    callable
        ``at(y0, par)``, tensors of doubles of shape (..., dim) and (..., n_par), whose leading axes are
        broadcast; the states, shape (..., m, dim). It works in ``torch.func.vmap`` and ``torch.func.grad``.

    Raises
    ------
    problems.errors.InputError
        For a problem that the method does not accept, times that cannot be, and tensors that are not of
        doubles.

    Examples
    --------
    >>> import problems, torch
    >>> from integrators import Gauss
    >>> from integrators.plugins.torch import states
    >>> pendulum = problems.load("pendulum")
    >>> at = states(pendulum, Gauss(s=4, h=0.1), [1.0, 2.0, 3.0])
    >>> y0 = torch.tensor(pendulum.y0, requires_grad=True)
    >>> (at(y0, torch.tensor(pendulum.par))[:, 0] ** 2).sum().backward()
    >>> y0.grad.shape
    torch.Size([2])
    """
    core = StatesAt(problem, method, times, threads)

    def at(y0: Any, par: Any) -> Any:
        for name, value in (("y0", y0), ("par", par)):
            if not isinstance(value, torch.Tensor) or value.dtype != torch.float64:
                raise InputError(
                    f"{name} must be a torch.Tensor of doubles, such as torch.tensor(problem.{name})."
                )
        return _States.apply(y0, par, core)

    return at


class _States(torch.autograd.Function):
    """`StatesAt`, as a function with a derivative."""

    @staticmethod
    def forward(y0: Any, par: Any, core: StatesAt) -> Any:
        return _tensor(core.values(_array(y0), _array(par)), y0)

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        y0, par, ctx.core = inputs
        ctx.save_for_backward(y0, par)

    @staticmethod
    def backward(ctx: Any, gradient: Any) -> Any:
        y0, par = ctx.saved_tensors
        parts = _PulledBack.apply(y0, par, gradient, ctx.core)
        # what was broadcast has the sum of the derivatives
        return *(part.sum_to_size(x.shape) for part, x in zip(parts, (y0, par), strict=True)), None

    @staticmethod
    def vmap(info: Any, in_dims: Any, y0: Any, par: Any, core: StatesAt) -> Any:
        return _States.apply(*_in_front(in_dims, (y0, par), (1, 1)), core), 0


class _PulledBack(torch.autograd.Function):
    """Its derivative, a function of its own so that it may be batched too."""

    @staticmethod
    def forward(y0: Any, par: Any, gradient: Any, core: StatesAt) -> Any:
        parts = core.pulled_back(_array(y0), _array(par), _array(gradient))
        return tuple(_tensor(part, y0) for part in parts)

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        """Keep nothing: there is no second derivative."""

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        raise InputError("states of trajectories have no second derivatives by PyTorch.")

    @staticmethod
    def vmap(info: Any, in_dims: Any, y0: Any, par: Any, gradient: Any, core: StatesAt) -> Any:
        return _PulledBack.apply(*_in_front(in_dims, (y0, par, gradient), (1, 1, 2)), core), (0, 0)


def _in_front(in_dims: Any, tensors: Any, own: tuple[int, ...]) -> list[Any]:
    """Return tensors with the batched axis in front, and as many axes before those of one trajectory each."""
    moved = [
        x.unsqueeze(0) if axis is None else x.movedim(axis, 0)
        for x, axis in zip(tensors, in_dims, strict=False)
    ]
    most = max(x.dim() - count for x, count in zip(moved, own, strict=True))
    return [
        x.reshape(x.shape[0], *[1] * (most - x.dim() + count), *x.shape[1:])
        for x, count in zip(moved, own, strict=True)
    ]


def _array(tensor: Any) -> Any:
    return tensor.detach().cpu().numpy()


def _tensor(array: Any, like: Any) -> Any:
    return torch.as_tensor(array, device=like.device)
