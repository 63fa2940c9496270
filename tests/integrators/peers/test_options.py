"""Options, refusals and citations of the peers; what needs no library."""

import subprocess
import sys

import numpy as np
import pytest

import integrators.testing as testing
from integrators import registry
from integrators.peers.diffrax.methods import Dopri8, LeapfrogMidpoint, ReversibleHeun, SemiImplicitEuler
from integrators.peers.heyoka.taylor import Taylor
from integrators.peers.pyhamsys import Composition
from integrators.peers.pynamicalsys import ImplicitMidpoint, Yoshida4
from integrators.peers.rebound import IAS15, Leapfrog, WHFast
from integrators.peers.scipy import DOP853, RTOL_FLOOR, Radau
from integrators.peers.sundials import CVODE
from problems import Bodies, Hamiltonian, Problem, VectorField
from problems.errors import InputError, MissingLibraryError, UnknownNameError

METHODS = [
    Taylor(),
    IAS15(),
    WHFast(h=0.1),
    Leapfrog(h=0.1),
    SemiImplicitEuler(h=0.1),
    LeapfrogMidpoint(h=0.1),
    ReversibleHeun(h=0.1),
    Dopri8(h=0.1),
    DOP853(rtol=1e-9, atol=1e-9),
    Radau(rtol=1e-9, atol=1e-9),
    Yoshida4(h=0.1),
    ImplicitMidpoint(h=0.1),
    CVODE(rtol=1e-9, atol=1e-9),
    Composition(h=0.1),
]


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("Taylor", {"tol": 0.0}, "a number between 0 and 1"),
        ("Taylor", {"tol": "small"}, "tol='small'"),
        ("Taylor", {"compact_mode": "yes"}, "compact_mode='yes' of Taylor must be True or False"),
        ("IAS15", {"epsilon": -1.0}, "epsilon=-1.0"),
        ("IAS15", {"epsilon": 0}, "give their length, h="),
        ("IAS15", {"mode": "prs25"}, "did you mean 'prs23'"),
        ("IAS15", {"min_dt": float("nan")}, "min_dt=nan"),
        ("IAS15", {"h": 0.0}, "h=0.0"),
        ("WHFast", {"h": -0.1}, "h=-0.1"),
        ("WHFast", {"h": 0.1, "coordinates": "jacobbi"}, "did you mean 'jacobi'"),
        ("WHFast", {"h": 0.1, "kernel": "lazzy"}, "did you mean 'lazy'"),
        ("WHFast", {"h": 0.1, "corrector": 4}, "0, 3, 5, 7, 11, 17"),
        ("WHFast", {"h": 0.1, "corrector": 3, "coordinates": "whds"}, "corrector=3"),
        ("WHFast", {"h": 0.1, "corrector2": True, "coordinates": "barycentric"}, "corrector2=True"),
        ("WHFast", {"h": 0.1, "kernel": "lazy", "coordinates": "whds"}, "kernel='lazy'"),
        ("WHFast", {"h": 0.1, "body_order": (0, 2)}, "each body from 0 once"),
        ("WHFast", {"h": 0.1, "body_order": 3}, "body_order=3"),
        ("Leapfrog", {"h": 0.1, "order": 3}, "2, 4, 6, 8"),
        ("Leapfrog", {"h": True}, "h=True"),
        ("SemiImplicitEuler", {"h": float("inf")}, "h=inf"),
        ("Dopri8", {}, "either h"),
        ("Dopri8", {"h": 0.1, "rtol": 1e-9}, "either h"),
        ("Dopri8", {"rtol": 1e-9}, "both tolerances"),
        ("DOP853", {"rtol": 1e-14, "atol": 0.0}, f"rtol={RTOL_FLOOR!r}"),
        ("Radau", {"rtol": 1e-9, "atol": -1.0}, "atol=-1.0"),
        ("DOP853", {"rtol": 1e-9}, "needs atol"),
    ],
)
def test_a_value_that_does_not_exist_is_refused_in_a_sentence_that_names_it(name, options, says):
    with pytest.raises(InputError) as error:
        registry.create(name, **options)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_the_nearest_option_is_named():
    with pytest.raises(UnknownNameError, match="did you mean 'epsilon'"):
        registry.create("IAS15", epsilom=1e-9)


def test_numbers_are_kept_as_floats_so_that_methods_print_as_literals():
    assert repr(WHFast(h=np.float64(0.5), body_order=[1, 0])) == "WHFast(h=0.5, body_order=(1, 0))"
    assert repr(Taylor(tol=np.float64(1e-15))) == "Taylor(tol=1e-15)"
    assert Dopri8(h=1) == Dopri8(h=1.0)
    assert repr(IAS15(mode="global")) == "IAS15(mode='global')"


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_citations_are_bibtex_without_placeholders(method):
    entries = method.citation.count("@")
    assert entries >= 1
    assert method.citation.count("\n}\n") == entries
    assert method.citation.count("  title = ") == method.citation.count("  author = ") == entries


def not_separable():
    def H(q, p):
        return p[0] * p[0] * (1 + q[0] * q[0]) / 2 + q[0] * q[0] / 2

    return Problem(Hamiltonian(H, dof=1), q0=[1.0], p0=[0.0], t_end=1.0)


def first_order():
    return Problem(VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[1.0, 0.0], t_end=1.0)


def test_methods_say_in_a_sentence_what_they_cannot_integrate():
    assert "gravitating bodies" in (WHFast(h=0.1).accepts(testing.pendulum()) or "")
    assert "3 bodies, the problem 2" in (
        WHFast(h=0.1, body_order=(0, 1, 2)).accepts(testing.two_bodies()) or ""
    )
    for problem in (not_separable(), first_order()):
        for method in (IAS15(), Leapfrog(h=0.1), SemiImplicitEuler(h=0.1), Composition(h=0.1)):
            assert "separable" in (method.accepts(problem) or "")
            with pytest.raises(InputError, match="separable"):
                method.compile(problem.system)
        for method in (Taylor(), Dopri8(h=0.1), ReversibleHeun(h=0.1), LeapfrogMidpoint(h=0.1), METHODS[-2]):
            assert method.accepts(problem) is None


def test_massless_bodies_are_refused():
    problem = testing.two_bodies()
    massless = Problem(problem.system, y0=problem.y0, parameters={"m": (1.0, 0.0)}, t_end=1.0)
    assert "positive masses" in (Leapfrog(h=0.1).accepts(massless) or "")


def test_a_caveat_is_said_where_the_problem_is_outside_the_method_s_domain():
    import problems

    sitnikov = problems.load("sitnikov")
    jacobi = WHFast(h=0.02).caveat(sitnikov) or ""
    assert "no body dominates" in jacobi
    assert "Jacobi orbit of body 2 is radial" in jacobi
    whds = WHFast(h=0.02, coordinates="whds").caveat(sitnikov) or ""
    assert "no body dominates" in whds
    assert "radial" not in whds
    second = WHFast(h=0.02, body_order=(0, 2, 1)).caveat(sitnikov) or ""
    assert "no body dominates" in second
    assert "radial" not in second
    assert "symmetry" in (Dopri8(h=0.1).caveat(sitnikov) or "")
    assert Dopri8(h=0.1).caveat(testing.pendulum()) is None
    assert Taylor().caveat(sitnikov) is None


def test_a_caveat_is_said_where_the_centre_is_not_the_heaviest_body():
    problem = testing.two_bodies()
    light_first = Problem(problem.system, y0=problem.y0, parameters={"m": (1e-3, 1.0)}, t_end=1.0)
    assert "dominant body is not the first" in (WHFast(h=0.1).caveat(light_first) or "")
    assert WHFast(h=0.1, body_order=(1, 0)).caveat(light_first) is None


def test_bodies_with_other_forces_than_gravity_are_refused():
    def H(q, p, par, m):
        r2 = (q[0] - q[2]) * (q[0] - q[2]) + (q[1] - q[3]) * (q[1] - q[3])
        kinetic = sum(p[i] * p[i] / (2 * par.m[i // 2]) for i in range(4))
        return kinetic - par.m[0] * par.m[1] / m.sqrt(r2) + q[0] * q[0]

    system = Hamiltonian(H, dof=4, parameters={"m": (1.0, 1.0)}, bodies=Bodies(dimension=2))
    with pytest.raises(InputError, match="its forces are not their gravity"):
        IAS15().compile(system).start(np.array([0.1, 0.0, 1.0, 0.0, 0.0, 0.5, 0.0, -0.5]))


@pytest.mark.parametrize(
    ("method", "module"),
    [
        (Taylor(), "heyoka"),
        (IAS15(), "rebound"),
        (WHFast(h=0.1), "rebound"),
        (Dopri8(h=0.1), "diffrax"),
        (SemiImplicitEuler(h=0.1), "jax"),
        (DOP853(rtol=1e-9, atol=1e-9), "scipy.integrate"),
        (CVODE(rtol=1e-9, atol=1e-9), "sksundae.cvode"),
        (Composition(h=0.1), "pyhamsys.pyhamsys"),
    ],
    ids=repr,
)
def test_a_missing_library_is_named_with_its_remedy(method, module, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingLibraryError, match=r'is not installed.*pip install "hbvm-bench\[peers\]"'):
        method.compile(testing.two_bodies().system)


@pytest.mark.parametrize("method", [Yoshida4(h=0.1), ImplicitMidpoint(h=0.1)], ids=repr)
def test_a_library_of_no_extra_is_named_with_its_own_remedy(method, monkeypatch):
    monkeypatch.setitem(sys.modules, "pynamicalsys.hamiltonian_systems.fixed_step", None)
    monkeypatch.setitem(sys.modules, "pynamicalsys", None)
    with pytest.raises(MissingLibraryError, match=r"is not installed .* pip install pynamicalsys"):
        method.compile(testing.two_bodies().system)


def test_a_library_without_wheels_for_this_system_is_said_to_have_none(monkeypatch):
    monkeypatch.setitem(sys.modules, "heyoka", None)
    monkeypatch.setattr(sys, "platform", "darwin")
    with pytest.raises(MissingLibraryError, match=r"heyoka is not installed.*wheels for Linux only"):
        Taylor().compile(testing.two_bodies().system)


def test_a_linux_without_wheels_of_scikit_sundae_is_told_where_there_are_some(monkeypatch):
    monkeypatch.setitem(sys.modules, "sksundae.cvode", None)
    monkeypatch.setattr("integrators.peers.machine", lambda: "aarch64")
    with pytest.raises(MissingLibraryError, match=r"scikit-sundae is not installed.*wheels for x86-64 only"):
        CVODE(rtol=1e-9, atol=1e-9).compile(testing.two_bodies().system)


def test_importing_the_peers_imports_no_peer():
    code = (
        "import sys, integrators.peers.heyoka.taylor, integrators.peers.rebound\n"
        "import integrators.peers.pynamicalsys\n"
        "import integrators.peers.diffrax.methods, integrators.peers.scipy\n"
        "heavy = 'heyoka', 'rebound', 'jax', 'diffrax', 'numba', 'scipy.integrate'\n"
        "print([m for m in heavy if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
