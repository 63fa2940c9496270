"""How long it takes until a field runs: tracing, emitting, compiling, at any size."""

import time

import numpy as np
import pytest

import problems
from problems import emit


def _seconds(action):
    # Processor time of this process: other processes on the machine do not count.
    started = time.process_time()
    result = action()
    return time.process_time() - started, result


def test_ten_bodies_are_traced_and_emitted_in_50_ms():
    def make(seed):
        problem = problems.load("cluster", n=10, seed=seed)
        for backend in ("numba", "numpy"):
            emit.source(problem.system, "field", backend)
        return problem

    make(0)
    # Measured 5 ms.
    assert min(_seconds(lambda seed=seed: make(seed))[0] for seed in range(1, 4)) <= 0.05


@pytest.mark.parametrize(
    ("name", "arguments", "lines"),
    [
        ("cluster", {"n": 10}, 150),  # measured 0.3 s
        ("cluster", {"n": 200}, 60),  # measured 0.2 s
        ("sine_gordon", {"n": 1000}, 40),  # measured 0.1 s
        ("fput", {"n": 1000}, 40),  # measured 0.1 s
        ("toda", {"n": 1000}, 40),  # measured 0.1 s
    ],
)
def test_large_fields_are_loops_and_compile_in_two_seconds(name, arguments, lines):
    import numba

    problem = problems.load(name, **arguments)
    made = emit.source(problem.system, "field", "numba")
    assert made.text.count("\n") <= lines, "loops, not a line for each term"
    namespace = {"np": np, **{f: getattr(np, f) for f in ("sqrt", "sin", "cos", "exp", "log")}}
    exec(made.text, namespace)  # noqa: S102 -- emitted from a graph
    vector = numba.types.Array(numba.types.float64, 1, "C")
    kinds = (numba.types.float64, vector, vector, vector)
    numba.njit(kinds)(lambda t, y, par, out: None)  # numba's own first steps
    seconds, field = _seconds(lambda: numba.njit(kinds, error_model="numpy")(namespace[made.name]))
    assert seconds <= 2.0
    out = np.empty(problem.system.dim)
    field(0.0, problem.y0.copy(), problem.par.copy(), out)
    expected = emit.numpy(problem.system, "field")(0.0, problem.y0, problem.par)
    size = np.abs(expected).max()
    assert np.abs(out - expected).max() <= 4e-16 * size  # measured 0 but for the exponentials of toda
