import pytest
import rebound

import integrators.testing as testing
from integrators.peers.diffrax.methods import (
    Dopri8,
    Kvaerno5,
    LeapfrogMidpoint,
    ReversibleHeun,
    SemiImplicitEuler,
    Tsit5,
)
from integrators.peers.heyoka.taylor import Taylor
from integrators.peers.pyhamsys import Composition
from integrators.peers.pynamicalsys import ImplicitMidpoint, Yoshida4
from integrators.peers.rebound import (
    BS,
    EOS,
    IAS15,
    JANUS,
    MERCURIUS,
    SABA,
    TRACE,
    Leapfrog,
    WHFast,
    WHFast512,
)
from integrators.peers.scipy import BDF, DOP853, LSODA, Radau
from integrators.peers.sundials import CVODE

AVX512 = pytest.mark.skipif(not rebound.avx512_available, reason="this processor has no AVX-512")

# One of each engine in every run; the other ways through it take as long and are slow tests.
SLOW = pytest.mark.slow

CASES = [
    (Taylor(), testing.two_bodies),
    pytest.param(Taylor(tol=1e-12, high_accuracy=True, compact_mode=True), testing.pendulum, marks=SLOW),
    (IAS15(), testing.two_bodies),
    pytest.param(IAS15(mode="global", h=0.01), testing.pendulum, marks=SLOW),
    (WHFast(h=0.05), testing.two_bodies),
    pytest.param(WHFast(h=0.05, corrector=17, kernel="lazy"), testing.two_bodies, marks=SLOW),
    pytest.param(WHFast(h=0.05, coordinates="whds", body_order=(1, 0)), testing.two_bodies, marks=SLOW),
    pytest.param(WHFast512(h=0.05, corrector=17), testing.two_bodies, marks=AVX512),
    (SABA(h=0.05), testing.two_bodies),
    pytest.param(SABA(h=0.05, type="CL_2"), testing.two_bodies, marks=SLOW),
    (EOS(h=0.02, phi0="LF4", phi1="LF6", n=3), testing.two_bodies),
    (JANUS(h=0.02, order=8), testing.two_bodies),
    pytest.param(JANUS(h=0.02, order=4), testing.pendulum, marks=SLOW),
    (MERCURIUS(h=0.02), testing.two_bodies),
    (TRACE(h=0.02), testing.two_bodies),
    pytest.param(TRACE(h=0.02, peri_mode="FULL_IAS15"), testing.two_bodies, marks=SLOW),
    (BS(eps_rel=1e-12, eps_abs=1e-12), testing.two_bodies),
    pytest.param(BS(eps_rel=1e-10, eps_abs=1e-10, h=0.01), testing.pendulum, marks=SLOW),
    (Leapfrog(h=0.02, order=8), testing.two_bodies),
    pytest.param(Leapfrog(h=0.02, order=4), testing.pendulum, marks=SLOW),
    (SemiImplicitEuler(h=0.001), testing.two_bodies),
    pytest.param(LeapfrogMidpoint(h=0.01), testing.pendulum, marks=SLOW),
    pytest.param(ReversibleHeun(h=0.01), testing.pendulum, marks=SLOW),
    pytest.param(Dopri8(h=0.05), testing.pendulum, marks=SLOW),
    (Dopri8(rtol=1e-9, atol=1e-11), testing.pendulum),
    pytest.param(Tsit5(rtol=1e-8, atol=1e-10), testing.pendulum, marks=SLOW),
    pytest.param(Kvaerno5(rtol=1e-6, atol=1e-8), testing.pendulum, marks=SLOW),
    (DOP853(rtol=1e-9, atol=1e-12), testing.two_bodies),
    (Radau(rtol=1e-7, atol=1e-9), testing.pendulum),
    pytest.param(BDF(rtol=1e-7, atol=1e-9), testing.pendulum, marks=SLOW),
    (LSODA(rtol=1e-9, atol=1e-11), testing.two_bodies),
    (CVODE(rtol=1e-8, atol=1e-10), testing.pendulum),
    pytest.param(CVODE(rtol=1e-9, atol=1e-11, method="Adams"), testing.two_bodies, marks=SLOW),
    pytest.param(Composition(h=0.02), testing.two_bodies, marks=SLOW),
    (Composition(h=0.05, type="RKN6a"), testing.pendulum),
    (Yoshida4(h=0.02), testing.two_bodies),
    (ImplicitMidpoint(h=0.05), testing.pendulum),
]


def _name(case):
    return repr(getattr(case, "values", case)[0])


@pytest.mark.parametrize("check", testing.CHECKS, ids=testing.name_of)
@pytest.mark.parametrize(("method", "problem"), CASES, ids=map(_name, CASES))
def test_conforms(method, problem, check):
    if isinstance(method, WHFast512) and check is testing.samples_leave_the_steps_alone:
        pytest.xfail("REBOUND synchronises WHFast512 at a sample, which rounds: measured 1.1e-13")
    if isinstance(method, MERCURIUS) and check is testing.samples_leave_the_steps_alone:
        pytest.xfail("REBOUND changes MERCURIUS' coordinates at a sample, which rounds: measured 8e-17")
    check(method, problem())
