"""Steps, iterations and evaluations are those on record: a loss of speed by design is seen without a clock.

``python -m tests.costs.record`` rewrites the record where it is meant to change.
"""

import pytest

from tests.costs.cases import CASES, counted, recorded

NEAR = 0.02  # part of a count that functions of another processor's library may move it by
SMALL_DIFFERENCE = 2  # the same of small counts: one step or two more


@pytest.mark.parametrize("name", CASES)
def test_an_integration_costs_what_is_on_record(name):
    before, now = recorded()[name], counted(name)
    assert now.keys() == before.keys()
    for method, counts in now.items():
        for kind, count in counts.items():
            was = before[method][kind]
            few = SMALL_DIFFERENCE * (1 if kind == "steps" else counts["evaluations"] // counts["steps"])
            assert abs(count - was) <= max(NEAR * was, few), f"{method}: {kind} {was} -> {count}"


def test_every_case_is_on_record():
    assert recorded().keys() == CASES.keys()
    assert len(CASES) == 15
