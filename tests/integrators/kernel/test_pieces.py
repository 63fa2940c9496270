"""Pieces equal the whole, and so does what follows a checkpoint, bit for bit, whatever the solver."""

import numba
import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, LineIntegral
from integrators.protocol import Status
from problems import Opaque, Problem

OPTIONS = {"stiff_chain": {"omega": 1e3}}


def robertson(t, y, dy):
    dy[0] = -0.04 * y[0] + 1e4 * y[1] * y[2]
    dy[2] = 3e7 * y[1] ** 2
    dy[1] = -dy[0] - dy[2]


ROBERTSON = Problem(Opaque(numba.njit(robertson), dim=3), y0=[1.0, 0.0, 0.0], t_end=100.0, name="robertson")
CASES = [
    ("stiff_chain", HBVM(k=8, s=4, h=0.02, solver="newton")),
    ("stiff_chain", HBVM(k=8, s=4, h=0.02)),  # Newton takes over on the way
    ("henon_heiles", Gauss(s=3, h=0.3, solver="blended")),
    ("henon_heiles", HBVM(tol=1e-10)),
    ("henon_heiles", HBVM(k=8, s=4, tol=1e-8)),
    ("fput", HBVM(k=16, s=14, tol=1e-12)),
    ("fput", HBVM(k=20, s=14, tol=1e-12)),
    ("robertson", HBVM(k=6, s=3, tol=1e-4)),  # Newton takes over, with a Jacobian by differences
    ("robertson", HBVM(k=6, s=3, tol=1e-4, solver="newton")),
    ("henon_heiles", LineIntegral(k=8, s=4, h=0.3, invariants=["energy"])),
    ("henon_heiles", LineIntegral(k=8, s=4, tol=1e-9, invariants=["energy"])),
]
TIMES = np.array([0.31, 0.9, 2.5, 2.6, 7.3])


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("name", "method"), CASES, ids=repr)
def test_pieces_checkpoints_and_the_whole_are_the_same(name, method, sign):
    problem = ROBERTSON if name == "robertson" else problems.load(name, **OPTIONS.get(name, {}))
    program = method.compile(problem.system)
    times = sign * TIMES

    def started():
        stepper = program.start(problem.y0, problem.par)
        stepper.destination = times[-1]  # no step passes it; the longest is a part of the interval
        return stepper

    whole = started().advance(times)
    assert whole.status is Status.FINISHED
    stepper = started()
    pieces = [stepper.advance(times[:2]).y]
    kept = stepper.checkpoint()
    pieces += [stepper.advance(times[2:4]).y, stepper.advance(times[4:]).y]
    assert np.array_equal(np.concatenate(pieces), whole.y)
    stepper.restore(kept)
    assert np.array_equal(stepper.advance(times[2:]).y, whole.y[2:])
    other = started()
    other.restore(kept)
    assert np.array_equal(other.advance(times[2:]).y, whole.y[2:])
