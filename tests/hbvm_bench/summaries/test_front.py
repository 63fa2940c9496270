"""Which settings are timed again after the first compilation."""

from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.summaries.front import behind
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


def found(asked):
    cases = [resolve(Case(problem="kepler", method=method)) for method, _, _ in SETTINGS]
    records = [
        made_up_run.record(case, [seconds] if seconds else [], metrics={"energy_max": e, "position_end": e})
        for case, (_, seconds, e) in zip(cases, SETTINGS, strict=True)
    ]
    return behind(records, [record.timing or made_up_run.Timing() for record in records], asked)


def test_a_setting_far_from_the_fastest_at_every_error_that_it_reaches_is_not_timed_again():
    assert found([]) == [False, True, False, False, True, True, True, True, False]


def test_at_the_errors_asked_for_the_fastest_of_each_method_is_timed_again():
    asked = [{"energy_max": 1e-11, "position_end": 1e-10}]
    assert found(asked) == [False, True, False, False, False, True, False, True, False]
