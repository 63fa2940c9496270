"""Amplitudes from 1e-300 to 1e300: the solution of a linear system scales, or a warning says why not."""

import numpy as np
import pytest

from integrators import HBVM, integrate, integrate_many
from problems import Hamiltonian, Problem, VectorField

END = 10.0
SYSTEMS = {
    "Hamiltonian": Hamiltonian(lambda q, p, m: (p[0] * p[0] + q[0] * q[0]) / 2, dof=1),
    "field": VectorField(lambda y: [y[1], -y[0]], dim=2),
}
SIZES = [1e-300, 1e-290, 1e-283, 1e-270, 1e-250, 1e-215, 1e-160, 1.0, 1e150, 1e200, 1e250, 1e300]


@pytest.mark.parametrize("method", [HBVM(), HBVM(k=8, s=6, tol=1e-12), HBVM(k=8, s=4, h=0.1)], ids=str)
@pytest.mark.parametrize("name", SYSTEMS)
def test_the_amplitude_of_an_oscillator_has_no_part_in_the_relative_error(name, method):
    for size in SIZES:
        problem = Problem(SYSTEMS[name], y0=[size, 0.0], t_end=END)
        one = integrate(problem, method, [END])
        many = integrate_many(problem, method, starts=[[size, 0.0]] * 2, times=[END])
        found = np.concatenate([one.y[-1:], many.y[:, -1]]) / size
        error = np.abs(found - [np.cos(END), -np.sin(END)]).max()
        assert not one.status.failed
        # Measured 3e-14. Below 1e-280: 30 times the amplitude, and no warning.
        assert error < 1e-12 or (one.warnings and all(many.warnings) and size < 1e-280)


def test_units_in_which_a_term_of_the_formula_underflows_are_told():
    # Before: off by 5.7 amplitudes, finished, no warning: q0 q1 is 0 below 1e-162.
    system = Hamiltonian(
        lambda q, p, par, m: (p[0] ** 2 + p[1] ** 2 + q[0] ** 2 + q[1] ** 2) / 2
        + par.a * (q[0] ** 2 * q[1] - q[1] ** 3 / 3),
        dof=2, parameters={"a": 1.0},
    )  # fmt: skip
    one = integrate(Problem(system, q0=[0.1, 0.2], p0=[0.3, 0.1], t_end=20.0), HBVM(), [20.0])
    for size in (1e-100, 1e-150, 1e-165, 1e-200, 1e100, 1e150):
        start = {"q0": [0.1 * size, 0.2 * size], "p0": [0.3 * size, 0.1 * size]}
        problem = Problem(system, **start, parameters={"a": 1.0 / size}, t_end=20.0)
        found = integrate(problem, HBVM(), [20.0])
        error = np.abs(found.y[-1] / size - one.y[-1]).max()
        told = any("beyond the range of doubles" in sentence for sentence in found.warnings)
        assert told == (size < 1e-160), size
        assert told or error < 1e-12, size  # measured 8e-15
        made = integrate_many(problem, HBVM(), starts=[problem.y0], times=[20.0])
        assert [("beyond" in " ".join(said)) for said in made.warnings] == [told]


def test_an_ensemble_tells_of_each_start_that_is_too_small():
    problem = Problem(VectorField(lambda y: [-y[0]], dim=1), y0=[1.0], t_end=1.0)
    made = integrate_many(problem, HBVM(), starts=[[1.0], [1e-300], [1e-270]], times=[1.0])
    assert [len(said) for said in made.warnings] == [0, 1, 0]  # before: none


def test_a_switching_surface_is_left_at_any_amplitude():
    # Before: not_finite beyond 1e155, where squares of the distances to the surface overflow.
    def contact(y, par, m):
        return [y[1], -y[0] - m.where(y[0] > par.gap, 30.0 * (y[0] - par.gap), 0.0)]

    system = VectorField(contact, dim=2, parameters={"gap": 0.0})
    ends = []
    for size in (1.0, 1e-200, 1e160, 1e200):
        problem = Problem(system, y0=[size, 0.0], t_end=END, parameters={"gap": 0.3 * size})
        ends.append(integrate(problem, HBVM(), [END]).y[-1] / size)
    assert np.abs(np.diff(ends, axis=0)).max() < 1e-11  # measured 2.4e-14
