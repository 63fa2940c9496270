"""What cannot be done is refused with the reason, or ends with a status and what was computed before."""

import numpy as np
import pytest

import integrators
import problems
from integrators import LineIntegral
from integrators.protocol import Status
from problems import Hamiltonian, InputError, Problem, VectorField

NAMES = ["energy"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"k": 4, "s": 4, "h": 0.1}, "needs k > s, not k=4, s=4: .* correction is identically 0; raise k"),
        ({"k": 3, "s": 4, "h": 0.1}, "needs k > s"),
        ({"k": 8, "s": 4}, "needs a step h, or a tolerance"),
        ({"k": 8, "s": 4, "h": -0.1}, "h=-0.1 of LineIntegral must be a finite step above 0"),
        ({"k": 8, "s": 0, "h": 0.1}, "s=0 of LineIntegral must be a whole number of at least 1"),
        ({"k": 8, "s": 4, "tol": 1e-17}, "tol=1e-17 .* from 2.2e-16 to below 1: .* rounding"),
        ({"k": 8, "s": 4, "tol": float("nan")}, "tol=nan of"),
        ({"k": 8, "s": 4, "tol": "tight"}, "tol='tight' of"),
        ({"k": 8, "s": 4, "h": 0.1, "invariants": []}, "must be a list of names"),
        ({"k": 8, "s": 4, "h": 0.1, "invariants": "energy"}, "invariants='energy' .* list of names"),
        ({"k": 8, "s": 4, "h": 0.1, "invariants": [len]}, "list of names"),
        ({"k": 8, "s": 4, "h": 0.1, "invariants": ["energy", "energy"]}, "different names"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        LineIntegral(**({"invariants": NAMES} | options))


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("enery", "energy"),
        ("lenz[2]", "lenz"),
        ("lenz[-1]", "lenz"),
        ("angle", "angular_momentum, energy, lenz"),
    ],
)
def test_an_invariant_that_the_problem_does_not_have_is_refused_with_those_it_has(name, near):
    method = LineIntegral(k=8, s=4, h=0.1, invariants=[name])
    problem = problems.load("kepler")
    with pytest.raises(InputError, match=f"unknown invariant of kepler .*{near}"):
        method.compile(problem.system)
    assert near in method.accepts(problem)
    with pytest.raises(InputError, match="cannot integrate"):
        integrators.integrate(problem, method)


def test_the_energy_of_a_driven_system_is_no_invariant():
    system = Hamiltonian(lambda q, p, t, m: p[0] ** 2 / 2 - m.cos(q[0] - t), dof=1, name="driven")
    with pytest.raises(InputError, match="energy"):
        LineIntegral(k=8, s=4, h=0.1, invariants=NAMES).compile(system)


def test_an_invariant_that_depends_on_time_is_refused():
    system = VectorField(
        lambda y: [y[0]], dim=1, invariants={"start": lambda y, t, m: y[0] * m.exp(-t)}, name="growth"
    )
    with pytest.raises(InputError, match="'start' of growth depends on time; leave it out"):
        LineIntegral(k=8, s=4, h=0.1, invariants=["start"]).compile(system)


@pytest.mark.parametrize("options", [{"h": 0.05}, {"tol": 1e-8}], ids=str)
def test_a_quantity_that_is_no_invariant_stops_the_integration_with_the_defect(options):
    def H(q, p):
        return (p[0] ** 2 + p[1] ** 2) / 2 + (q[0] ** 2 + 1.001 * q[1] ** 2) / 2

    def angular_momentum(q, p):  # kept only by the isotropic oscillator
        return q[0] * p[1] - q[1] * p[0]

    system = Hamiltonian(H, dof=2, invariants={"angular_momentum": angular_momentum}, name="anisotropic")
    problem = Problem(system, q0=[1.0, 0.2], p0=[0.1, 1.0], t_end=10.0)
    method = LineIntegral(k=8, s=4, invariants=["energy", "angular_momentum"], **options)
    solution = integrators.integrate(problem, method)
    assert solution.status is Status.NOT_INVARIANT
    assert solution.status.failed
    assert "angular_momentum is not an invariant" in solution.reason
    assert "leave " in solution.reason
    assert solution.t_stop == 0.0
    assert np.array_equal(solution.y, [problem.y0])  # what was reached before


def test_a_casimir_that_is_one_for_other_parameters_only_is_noticed():
    problem = problems.load("lotka_volterra")
    par = problem.system.pack({"c": -0.4})
    method = LineIntegral(k=12, s=3, h=0.1, invariants=["casimir"])
    samples = method.compile(problem.system).start(problem.y0, par).advance([1.0])
    assert samples.status is Status.NOT_INVARIANT


def test_an_invariant_that_ceases_to_be_one_stops_the_integration_there():
    def f(t, y, m):  # a rotation; from t = 1 on with growth that begins smoothly
        late = (t - 1 + m.abs(t - 1)) / 2
        growth = late**4
        return [y[1] + growth * y[0], -y[0] + growth * y[1]]

    system = VectorField(f, dim=2, invariants={"size": lambda y: y[0] ** 2 + y[1] ** 2}, name="late")
    problem = Problem(system, y0=[1.0, 0.0], t_end=5.0)
    solution = integrators.integrate(
        problem, LineIntegral(k=8, s=4, h=0.1, invariants=["size"]), np.linspace(0, 5, 51)
    )
    assert solution.status is Status.NOT_INVARIANT
    assert 0.99 < solution.t_stop < 1.2
    assert solution.t[-1] == pytest.approx(solution.t_stop)
    assert solution.errors()["size"].max() <= 1e-15  # measured 2.2e-16


def test_a_step_that_is_too_long_is_a_status():
    problem = problems.load("kepler", e=0.6)
    method = LineIntegral(k=8, s=4, h=20.0, invariants=["energy", "angular_momentum"])
    solution = integrators.integrate(problem, method, [0.0, 20.0, 40.0])
    assert solution.status is Status.NONLINEAR_DIVERGENCE
    assert "take a smaller h" in solution.reason
    assert solution.t.tolist() == [0.0]


def test_a_collision_underflows_the_step():
    problem = Problem(problems.load("kepler").system, q0=[1.0, 0.0], p0=[0.0, 0.0], t_end=2.0)
    method = LineIntegral(k=8, s=4, tol=1e-8, invariants=["energy"])
    solution = integrators.integrate(problem, method, np.linspace(0, 2, 201))
    assert solution.status in (Status.STEP_UNDERFLOW, Status.NOT_FINITE)
    assert solution.t_stop == pytest.approx(np.pi / 2**1.5, abs=1e-3)  # the free fall ends there
    assert np.isfinite(solution.y).all()
    assert solution.t[-1] > 1.0


@pytest.mark.parametrize("options", [{"h": 0.1}, {"tol": 1e-8}], ids=str)
def test_nan_from_the_field_is_a_status(options):
    def f(y, m):  # the square root ends at y = 1
        return [-1.0 + 0 * m.sqrt(y[0] - 1.0), 0.0]

    system = VectorField(f, dim=2, invariants={"second": lambda y: y[1]}, name="ending")
    problem = Problem(system, y0=[2.05, 2.0], t_end=3.0)
    method = LineIntegral(k=4, s=2, invariants=["second"], **options)
    solution = integrators.integrate(problem, method, np.linspace(0, 3, 31))
    assert solution.status is Status.NOT_FINITE
    assert "not finite" in solution.reason
    assert 0.9 < solution.t_stop <= 1.06
    assert np.isfinite(solution.y).all()


def test_a_checkpoint_of_another_method_is_refused():
    problem = problems.load("kepler")
    one, other = (
        LineIntegral(k=8, s=4, h=0.1, invariants=names).compile(problem.system).start(problem.y0)
        for names in (["energy"], ["angular_momentum"])
    )
    with pytest.raises(InputError, match="another method or system"):
        other.restore(one.checkpoint())


def test_parameters_of_a_wrong_length_are_refused():
    problem = problems.load("rigid_body")
    program = LineIntegral(k=8, s=4, h=0.1, invariants=["energy"]).compile(problem.system)
    with pytest.raises(InputError, match="par must have shape"):
        program.start(problem.y0, np.ones(2))
