"""Which settings are timed again after the first compilation."""

import pytest

from hbvm_bench.campaign.file import Case, load
from hbvm_bench.campaign.identity import make_problem, resolve
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.front import behind, chosen
from tests.hbvm_bench import made_up_run

SETTINGS = [
    ("Gauss(s=8, h=0.1)", 1.0, 1e-12),
    ("Gauss(s=2, h=0.1)", 2.1, 1e-6),  # slower than twice the first, and less accurate
    ("Gauss(s=4, h=0.1)", 1.9, 1e-6),
    ("Gauss(s=16, h=0.1)", 9.0, 1e-13),  # more accurate than all
    ("Taylor(tol=1e-15)", 5.0, 1e-12),
    ("IAS15()", 50.0, 1e-6),  # not as accurate as is asked for
    ("IAS15(epsilon=1e-10)", 60.0, 1e-12),  # the fastest of its method that is
    ("IAS15(epsilon=1e-11)", 130.0, 1e-12),
    ("Gauss(s=8, h=0.2)", None, 1e-6),  # without times
]


def records():
    cases = [resolve(Case(problem="kepler", method=method)) for method, _, _ in SETTINGS]
    return [
        made_up_run.record(case, [seconds] if seconds else [], metrics={"energy_max": e, "position_end": e})
        for case, (_, seconds, e) in zip(cases, SETTINGS, strict=True)
    ]


def test_a_setting_far_from_the_fastest_at_every_error_that_it_reaches_is_not_timed_again():
    there = records()
    found = behind(there, [record.timing or made_up_run.Timing() for record in there])
    assert [record.id in found for record in there] == [
        *(False, True, False, False, True, True, True, True, False)
    ]


def test_at_the_errors_asked_for_each_method_has_a_setting_that_is_compared():
    there = records()
    found = chosen(there, [{"energy_max": 1e-11, "position_end": 1e-10}])
    assert [record.case.method for record in there if record.id in found] == [
        *("Gauss(s=8, h=0.1)", "Taylor(tol=1e-15)", "IAS15(epsilon=1e-10)")
    ]


@pytest.mark.parametrize("study", ["race", "large", "encounters"])
def test_the_errors_asked_for_are_found_by_the_problem_as_cases_print_it(study):
    """A campaign writes ``fput(n=32)``, its cases ``fput(n=32, alpha=0.25, ...)``."""
    campaign = load(study)
    printed = {repr(make_problem(case.problem)) for case in campaign.cases()}
    assert printed <= {*standings.asked(campaign)}
