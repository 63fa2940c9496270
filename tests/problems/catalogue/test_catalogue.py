"""Every problem: how it prints, what it says about itself, what it refuses."""

import inspect

import numpy as np
import pytest

import problems
from hbvm_bench.campaign.identity import make_problem
from problems import registry
from problems.errors import InputError, UnknownNameError

NAMES = problems.names()


@pytest.mark.parametrize("name", NAMES)
def test_every_problem_prints_as_the_call_that_makes_it(name):
    problem = problems.load(name)
    assert problem.name == name
    assert make_problem(repr(problem)) == problem


def test_every_small_variant_prints_as_the_call_that_makes_it(small):
    assert make_problem(repr(small)) == small


@pytest.mark.parametrize("name", registry.built_in())
def test_every_problem_says_where_it_comes_from_and_what_it_tests(name):
    problem = problems.load(name)
    assert problem.title
    assert problem.notes
    assert problem.references
    text = inspect.getdoc(registry.factory(name)) or ""
    assert "Tests " in text, "what it tests"
    for argument in inspect.signature(registry.factory(name)).parameters:
        assert argument in text.partition("Returns")[0], f"{argument} is not documented"


@pytest.mark.parametrize("name", registry.built_in())
def test_every_problem_keeps_an_energy(name):
    assert problems.load(name).system.invariant_names[0] == "energy"


@pytest.mark.parametrize("name", NAMES)
def test_an_unknown_argument_is_refused_with_suggestions(name):
    with pytest.raises(UnknownNameError, match="t_end"):
        problems.load(name, t_emd=1.0)


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("charged_particle", {"x": 0.0, "y": 0.0}, "singular centre"),
        ("cluster", {"n": 1}, "n=1 of cluster must be a whole number of at least 2"),
        ("cluster", {"softening": 0.0}, "softening=0.0 of cluster must be a positive number"),
        ("cr3bp", {"loops": 5}, "loops=5 of cr3bp must be one of 4, 3, 2"),
        ("cr3bp", {"mu": 1.5}, "mu=1.5 of cr3bp must be a number between 0 and 1"),
        ("diatomic", {"r": -1.0}, "r=-1.0 of diatomic must be a positive number"),
        ("double_pendulum", {"l1": 0.0}, "l1=0.0 of double_pendulum must be a positive number"),
        ("figure_eight", {"t_end": float("inf")}, "t_end=inf of figure_eight must be a finite number"),
        ("fput", {"start": "modes"}, "did you mean 'mode'"),
        ("fput", {"n": 2.5}, "n=2.5 of fput must be a whole number"),
        ("henon_heiles", {"energy": 0.05}, "less than the potential"),
        ("henon_heiles", {"energy": float("nan")}, "energy=nan of henon_heiles"),
        ("kepler", {"e": 1.0}, "e=1.0 of kepler must be an eccentricity"),
        ("kepler", {"e": "half"}, "e='half' of kepler must be an eccentricity"),
        ("kepler", {"e": True}, "e=True of kepler must be an eccentricity"),
        ("lennard_jones", {"rings": 0}, "rings=0 of lennard_jones"),
        ("lotka_volterra", {"t_end": 10**400}, "must be a finite number"),
        ("morse", {"m": -1.0}, "m=-1.0 of morse must be a positive number"),
        ("nonlinear_wave", {"n": 2}, "n=2 of nonlinear_wave"),
        ("outer_solar_system", {"unit": "days"}, "did you mean 'day'"),
        ("outer_solar_system", {"frame": "galactic"}, "did you mean 'barycentric'"),
        ("pendulum", {"q": None}, "q=None of pendulum"),
        ("penning_trap", {"omega_c": 1.0}, "does not hold the particle"),
        ("period_annulus", {"a": (1.0, 2.0)}, "must be a list of 4 finite numbers"),
        ("pythagorean", {"t_end": 0}, "must differ from t0"),
        ("rigid_body", {"quartic": "x"}, "quartic='x' of rigid_body"),
        ("sine_gordon", {"gamma": 0.0}, "gamma=0.0 of sine_gordon must be a positive number"),
        ("solar_system", {"unit": "century"}, "unit of solar_system"),
        ("spring_pendulum", {"k": 0.0}, "k=0.0 of spring_pendulum must be a positive number"),
        ("stiff_chain", {"springs": 1}, "springs=1 of stiff_chain"),
        ("toda", {"n": 2}, "n=2 of toda must be a whole number of at least 3"),
    ],
)
def test_values_out_of_range_are_refused_by_name(name, arguments, message):
    with pytest.raises(InputError) as caught:
        problems.load(name, **arguments)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_large_families_scale_by_their_arguments():
    for name, arguments, dim in (
        ("cluster", {"n": 200}, 1200),
        ("fput", {"n": 1000}, 2000),
        ("lennard_jones", {"rings": 3}, 4 * 37),
        ("nonlinear_wave", {"n": 1000}, 2000),
        ("sine_gordon", {"n": 1000}, 2000),
        ("stiff_chain", {"springs": 10}, 40),
        ("toda", {"n": 1000}, 2000),
    ):
        problem = problems.load(name, **arguments)
        assert problem.system.dim == dim
        assert np.isfinite(problem.invariants(problem.y0)["energy"]).all()


def test_n_body_problems_say_so_for_engines_that_know_bodies():
    bodies = {name for name in NAMES if problems.load(name).system.bodies is not None}
    assert bodies >= {"sitnikov", "outer_solar_system", "solar_system", "figure_eight", "pythagorean"}
    assert "cluster" not in bodies  # softened
