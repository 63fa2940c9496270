"""Line integral methods through the conformance kit."""

import pytest

import integrators
import problems
from integrators import HBVM, LineIntegral, testing

METHODS = [
    LineIntegral(k=8, s=4, h=0.1, invariants=["energy"]),
    LineIntegral(k=3, s=1, h=0.05, invariants=["energy"]),
    LineIntegral(k=8, s=4, tol=1e-9, invariants=["energy"]),
    LineIntegral(k=6, s=3, h=0.01, tol=1e-6, invariants=["energy"]),
]

# Fields in code are refused; there are no pieces with adaptive steps, no HBVM with these equations, and no
# derivatives.
NEED_NOT_APPLY = (
    testing.keeps_the_error_of_a_user_s_function,
    testing.failure_is_a_status,
    testing.the_size_of_a_piece_is_a_count,
    testing.shared_steps_are_the_same,
    testing.is_the_hbvm_that_it_names,
    testing.tangents_follow_and_change_nothing,
    testing.batches_along_are_single_trajectories,
    testing.batches_find_the_events_of_single_trajectories,
    testing.adjoints_are_what_tangents_say,
    testing.events_may_change_the_state,
    testing.pairs_hold_twice_the_digits,
)


@pytest.mark.parametrize("problem", [testing.pendulum, testing.two_bodies], ids=lambda make: make.__name__)
@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("check", testing.CHECKS, ids=testing.name_of)
def test_conforms(check, method, problem):
    reason = check(method, problem())
    assert reason is None or check in NEED_NOT_APPLY


@pytest.mark.parametrize("method", [HBVM(k=6, s=3, h=0.1), METHODS[0], METHODS[2]], ids=repr)
@pytest.mark.parametrize("check", testing.CHECKS, ids=testing.name_of)
def test_conforms_on_a_poisson_system(check, method):
    reason = check(method, problems.load("rigid_body", quartic=1.0, t_end=20.0))
    assert reason is None or check in NEED_NOT_APPLY


def test_is_an_attribute_of_the_package_and_prints_as_its_call():
    method = integrators.LineIntegral(k=24, s=4, h=0.5, invariants=["energy", "angular_momentum"])
    assert repr(method) == "LineIntegral(k=24, s=4, h=0.5, invariants=('energy', 'angular_momentum'))"
    assert method.order == 8
