"""Every problem: how it prints, what it says about itself, what it refuses."""

import inspect

import numpy as np
import pytest

import problems
from hbvm_bench.campaign.identity import make_problem
from problems import registry
from problems.errors import UnknownNameError

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
    assert next(iter(problems.load(name).system.invariants)) == "energy"


@pytest.mark.parametrize("name", NAMES)
def test_an_unknown_argument_is_refused_with_suggestions(name):
    with pytest.raises(UnknownNameError, match="t_end"):
        problems.load(name, t_emd=1.0)


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
