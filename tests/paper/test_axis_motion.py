"""The planetoid on its axis and beside it: the model, and what it shows."""

import math

import numpy as np
import pytest

import problems
from hbvm_bench.studies.paper.experiments import axis_motion
from hbvm_bench.studies.paper.sitnikov_part import chaotic_from
from integrators import integrate
from integrators.methods.hbvm import HBVM


def test_the_model_agrees_with_the_three_bodies():
    e, turns = 0.75, 3
    program = axis_motion.METHOD.compile(axis_motion.AXIS)
    stepper = program.start(np.array(axis_motion.START), axis_motion.AXIS.pack({"e": e}), math.pi)
    model = stepper.advance(math.pi + axis_motion.TURN * np.arange(1.0, turns + 1)).y
    times = axis_motion.period(e) * np.arange(1, turns + 1)
    problem = problems.load("sitnikov", e=e, t_end=100.0)
    bodies = integrate(problem, HBVM(k=16, s=8, h=0.125), times=times).y
    height = bodies[:, 8] - bodies[:, 2]
    np.testing.assert_allclose(model[:, 0], height, atol=2e-4)  # 4e-5: the planetoid's mass is 1e-5


def test_the_paper_s_orbit_is_regular_along_the_axis_and_unstable_off_it():
    found = axis_motion.growth(0.75, 0.5, turns=(70, 400))
    (_, early), (_, late) = found.along
    assert late < 0.35 * early  # 5.8e-3, 1.1e-3: log t / t
    assert found.across == pytest.approx(0.777, abs=0.002)  # 0.7770
    assert found.left is None


def test_a_faster_planetoid_leaves():
    found = axis_motion.growth(0.75, 0.8, turns=(60,))
    assert found.left is not None  # in revolution 5
    assert found.left <= 60


def test_an_offset_from_the_axis_grows_as_with_the_three_bodies():
    offset, revolution = 1e-12, axis_motion.period(0.75)
    program = axis_motion.METHOD.compile(axis_motion.OFFSETS)
    y0 = np.array([*axis_motion.START, 0.6, 0.8, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    stepper = program.start(y0, axis_motion.OFFSETS.pack({"e": 0.75}), math.pi)
    model = stepper.advance(np.array([math.pi + axis_motion.TURN])).y[0]
    problem = problems.load("sitnikov", e=0.75, t_end=45.0)
    beside = problem.y0.copy()
    beside[6] = offset
    bodies = HBVM(k=16, s=8, h=0.0625).compile(problem.system).start(beside, problem.par, 0.0)
    y = bodies.advance(np.array([revolution])).y[0]
    grown = math.log(math.hypot(y[6], y[7]) / offset)
    assert grown > 10  # 16.2
    assert model[9] + math.log(math.hypot(model[5], model[6])) == pytest.approx(grown, rel=1e-3)


def test_the_first_eccentricity_whose_rate_no_longer_falls_is_found():
    def row(e, early, late, left=None):
        return axis_motion.Growth(e=e, along=[(70, early), (1000, late)], across=0.7, left=left)

    regular, chaotic = row(0.5, 5e-3, 5e-4), row(0.9, 5e-3, 4e-3)
    assert chaotic_from([regular, chaotic]) == 0.9
    assert chaotic_from([regular]) is None
    assert chaotic_from([regular, row(0.7, 5e-3, 5e-4, left=12)]) == 0.7


def test_a_section_of_a_regular_orbit_stays_near_its_curve():
    ((_, orbit),) = axis_motion.section(0.75, speeds=(0.5,), turns=60)
    assert orbit.shape == (61, 2)
    assert np.abs(orbit[:, 0]).max() < 1.75  # 1.68
    assert np.abs(orbit[:, 1]).max() < 0.52


def test_the_map_tells_who_stays():
    left = axis_motion.stays(es=(0.0, 0.75), speeds=(0.3, 1.4), turns=20)
    assert np.isnan(left[:, 0]).all()
    assert (left[:, 1] <= 20).all()
