"""A pytest plugin that puts our methods into diffrax's own tests, in the place of its implicit solvers.

    git clone https://github.com/patrick-kidger/diffrax && cd diffrax
    PYTHONPATH=<this directory> python -m pytest -o addopts= -p host test

Wherever a test makes one of diffrax's implicit solvers it gets one of ours, and
``all_ode_solvers`` is ours alone. Tests that ask the class for its tableau see the
class of the host. Tests in which ours do not take part are left out.
"""

from typing import Any

import diffrax
import jax
import pytest

from integrators.plugins.diffrax import HBVM, Gauss

STANDINS = {
    "ImplicitEuler": Gauss(s=1),
    "Kvaerno3": HBVM(k=4, s=2),
    "Kvaerno4": Gauss(s=2),
    "Kvaerno5": HBVM(k=6, s=3),
}
# Tests that make an implicit solver themselves; the others get theirs as a parameter.
INSIDE = {
    "test_boolean_with_root_find_terminating_on_first_step",
    "test_derivative",
    "test_implicit_closure_convert",
    "test_implicit_euler_adaptive",
    "test_implicit_runge_kutta_direct_adjoint",
    "test_implicit_solver_with_clip_controller",
    "test_implicit_tol_error",
    "test_no_jit",
    "test_static",
}
OURS = (HBVM(k=2, s=1), HBVM(k=4, s=2), HBVM(k=6, s=3), Gauss(s=1), Gauss(s=2), Gauss(s=3))


class _StandIn:
    """Called like the host's class, makes one of our solvers; otherwise is the host's class."""

    def __init__(self, host: Any, ours: Any) -> None:
        self.host, self.ours = host, ours

    def __call__(self, **options: Any) -> Any:
        return self.ours

    def __instancecheck__(self, instance: Any) -> bool:
        return isinstance(instance, self.host)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.host, name)


def pytest_configure(config: Any) -> None:
    """Put our solvers in before the tests are imported."""
    config.addinivalue_line("markers", "slow")
    jax.config.update("jax_enable_x64", True)
    for name, ours in STANDINS.items():
        setattr(diffrax, name, _StandIn(getattr(diffrax, name), ours))


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makemodule(module_path: Any, parent: Any) -> None:
    """Replace the host's list of solvers, which its test modules import by name."""
    from test import helpers  # the host's

    helpers.all_ode_solvers = OURS
    helpers.all_split_solvers = ()


def pytest_collection_modifyitems(config: Any, items: list[Any]) -> None:
    """Leave out the tests in which none of our solvers takes part."""

    def applies(item: Any) -> bool:
        parameters = item.callspec.params.values() if hasattr(item, "callspec") else ()
        return item.originalname in INSIDE or any(isinstance(value, HBVM | Gauss) for value in parameters)

    config.hook.pytest_deselected(items=[item for item in items if not applies(item)])
    items[:] = filter(applies, items)
