"""Which settings are timed again after the first compilation."""

from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.run.front import behind
from tests.hbvm_bench import made_up_run


def test_a_setting_behind_another_of_its_method_is_not_timed_again():
    settings = [
        ("Gauss(s=8, h=0.1)", 1.0, 1e-12),
        ("Gauss(s=2, h=0.1)", 2.1, 1e-6),  # slower than twice the first, and less accurate
        ("Gauss(s=4, h=0.1)", 1.9, 1e-6),
        ("Gauss(s=16, h=0.1)", 9.0, 1e-13),  # more accurate than all
        ("Gauss(s=8, tol=1e-12)", 5.0, 1e-6),  # its step size is adaptive: it has no rival
        ("IAS15()", 50.0, 1e-6),  # nor has another library's
        ("Gauss(s=8, h=0.2)", None, 1e-6),  # without times
    ]
    cases = [resolve(Case(problem="kepler", method=method)) for method, _, _ in settings]
    records = [
        made_up_run.record(case, [seconds] if seconds else [], metrics={"energy_max": e, "position_end": e})
        for case, (_, seconds, e) in zip(cases, settings, strict=True)
    ]
    found = behind(cases, records, [record.timing or made_up_run.Timing() for record in records])
    assert found == [False, True, False, False, False, False, False]
