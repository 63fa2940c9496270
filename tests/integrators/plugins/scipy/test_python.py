"""Functions in Python inside ``solve_ivp``: Jacobians, options, errors."""

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import OdeSolver, solve_ivp

from integrators.kernel.implicit.groups import groups
from integrators.plugins import scipy as plugin
from integrators.plugins.scipy import HBVM, Gauss
from integrators.plugins.scipy.newton import Newton
from problems.errors import InputError

N = 30


def diffusion(t: float, y: np.ndarray) -> np.ndarray:
    """A stiff reaction with diffusion, whose Jacobian is tridiagonal."""
    wide = np.concatenate([[1.0], y, [0.0]])
    return N * N * (wide[2:] - 2.0 * y + wide[:-2]) - y**3


def slope(t: float, y: np.ndarray) -> np.ndarray:
    return N * N * (np.eye(N, k=1) - 2.0 * np.eye(N) + np.eye(N, k=-1)) - np.diag(3.0 * y**2)


def van_der_pol(t: float, y: np.ndarray) -> list[float]:
    return [y[1], 1e3 * (1.0 - y[0] ** 2) * y[1] - y[0]]


Y0 = np.sin(np.arange(N) / 5.0)
TRIDIAGONAL = sparse.diags_array([np.ones(N - 1), np.ones(N), np.ones(N - 1)], offsets=[-1, 0, 1])


def test_of_scipy_only_public_names_are_used() -> None:
    assert plugin.__file__ is not None
    for path in Path(plugin.__file__).parent.glob("*.py"):
        assert not re.search(r"(from|import) scipy[.\w]*\._", path.read_text()), path


@pytest.mark.parametrize("sparsity", [None, TRIDIAGONAL], ids=["dense", "sparse"])
@pytest.mark.parametrize("turn", [1.0, np.exp(0.5j)], ids=["real", "complex"])
def test_differences_give_the_jacobian(sparsity: Any, turn: complex) -> None:
    y = Y0 * (turn if np.iscomplexobj(turn) else 1.0)
    solver = OdeSolver(diffusion, 0.0, y, 1.0, vectorized=False, support_complex=True)
    newton = Newton(solver, 3, None, sparsity)
    newton.linearize(0.0, y, diffusion(0.0, y), 0.1)
    made = newton._J.toarray() if sparsity is not None else newton._J
    assert np.abs(made - slope(0.0, y)).max() < 1e-4  # measured 1.4e-5, of 1.8e3
    assert solver.njev == 1


def test_columns_of_a_group_have_no_row_in_common() -> None:
    rng = np.random.default_rng(1)
    for pattern in (TRIDIAGONAL.toarray(), rng.random((40, 40)) < 0.1, np.zeros((3, 3)), np.eye(4)):
        rows, columns = np.nonzero(pattern)
        found = groups(rows, columns, len(pattern))
        for group in range(found.max() + 1):
            assert (np.asarray(pattern, dtype=bool)[:, found == group].sum(axis=1) <= 1).all()
    assert groups(*np.nonzero(TRIDIAGONAL.toarray()), TRIDIAGONAL.shape[0]).max() == 2
    assert groups(*np.nonzero(np.eye(4)), 4).max() == 0


@pytest.mark.parametrize(
    "options",
    [{}, {"jac": slope}, {"jac": lambda t, y: sparse.csc_array(slope(t, y))}, {"jac_sparsity": TRIDIAGONAL}],
    ids=["dense", "given", "given sparse", "sparsity"],
)
def test_a_stiff_system_is_solved_by_newton_with_every_kind_of_jacobian(options: Any) -> None:
    made = solve_ivp(diffusion, (0.0, 0.1), Y0, method=HBVM, s=2, rtol=1e-5, atol=1e-7, **options)
    close = solve_ivp(diffusion, (0.0, 0.1), Y0, method="Radau", rtol=1e-10, atol=1e-12, jac=slope)
    assert made.njev > 0
    assert made.nlu > 0
    assert np.abs(made.y[:, -1] - close.y[:, -1]).max() < 1e-5  # measured 2.2e-6


def test_newtons_iterations_go_on_while_they_converge() -> None:
    made = solve_ivp(van_der_pol, (0.0, 200.0), [2.0, 0.0], method=HBVM, rtol=1e-6, atol=1e-6)
    assert made.success
    assert made.t.size < 25  # measured 20, and 30 when 12 iterations are all
    assert made.njev < 5  # measured 3, and 10


def orbit(t: float, y: np.ndarray) -> list[float]:
    cube = (y[0] ** 2 + y[1] ** 2) ** 1.5
    return [y[2], y[3], -y[0] / cube, -y[1] / cube]


def oscillators(t: float, y: np.ndarray) -> list[float]:
    return [y[2], y[3], -y[0] - 2.0 * y[0] * y[1], -y[1] - y[0] ** 2 + y[1] ** 2]


@pytest.mark.parametrize(
    ("field", "start"), [(orbit, [0.4, 0.0, 0.0, 2.0]), (oscillators, [0.0, 0.1, 0.49, 0.0])]
)
def test_a_looser_tolerance_does_not_cost_much_more(field: Any, start: list[float]) -> None:
    loose, tight = (
        solve_ivp(field, (0.0, 50.0), start, method=HBVM, rtol=rtol, atol=1e-3 * rtol).nfev
        for rtol in (1e-3, 1e-12)
    )
    # measured 1.22 and 1.20; 1.80 and 0.93 when a step is as long as a hundred iterations can solve
    assert loose < 1.35 * tight


@pytest.mark.parametrize("kind", [ValueError, KeyError, ZeroDivisionError, KeyboardInterrupt])
@pytest.mark.parametrize("after", [0, 200])
def test_what_the_function_raises_arrives_as_it_is(kind: type[BaseException], after: int) -> None:
    calls, raised = 0, kind("mine")

    def failing(t: float, y: np.ndarray) -> list[float]:
        nonlocal calls
        calls += 1
        if calls > after:
            raise raised
        return [y[1], -y[0]]

    with pytest.raises(kind) as caught:
        solve_ivp(failing, (0.0, 100.0), [1.0, 0.0], method=HBVM)
    assert caught.value is raised


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"max_step": -1.0}, "max_step=-1.0 of HBVM must be a positive number"),
        ({"first_step": 11.0}, r"first_step=11.0 must not be beyond the end, 10\.0"),
        ({"atol": [1e-6] * 3}, r"atol of shape \(3,\)"),
        ({"atol": -1e-6}, "atol=-1e-06 must be >= 0"),
        ({"jac": np.eye(3)}, r"jac.*\(2, 2\).*\(3, 3\)"),
        ({"jac_sparsity": np.eye(3)}, r"jac_sparsity.*\(2, 2\).*\(3, 3\)"),
        ({"method": Gauss, "k": 8}, "no k: leave out k=8"),
    ],
)
def test_options_that_cannot_be_used_are_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        solve_ivp(van_der_pol, (0.0, 10.0), [2.0, 0.0], **{"method": HBVM, **options})


def test_options_that_mean_nothing_are_named_in_a_warning() -> None:
    with pytest.warns(UserWarning, match="HBVM has no option colour"):
        solve_ivp(lambda t, y: -y, (0.0, 1.0), [1.0], method=HBVM, colour="red")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        solve_ivp(lambda t, y: -y, (0.0, 1.0), [1.0], method=HBVM)


@pytest.mark.parametrize("atol", [1e-14, 1e-10, 1e-6])
def test_a_field_that_begins_as_a_staircase_of_rounding_takes_few_evaluations(atol: float) -> None:
    # tanh + 1 is 0, 1.1e-16, 2.2e-16, ... at first. Before, with atol=1e-14: 389,096 to t = 1.4, in 15 s.
    def fun(t: float, y: Any) -> Any:
        return -y + np.tanh(4.0 * (t - 5.0)) + 1.0

    solution = solve_ivp(fun, (0.0, 15.0), [0.0], method=HBVM, rtol=1e-10, atol=atol)
    exact = solve_ivp(fun, (0.0, 15.0), [0.0], method="DOP853", rtol=1e-13, atol=1e-15)
    assert solution.status == 0
    assert solution.nfev < 20_000  # measured 11,024, 9,746 and 7,358
    assert abs(solution.y[0, -1] - exact.y[0, -1]) < 1e-11  # measured 1.1e-12


def akzo(t: float, y: np.ndarray) -> np.ndarray:
    """Medical Akzo Nobel, N = 40: most components are 0 at first, and stay there for a while."""
    n = 40
    wide, zeta = np.concatenate([[2.0 if t <= 5.0 else 0.0, 0.0], y, y[-2:]]), (np.arange(n) + 1) / n
    u, v = wide[::2], wide[1::2]
    first, second = 2 * (zeta - 1) ** 3 / 16, (zeta - 1) ** 4 / 16
    out = np.empty(2 * n)
    out[1::2] = -100.0 * u[1:-1] * v[1:-1]
    out[::2] = first * (u[2:] - u[:-2]) * n / 2 + second * (u[:-2] - 2 * u[1:-1] + u[2:]) * n**2 + out[1::2]
    return out


def test_components_that_stay_zero_are_no_division_by_zero() -> None:
    y0 = np.zeros(80)
    y0[1::2] = 1.0
    solution = solve_ivp(akzo, (0.0, 0.05), y0, method=HBVM)  # warnings are errors
    assert solution.success


def test_an_iteration_that_diverges_warns_of_nothing_and_errors_at_states_are_the_users() -> None:
    solution = solve_ivp(lambda t, y: -1e3 * (np.exp(5.0 * y) - 1.0), (0.0, 1.0), [1.0], method=HBVM, s=3)
    assert solution.success
    assert abs(solution.y[0, -1]) < 1e-3  # measured 2e-17
    with pytest.warns(RuntimeWarning, match="invalid value encountered in sqrt"):
        solve_ivp(lambda t, y: np.sqrt(y - 1.0), (0.0, 1.0), [0.5], method=HBVM)
    with np.errstate(invalid="raise"), pytest.raises(FloatingPointError):
        solve_ivp(lambda t, y: np.sqrt(y - 1.0), (0.0, 1.0), [0.5], method=HBVM)
