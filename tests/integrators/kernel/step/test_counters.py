"""What the steps have cost can be told from what partial steps have, which depends on the times asked for."""

import numpy as np
import pytest

import problems
from hbvm_bench.studies.general import decay_chain, diffusion
from integrators import HBVM, Gauss, integrate

CASES = {
    "adaptive, first-order form": (decay_chain, HBVM()),
    "adaptive, second-order form": (lambda: problems.load("kepler", e=0.6, t_end=20.0), HBVM()),
    "fixed": (lambda: problems.load("kepler", e=0.6, t_end=20.03), Gauss(s=8, h=0.1)),
    "Newton": (diffusion, HBVM(solver="newton")),
}


@pytest.mark.parametrize("name", CASES)
def test_iterations_less_those_of_partial_steps_do_not_depend_on_the_times(name):
    make, method = CASES[name]
    problem = make()
    found, evaluations = [], []
    for count in (1, 10, 100):
        stats = integrate(problem, method, np.linspace(0.0, problem.t_end, count + 1)[1:]).stats
        extra = stats.extra
        assert extra["partial_steps"] == count - 1  # the last time is the end of the last step
        assert stats.iterations > extra["partial_iterations"] >= count - 1
        assert stats.evaluations > extra["partial_evaluations"] >= extra["partial_iterations"]
        found.append((stats.steps, stats.iterations - extra["partial_iterations"]))
        evaluations.append(stats.evaluations - extra["partial_evaluations"])
        if "implicit" in extra:
            work = extra["implicit"]
            assert work["corrections"] > work["partial_corrections"] >= count - 1
            found[-1] += (
                work["corrections"] - work["partial_corrections"],
                work["jacobians"] - work["partial_jacobians"],
            )
    assert found[0] == found[1] == found[2]
    # Where a time lies behind the last node of a step, the field at the step's end is looked at first.
    assert max(evaluations) - min(evaluations) <= 6  # measured 4, 2, 0 and 0


def test_all_iterations_are_more_where_more_times_are_asked_for():
    problem = decay_chain()
    few, many = (
        integrate(problem, HBVM(), np.linspace(0.0, problem.t_end, count + 1)[1:]).stats.iterations
        for count in (1, 100)
    )
    assert (many or 0) > 1.5 * (few or 1)  # measured 941 and 501
