"""HBVM and Gauss through the conformance kit, and the kit itself against methods that break the rules."""

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest

from integrators import HBVM, Gauss, testing
from integrators.protocol import Samples, Status

METHODS = [
    HBVM(k=8, s=4, h=0.1),
    HBVM(k=4, s=1, h=0.25),
    HBVM(k=20, s=10, h=0.5),
    Gauss(s=1, h=0.1),
    Gauss(s=2, h=0.25),
    Gauss(s=8, h=0.3),
]

# With a fixed step there are no pieces, no batches with events, and no events that change the state.
NEED_NOT_APPLY = (
    testing.failure_is_a_status,
    testing.the_size_of_a_piece_is_a_count,
    testing.shared_steps_are_the_same,
    testing.events_may_change_the_state,
    testing.pairs_hold_twice_the_digits,
    testing.batches_along_are_single_trajectories,  # of more than 16 stages
    testing.batches_find_the_events_of_single_trajectories,
)


@pytest.mark.parametrize("problem", [testing.pendulum, testing.two_bodies], ids=lambda make: make.__name__)
@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("check", testing.CHECKS, ids=testing.name_of)
def test_conforms(check, method, problem):
    reason = check(method, problem())
    assert reason is None or check in NEED_NOT_APPLY


def test_check_method_runs_every_check():
    reasons = testing.check_method(Gauss(s=2, h=0.1), testing.pendulum())
    assert list(reasons) == [testing.name_of(check) for check in testing.CHECKS]


@dataclass(frozen=True, kw_only=True, repr=False)
class Broken(HBVM):
    """A method with a fault of choice."""

    fault: str = ""

    def compile(self, system):
        program = super().compile(system)
        start, fault = program.start, self.fault

        def broken(y0, par=None, t0=0.0):
            stepper = start(y0, par, t0)
            advance, restore = stepper.advance, stepper.restore

            def wrong(times, *, sample=None):
                grid = np.asarray(times, dtype=float)
                if fault == "raises":
                    samples = advance(times, sample=sample)
                    if samples.status.failed:
                        raise RuntimeError(samples.reason)
                    return samples
                if fault == "anything goes":
                    try:
                        return advance(times, sample=sample)
                    except ValueError:
                        return Samples(grid, np.zeros((grid.size, 2)), Status.FINISHED)
                samples = advance(times, sample=sample)
                if fault == "silent nan":
                    return Samples(grid, np.full((grid.size, 2), np.nan), Status.FINISHED)
                if fault == "noise":
                    return dataclasses.replace(
                        samples, y=samples.y + np.random.default_rng().normal(size=2) * 1e-9
                    )
                if fault == "wrong sign":
                    return dataclasses.replace(samples, y=samples.y + np.linspace(0, 1, grid.size)[:, None])
                if fault == "steps of its own":
                    return Samples(samples.t * (1 + 1e-9), samples.y, samples.status)
                return samples

            stepper.advance = wrong
            if fault == "forgets":
                stepper.restore = lambda checkpoint: restore(
                    dataclasses.replace(
                        checkpoint, arrays={name: a + 1e-12 for name, a in checkpoint.arrays.items()}
                    )
                )
            return stepper

        program.start = broken
        return program


@pytest.mark.parametrize(
    ("fault", "check"),
    [
        ("raises", testing.failure_is_a_status),
        ("silent nan", testing.returns_the_times_asked_for),
        ("anything goes", testing.refuses_bad_times),
        ("anything goes", testing.samplings_work_or_are_refused),
        ("noise", testing.repeats_itself),
        ("noise", testing.pieces_equal_the_whole),
        ("wrong sign", testing.energy_stays_sane),
        ("steps of its own", testing.returns_the_times_asked_for),
        ("forgets", testing.checkpoints_continue_bit_for_bit),
    ],
)
def test_the_kit_notices_a_broken_rule(fault, check):
    with pytest.raises((AssertionError, RuntimeError)):
        check(Broken(k=4, s=2, h=0.1, fault=fault), testing.pendulum())


def test_the_kit_notices_a_method_that_does_not_print_as_its_call():
    class Mumbling(HBVM):
        def __repr__(self):
            return "HBVM(k=4, s=2, h=0.2)"

    with pytest.raises(AssertionError, match="prints its own name"):
        testing.is_a_value(Mumbling(k=4, s=2, h=0.1), testing.pendulum())
