"""The conformance kit: checks for any method.

With pytest, one test per check::

    @pytest.mark.parametrize("check", testing.CHECKS, ids=testing.name_of)
    def test_conforms(check):
        check(IAS15(), testing.two_bodies())

Each check raises `AssertionError` with a sentence when the method breaks a
rule of `integrators.protocol`, and returns the reason as a string where the
rule does not apply to the method. `check_method` runs them all;
`measured_order` says whether a method with a fixed step has the order that it states.
"""

from collections.abc import Callable

from integrators.protocol import MethodBase
from integrators.testing.capabilities import (
    a_destination_leaves_the_samples_alone,
    adjoints_are_what_tangents_say,
    batches_along_are_single_trajectories,
    batches_are_single_trajectories,
    batches_find_the_events_of_single_trajectories,
    comes_back_when_it_is_stopped,
    events_may_change_the_state,
    finds_events_beside_its_steps,
    is_the_hbvm_that_it_names,
    keeps_the_error_of_a_user_s_function,
    pairs_hold_twice_the_digits,
    prepared_batches_are_batches,
    samplings_are_as_stated,
    shared_steps_are_the_same,
    tangents_follow_and_change_nothing,
    the_size_of_a_piece_is_a_count,
    threads_change_no_bits,
)
from integrators.testing.checkpoints import checkpoints_continue_bit_for_bit, refuses_other_checkpoints
from integrators.testing.convergence import measured_order
from integrators.testing.description import (
    accepts_gives_a_reason,
    describes_itself,
    is_a_value,
    refuses_unknown_options,
)
from integrators.testing.exercises import blow_up, pendulum, two_bodies
from integrators.testing.trajectory import (
    ENERGY_BOUND,
    energy_stays_sane,
    failure_is_a_status,
    leaves_its_input_alone,
    pieces_equal_the_whole,
    refuses_bad_states,
    refuses_bad_times,
    repeats_itself,
    returns_the_times_asked_for,
    samples_leave_the_steps_alone,
    samplings_work_or_are_refused,
    satisfies_the_protocol,
)
from problems import Problem
from problems.problem import check_is_problem

__all__ = [
    "CHECKS",
    "ENERGY_BOUND",
    "Check",
    "blow_up",
    "check_method",
    "measured_order",
    "name_of",
    "pendulum",
    "two_bodies",
]

Check = Callable[[MethodBase, Problem], str | None]

CHECKS: tuple[Check, ...] = (
    describes_itself,
    is_a_value,
    refuses_unknown_options,
    accepts_gives_a_reason,
    satisfies_the_protocol,
    leaves_its_input_alone,
    returns_the_times_asked_for,
    repeats_itself,
    pieces_equal_the_whole,
    samples_leave_the_steps_alone,
    checkpoints_continue_bit_for_bit,
    refuses_other_checkpoints,
    energy_stays_sane,
    samplings_work_or_are_refused,
    refuses_bad_times,
    refuses_bad_states,
    failure_is_a_status,
    samplings_are_as_stated,
    a_destination_leaves_the_samples_alone,
    keeps_the_error_of_a_user_s_function,
    comes_back_when_it_is_stopped,
    finds_events_beside_its_steps,
    events_may_change_the_state,
    batches_along_are_single_trajectories,
    batches_find_the_events_of_single_trajectories,
    batches_are_single_trajectories,
    prepared_batches_are_batches,
    shared_steps_are_the_same,
    threads_change_no_bits,
    the_size_of_a_piece_is_a_count,
    tangents_follow_and_change_nothing,
    adjoints_are_what_tangents_say,
    pairs_hold_twice_the_digits,
    is_the_hbvm_that_it_names,
)


def check_method(method: MethodBase, problem: Problem) -> dict[str, str | None]:
    """Run ``method`` through all checks on ``problem``, which it must accept.

    Returns
    -------
    dict
        Name of the check -> ``None``, or why it does not apply.

    Raises
    ------
    AssertionError
        At the first broken rule.
    """
    check_is_problem(problem)
    return {name_of(check): check(method, problem) for check in CHECKS}


def name_of(check: Check) -> str:
    """Return the name of a check, to be used as a test's id."""
    return check.__name__
