"""A stepper that begins anew goes on as a new one does, bit for bit."""

import pytest

import problems
from integrators import HBVM, Gauss
from problems import Problem, VectorField


def stiff(t, y, par, m):
    return [y[1], par.mu * (1 - y[0] * y[0]) * y[1] - y[0] + m.cos(t)]


STIFF = Problem(VectorField(stiff, dim=2, parameters={"mu": 200.0}), y0=[2.0, 0.0], t_end=1.0)
HARD = Problem(VectorField(lambda t, y, m: [-2e4 * (y[0] - m.cos(t))], dim=1), y0=[0.5], t_end=1.0)
CASES = {
    "Kepler": (problems.load("kepler", e=0.6), HBVM(k=8, s=4, h=0.1)),
    "slow iterations": (problems.load("double_pendulum"), Gauss(s=4, h=0.2)),
    "stiff": (STIFF, HBVM(k=6, s=3, h=0.02)),
    "very stiff": (HARD, Gauss(s=3, h=0.05)),
    "Newton": (STIFF, Gauss(s=3, h=0.02, solver="newton")),
    "blended": (STIFF, Gauss(s=3, h=0.02, solver="blended")),
}


@pytest.mark.parametrize("name", CASES)
def test_nothing_of_the_trajectory_before_remains(name):
    problem, method = CASES[name]
    program, h = method.compile(problem.system), method.h
    other = problem.y0 * 1.05
    used = program.start(problem.y0, problem.par, 3.0)
    used.advance([3.0 + 40.3 * h], sample="stop")
    used.take(60)
    for count in (1, 3, 60):
        new = program.start(problem.y0, problem.par, 0.0)
        for part in (0.3, 0.9):
            # Before, the contraction was the one learned last, and where the implicit solver was at work, it
            # stayed, with its old Jacobian: with it the last bits differed.
            found = [stepper.single(other, 1.0, 1.0 + part * h) for stepper in (used, new)]
            assert found[0].y.tobytes() == found[1].y.tobytes()
            found = [stepper.take(count) for stepper in (used, new)]
            assert found[0].y.tobytes() == found[1].y.tobytes()
