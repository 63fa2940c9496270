"""MEGNO and the largest exponent as metrics: only of cases that ask for them, with a reason where missing."""

import pytest

import problems
from hbvm_bench.campaign import identity
from hbvm_bench.campaign.file import Case, Checks, Limits
from hbvm_bench.campaign.grid import Grid
from hbvm_bench.campaign.identity import case_key, resolve
from hbvm_bench.measure import chaos, reading
from hbvm_bench.store.store import Store
from integrators import Gauss, lyapunov
from integrators.dynamics import megno
from tests.hbvm_bench.conftest import run_case

NAMES = ("megno", "exponent", "exponent_low", "exponent_high")
REGULAR = "henon_heiles(energy=0.08, q2=0.05, t_end=400.0)"
METHOD, PEER = "Gauss(s=6, h=0.25)", "DOP853(rtol=1e-10, atol=1e-12)"


def read(directory, problem, method, checks):
    store = Store(directory)
    store.prepare()
    case = Case(problem=problem, method=method, grid=Grid(count=4), checks=checks)
    record = run_case(case, str(store.directory), Limits(wall_seconds=120))
    series = store.series(record.id)
    return reading.read(record, series).result, series


def test_a_case_that_asks_has_them_as_its_method_computes_them(tmp_path):
    result, series = read(tmp_path, REGULAR, METHOD, Checks(chaos=True))
    problem = identity.make_problem(REGULAR)
    exponents = lyapunov(problem, Gauss(s=6, h=0.25), count=1)
    metrics = [result.metrics[name].value for name in NAMES]
    assert metrics == [
        megno(problem, Gauss(s=6, h=0.25)).value,
        exponents.exponents[0],
        *exponents.intervals[0],
    ]
    assert metrics[0] == pytest.approx(2.0, abs=0.3)  # measured: 1.818
    assert metrics[2] < 0.0 < metrics[3]
    assert series["chaos.exponent"].shape == (3,)


def test_a_method_without_variations_has_the_reason(tmp_path):
    result, series = read(tmp_path, REGULAR, PEER, Checks(chaos=True))
    assert result.outcome == "ok"
    for name in NAMES:
        assert result.metrics[name].value is None
        assert "has no variations" in result.metrics[name].why
    assert not any(name.startswith("chaos.") for name in series)


def test_a_case_that_does_not_ask_has_none(tmp_path):
    result, _ = read(tmp_path, REGULAR, METHOD, Checks())
    assert {result.metrics[name].why for name in NAMES} == {"not asked for"}


def test_a_trajectory_that_fails_has_the_reason():
    problem = problems.load("henon_heiles", energy=2.0, t_end=200.0)  # escapes
    reasons, series = chaos.beside(problem, Gauss(s=2, h=0.5))
    assert {*reasons} == {"megno", "exponent"}
    assert not series
    reasons, series = chaos.beside(problems.load("henon_heiles", t_end=2.0), Gauss(s=4, h=0.5))
    assert "too few steps" in reasons["exponent"]
    assert [*series] == ["chaos.megno"]


def test_only_cases_that_ask_have_other_ids():
    def id_of(checks):
        return resolve(Case(problem="kepler", method=METHOD, checks=checks)).id

    plain, back, asked = map(id_of, (Checks(), Checks(reversal=0.5), Checks(chaos=True)))
    assert len({plain, back, asked}) == 3
    resolved = resolve(Case(problem="kepler", method=METHOD, checks=Checks(reversal=0.5)))
    assert (
        case_key(resolved.case, resolved.problem, resolved.method, resolved.times)["checks"]["reversal"]
        == 0.5
    )
