import dataclasses
from pathlib import Path

import numpy as np
import pytest

import hbvm_bench.report
import problems
from hbvm_bench.measure import raw
from hbvm_bench.measure.measured import largest_distance, measure
from hbvm_bench.measure.metrics import METRICS, evaluate, find
from hbvm_bench.reference import solutions
from hbvm_bench.store.records import Compile, Timing, TimingRound
from hbvm_bench.summaries.rows import HEADLINE, RANKED_BY
from integrators import Gauss
from integrators.protocol import Stats, Status
from integrators.solution import Solution
from problems.errors import InputError


@pytest.fixture
def sitnikov():
    return problems.load("sitnikov")


def solution(problem, *, t=None, y=None, status=Status.FINISHED, stats=None):
    known = solutions.find(problem)
    assert known is not None
    t = known.t if t is None else t
    y = known.high[: t.size].copy() if y is None else y
    return Solution(
        t=t,
        y=y,
        status=status,
        reason="",
        t_stop=float(t[-1]) if t.size else 3.5,
        stats=stats or Stats(steps=7),
        compile_seconds=0.5,
        from_cache=True,
        problem=problem,
        method=Gauss(s=2, h=0.5),
    )


def of(made, known):
    """Return what is measured on a solution."""
    return measure(made.problem, *raw.of_solution(made), known)


def values(made, **changes):
    known = solutions.find(made.problem)
    return evaluate(dataclasses.replace(of(made, known), **changes))


def test_the_table_is_complete():
    for key, metric in METRICS.items():
        assert key == metric.key
        assert metric.label
        assert metric.short
        assert metric.description.endswith(".")
        assert metric.better in ("lower", None)
        assert metric.scale in ("log", "linear")
    assert {*HEADLINE, RANKED_BY} <= METRICS.keys()
    assert len({metric.short for metric in METRICS.values()}) == len(METRICS)


def test_reports_know_the_metrics_from_the_table_only():
    folder = Path(hbvm_bench.report.__file__).parent
    labels = [metric.description for metric in METRICS.values()]
    text = "".join(path.read_text() for path in [*folder.glob("*.py"), *folder.glob("templates/*")])
    assert not [label for label in labels if label in text]


def test_an_unknown_metric_is_named_with_the_nearest():
    with pytest.raises(InputError, match="'energy_max'"):
        find("energi_max")


def test_the_reference_itself_is_right_to_round_off(sitnikov):
    got = values(solution(sitnikov))
    # measured for the reference rounded to doubles: 7.1e-16, 1.5e-16, 2.2e-16, 1.0e-16
    assert got["energy_max"].value < 1e-15
    assert got["angular_momentum_max"].value < 3e-16
    assert 0 < got["position_max"].value < 4e-16
    assert got["position_end"].value < 3e-16
    assert got["guard_max"].value == 0.0
    assert got["observable_end"].value == pytest.approx(-0.21429082377414022, abs=0)
    # the distance of a double from a number: at most half an ulp of 0.21
    assert got["observable_error"].value <= 2.0**-55
    assert not any(value.excluded for value in got.values())


def test_a_guard_that_is_lost_voids_what_needs_the_trajectory(sitnikov):
    made = solution(sitnikov)
    made.y[3, 7] = -1e-3
    got = values(made)
    assert got["guard_max"].value == 1e-3
    for key, value in got.items():
        expected = METRICS[key].same_trajectory and value.value is not None
        assert value.excluded == expected, key
    assert "off axis reached 0.001 instead of 0" in got["position_end"].why


def test_a_guard_that_is_lost_too_little_to_matter_voids_nothing(sitnikov):
    made = solution(sitnikov)
    made.y[3, 7] = 4e-20
    got = values(made)
    assert got["guard_max"].value == 4e-20
    assert not any(value.excluded for value in got.values())


def test_an_energy_that_is_lost_is_another_trajectory(sitnikov):
    made = solution(sitnikov)
    made.y[-1, 9:] *= 1e10  # the momenta
    got = values(made)
    assert got["energy_max"].value == pytest.approx(1.0)
    assert not got["energy_max"].excluded  # the fact itself
    assert got["position_end"].excluded
    assert got["position_end"].why.startswith("another trajectory: the energy is wrong by ")


def test_an_early_end_voids_the_part(sitnikov):
    known = solutions.find(sitnikov)
    got = values(solution(sitnikov, t=known.t[:5], status=Status.STALLED))
    assert got["energy_max"].excluded
    assert got["energy_max"].why == "only to t = 100"
    assert got["position_end"].why == "ended at t = 100"
    assert not got["compile_seconds"].excluded


def test_no_samples_and_no_finite_values_are_sentences(sitnikov):
    made = solution(sitnikov, t=np.empty(0), y=np.empty((0, 18)), status=Status.STEP_UNDERFLOW)
    got = values(made)
    assert got["energy_max"].why == got["guard_max"].why == "no samples"
    made = solution(sitnikov)
    made.y[4:] = np.nan
    got = values(made)
    assert got["energy_max"].why == got["distance_max"].why == "not finite from t = 100"


def test_positions_of_1e200_are_measured_without_overflow(sitnikov):
    q = np.zeros((1, 9))
    q[0, 6:] = 3e200, 4e200, 0.0
    assert largest_distance(sitnikov, q)[0] == pytest.approx(5e200, rel=4e-16)


def test_what_a_library_does_not_count_is_not_applicable(sitnikov):
    got = values(solution(sitnikov, stats=Stats(steps=7, evaluations=None)))
    assert got["steps"].value == 7
    assert got["evaluations"].why.startswith("not applicable")


def test_times_come_from_the_timing_pass(sitnikov):
    made = solution(sitnikov)
    assert values(made)["warm_seconds"].why == "not timed"
    assert values(made)["compile_seconds"].value == 0.5
    one = TimingRound(samples=[1.0, 3.0], repeats=1, compile=Compile(seconds=0.25, cached=True))
    got = values(made, timing=Timing(rounds=[one]))
    assert got["warm_seconds"].value == 2.0
    assert got["compile_seconds"].value == 0.25
    nothing = TimingRound(samples=[1.0], repeats=1, compile=Compile(seconds=0.0, cached=None))
    why = values(made, timing=Timing(rounds=[nothing]))["compile_seconds"].why
    assert why == "nothing is compiled at run time"


def test_a_problem_without_a_guard_an_observable_or_a_reference_says_so():
    problem = problems.load("kepler")
    t = np.array([problem.t0, problem.t_end])
    made = solution_of(problem, t, np.tile(problem.y0, (2, 1)))
    got = evaluate(of(made, None))
    assert got["observable_end"].why == "the problem declares no observable"
    assert got["guard_max"].why == "the problem declares no symmetry guard"
    assert got["position_end"].why == "no stored reference for this problem"


def solution_of(problem, t, y):
    return Solution(
        t=t, y=y, status=Status.FINISHED, reason="", t_stop=t[-1], stats=Stats(),
        compile_seconds=0.0, from_cache=None, problem=problem, method=Gauss(s=2, h=0.5),
    )  # fmt: skip


def test_nothing_is_ranked_by_a_reference_that_has_the_start_alone():
    """Kepler's reference and the samples of a shorter interval have the start alone in common."""
    problem = problems.load("kepler", t_end=100.0)
    t = np.linspace(0.0, 100.0, 1001)
    got = evaluate(of(solution_of(problem, t, np.tile(problem.y0, (t.size, 1))), solutions.find(problem)))
    for key in ("position_end", "position_max", "position_mean", "phase_end", "phase_max"):
        assert got[key].value is None
        assert got[key].why == "the stored reference has none of the run's times after the start"
