"""Each way through the kernel once, on any processor: the marked subset that other machines run.

The expected ends were made on x86-64 with AVX2. Processors may differ in the last bits, since their
mathematical functions do.
"""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, LineIntegral, integrate, integrate_many
from integrators.events import Event

pytestmark = pytest.mark.portable

CLOSE = 1e-11  # of the largest component; 0 on x86-64 with AVX2 and on aarch64 (emulated, 2026-11-23)


def chain(t, y, par, m):
    return [-50.0 * (y[0] - m.cos(t)), y[0] - 1000.0 * y[1]]


def stiff():
    return problems.Problem(problems.VectorField(chain, dim=2), y0=[0.0, 1.0], t_end=1.0)


def events():
    crossings = integrate(
        problems.load("kepler", t_end=20.0), HBVM(), events=[Event(lambda q: q[1], name="axis")]
    ).events["axis"]
    return np.concatenate([crossings.t[-1:], crossings.y[-1]])


def lanes(method):
    starts = np.tile([0.1, 0.0, 0.0, 0.3], (16, 1)) * np.linspace(0.5, 1.0, 16)[:, None]
    found = integrate_many(problems.load("henon_heiles"), method, starts=starts, times=[0.0, 20.0])
    return np.concatenate([found.y[0, -1], found.y[-1, -1]])


def end(problem, method):
    solution = integrate(problem, method)
    assert solution.status.value == "finished", solution
    return solution.y[-1]


WAYS = {
    "fixed": lambda: end(problems.load("kepler", t_end=10.0), Gauss(s=8, h=0.1)),
    "first-order": lambda: end(problems.load("lotka_volterra", t_end=10.0), HBVM(k=8, s=4, h=0.1)),
    "adaptive": lambda: end(problems.load("kepler", e=0.9, t_end=20.0), HBVM()),
    "gauss": lambda: end(problems.load("henon_heiles", t_end=50.0), Gauss(s=6, tol=1e-12)),
    "line": lambda: end(
        problems.load("kepler", t_end=10.0), LineIntegral(k=8, s=4, h=0.1, invariants=["energy"])
    ),
    "stiff": lambda: end(stiff(), HBVM(k=8, s=4, h=0.25)),
    "events": events,
    "lanes": lambda: lanes(Gauss(s=8, h=0.1)),
    "lanes-adaptive": lambda: lanes(HBVM()),
}


ENDS = {
    "fixed": [-1.5350235919098154, -0.2836684064997788, 0.22715073207749636, -0.47918775820321974],
    "first-order": [2.714745096397442, 0.034542926742594356, 3.7316968515691604],
    "adaptive": [-1.2952662509875974, 0.40039389637922723, -0.6775390924707383, -0.12708381542787453],
    "gauss": [0.5032543830657474, -0.44756800380572664, 0.05092767681443036, 0.20516787181860027],
    "line": [-1.5350235769390137, -0.2836684972049745, 0.2271507563575474, -0.47918774518514645],
    "stiff": [0.5569049224123386, 0.5279031136492058],
    "events": [18.849555921538776, 0.39999999999999997, 3.964768338342231e-15, -1.256645568734389e-14, 2.0],
    "lanes": [
        0.011538931042976208,
        0.12285162477206987,
        -0.06292596176996296,
        0.08377370672959908,
        0.10780963595282739,
        0.07190346101248968,
        -0.1964405954917308,
        0.20783272974342185,
    ],
    "lanes-adaptive": [
        0.011538931042976208,
        0.12285162477206982,
        -0.06292596176996298,
        0.0837737067295992,
        0.10780963595282744,
        0.07190346101248965,
        -0.19644059549173057,
        0.20783272974342173,
    ],
}


@pytest.mark.parametrize("way", WAYS)
def test_every_processor_reaches_the_same_end(way):
    end = WAYS[way]()
    assert np.abs(end - ENDS[way]).max() < CLOSE * np.abs(end).max()
