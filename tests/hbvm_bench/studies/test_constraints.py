"""The methods of the study of constraints: their orders, and what they keep."""

import numpy as np
import pytest

import problems
from hbvm_bench.studies.constraints.ida import IDA
from hbvm_bench.studies.constraints.rattle import Rattle
from hbvm_bench.studies.constraints.systems import hanging
from integrators import HBVM, integrate
from problems.errors import InputError, MissingLibraryError

TIMES = [2.0]


@pytest.mark.parametrize(
    ("order", "steps"),
    [
        (2, [0.02, 0.01]),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in ((4, [0.04, 0.02]), (6, [0.1, 0.05]), (8, [0.25, 0.125]))
        ),
    ],
)
def test_rattle_and_its_compositions_have_their_orders_and_keep_constraints(order, steps):
    problem = hanging(2, 0.5)
    end = integrate(problem, HBVM(), TIMES).q
    runs = [integrate(problem, Rattle(composed=order, h=h), TIMES) for h in steps]
    errors = [np.abs(run.q - end).max() for run in runs]
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.5
    for run in runs:
        found = run.errors()
        assert (
            max(found[name].max() for name in ("constraints", "constraint_rates")) < 2e-15
        )  # measured 5e-16


def test_ida_integrates_the_equations_of_index_2():
    problem = hanging(2, 0.5)
    try:
        run = integrate(problem, IDA(rtol=1e-10), TIMES)
    except MissingLibraryError:
        pytest.skip("scikit-sundae is not installed")
    assert np.abs(run.q - integrate(problem, HBVM(), TIMES).q).max() < 1e-7
    stepper = IDA(rtol=1e-10).compile(problem.system).start(problem.y0, problem.par)
    sampled = stepper.advance(np.array([1.0, *TIMES]))
    assert np.array_equal(sampled.y[-1], run.y[-1])
    assert stepper.stats.steps > 100  # 319 measured; a call to a single time does not tell
    assert run.errors()["constraint_rates"].max() < 1e-8  # measured 3e-10 in 20 units of time


@pytest.mark.parametrize("method", [Rattle(h=0.1), IDA(rtol=1e-6)], ids=repr)
def test_a_system_without_constraints_is_refused(method):
    with pytest.raises(InputError, match="it needs constraints"):
        integrate(problems.load("kepler"), method, TIMES)
