"""States of trajectories as functions of PyTorch."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, gradient
from problems import InputError

torch = pytest.importorskip("torch")

from integrators.plugins.torch import states  # noqa: E402

TIMES = [0.5, 1.0, 1.5]


@pytest.mark.parametrize("method", [Gauss(s=4, h=0.1), HBVM(tol=1e-12)], ids=repr)
def test_its_derivatives_are_those_of_the_gradient(method):
    problem = problems.load("double_pendulum")
    names = ["y0", *problem.system.parameters]
    value, grads = gradient(problem, method, lambda y: y[0] * y[3], names, times=TIMES)
    y0, par = (torch.tensor(part, requires_grad=True) for part in (problem.y0, problem.par))
    y = states(problem, method, TIMES)(y0, par)
    loss = (y[:, 0] * y[:, 3]).sum()
    loss.backward()
    assert float(loss.detach()) == pytest.approx(value, rel=1e-14)
    assert np.allclose(y0.grad, grads["y0"], rtol=1e-13, atol=0.0)
    assert np.allclose(par.grad, [float(grads[name]) for name in names[1:]], rtol=1e-13, atol=0.0)


def test_a_batch_and_vmap_are_one_trajectory_after_another():
    problem, method = problems.load("pendulum"), Gauss(s=4, h=0.1)
    at = states(problem, method, TIMES, threads=2)
    starts = torch.tensor([[0.1, 0.5], [1.0, 0.0], [0.3, -0.2]], dtype=torch.float64, requires_grad=True)
    par = torch.tensor(problem.par, requires_grad=True)

    def loss(y0, par):
        return (at(y0, par) ** 2).sum()

    together = torch.autograd.grad(loss(starts, par), (starts, par))
    alone = [torch.autograd.grad(loss(row, par), (row, par)) for row in starts]
    mapped = torch.func.vmap(torch.func.grad(loss, argnums=(0, 1)), in_dims=(0, None))(starts.detach(), par)
    for i, (by_start, _) in enumerate(alone):
        assert torch.equal(together[0][i], by_start)
        assert torch.equal(mapped[0][i], by_start)
    summed = sum(by_par for _, by_par in alone)
    assert torch.allclose(together[1], summed, rtol=1e-14, atol=0.0)
    assert torch.allclose(mapped[1].sum(dim=0), summed, rtol=1e-14, atol=0.0)
    # axes in another place, and a batch within the batch
    swapped = torch.func.vmap(at, in_dims=(1, None))(starts.detach().T, par)
    assert torch.equal(swapped, at(starts, par))
    nested = torch.func.vmap(at, in_dims=(0, 0))(torch.stack([starts] * 2), torch.stack([par] * 2))
    assert torch.equal(nested[1], at(starts, par))


def test_second_derivatives_single_precision_and_lists_are_refused():
    problem = problems.load("pendulum")
    at = states(problem, Gauss(s=4, h=0.1), TIMES)
    par = torch.tensor(problem.par)
    with pytest.raises(InputError, match=r"torch\.Tensor of doubles"):
        at(torch.tensor([0.1, 0.5]), par)
    with pytest.raises(InputError, match=r"torch\.Tensor of doubles"):
        at([0.1, 0.5], par)
    y0 = torch.tensor(problem.y0, requires_grad=True)
    (slope,) = torch.autograd.grad(at(y0, par).sum(), y0, create_graph=True)
    with pytest.raises(InputError, match="no second derivatives"):
        torch.autograd.grad(slope.sum(), y0)
