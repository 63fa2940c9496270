"""REBOUND's splittings converge with the order that they state, and what each is made for."""

import numpy as np
import pytest

import problems
from integrators import BS, EOS, HBVM, JANUS, MERCURIUS, SABA, TRACE, WHFast, integrate
from integrators.protocol import Checkpoints, offers

PLANETS = problems.load("outer_solar_system", t_end=96.0)
TRUTH = integrate(PLANETS, HBVM()).y[-1]


def error(method):
    return np.abs(integrate(PLANETS, method).y[-1] - TRUTH).max()


@pytest.mark.parametrize(
    ("method", "options", "h"),
    [
        (SABA, {"type": "1"}, 0.2),
        (SABA, {"type": "CL_1"}, 0.2),
        (EOS, {"phi0": "LF4", "phi1": "LF4", "n": 2}, 0.2),
        (JANUS, {"order": 2}, 0.02),
        (JANUS, {"order": 4}, 0.08),
        (JANUS, {"order": 6}, 0.2),
        (JANUS, {"order": 10}, 0.4),
        (MERCURIUS, {}, 0.2),
        (TRACE, {}, 0.2),
    ],
    ids=str,
)
def test_errors_fall_with_the_stated_order(method, options, h):
    long, short = (method(h=step, **options) for step in (h, h / 2))
    slope = np.log2(error(long) / error(short))
    assert slope == pytest.approx(long.order, abs=0.35)  # measured 2.00, 3.99, 5.97, 9.68


def test_the_generalized_order_of_saba_shows_on_planets():
    # Leapfrogs about the Sun: e h^2 against e h^10 + e^2 h^6 + e^3 h^4.
    assert error(SABA(h=0.5)) < 1e-11  # 1.2e-12; WHFast 2.4e-4
    assert error(WHFast(h=0.5)) > 1e-5


def test_janus_comes_back_to_its_start():
    method = JANUS(h=0.02, order=2)  # off by 2e-4 at the end of 96 years
    there = integrate(PLANETS, method, [0.0, 40.0])
    back = integrate(problems.Problem(PLANETS.system, y0=there.y[-1], t0=40.0, t_end=0.0), method)
    # Its integers come back; momenta become velocities and back on the way, which rounds.
    assert np.abs(back.y[-1] - PLANETS.y0).max() < 1e-11  # 1.6e-12


def test_an_encounter_that_whfast_does_not_resolve_is_resolved_by_the_hybrids():
    problem = problems.load("outer_solar_system", t_end=20.0)
    dof = problem.y0.size // 2
    start = problem.y0.copy()
    mass = np.ravel(problem.system.unpack(problem.par)["m"])
    # Saturn starts next to Jupiter, with its velocity.
    start[6:9] = start[3:6] + np.array([0.0, 0.1, 0.0])
    start[dof + 6 : dof + 9] = start[dof + 3 : dof + 6] * mass[2] / mass[1]
    close = problems.Problem(problem.system, y0=start, t_end=20.0)
    methods = WHFast(h=0.3), MERCURIUS(h=0.3), TRACE(h=0.3), BS(eps_rel=1e-13, eps_abs=1e-13)
    errors = {type(one).__name__: integrate(close, one).errors()["energy"].max() for one in methods}
    # WHFast 0.8, MERCURIUS 5e-7, TRACE 3e-5
    assert errors["MERCURIUS"] < 0.1 * errors["WHFast"]
    assert errors["TRACE"] < 0.1 * errors["WHFast"]


@pytest.mark.parametrize("method", [SABA(h=0.1), EOS(h=0.1), MERCURIUS(h=0.1), TRACE(h=0.1)], ids=repr)
def test_methods_about_a_dominant_body_say_where_there_is_none(method):
    assert method.caveat(PLANETS) is None
    assert "no body dominates" in method.caveat(problems.load("figure_eight"))
    assert "needs gravitating bodies" in method.accepts(problems.load("henon_heiles"))


def test_bs_says_that_it_has_no_checkpoints():
    kepler = problems.load("kepler")
    assert not offers(BS().compile(kepler.system).start(kepler.y0), Checkpoints)
