"""One step against the equations written out in NumPy, solved to the end without any shortcut."""

import numpy as np
import pytest

import problems
from integrators import HBVM, LineIntegral
from integrators.coefficients.legendre import tables
from integrators.kernel.plan import Plan
from integrators.kernel.program import HBVMProgram
from problems import targets


def step_by_the_equations(problem, k, s, h, names, metric):
    """The method as its docstring says it; r from the coefficients themselves."""
    system, par, y = problem.system, problem.par, problem.y0
    table = tables(k, s)
    integrals, projection = table.integrals.hi, table.projection.hi
    field = targets.numpy(system, "field")
    slopes = [targets.numpy(system, system.gradient(name)) for name in names]
    rho = np.zeros((s, y.size))
    for _ in range(200):
        stages = y + h * integrals @ rho
        gamma = projection @ np.array([field(0.0, Y, par) for Y in stages])
        phi = np.array([projection @ np.array([g(0.0, Y, par) for Y in stages]) for g in slopes])
        gram = np.einsum("ajd,d,bjd->ab", phi, metric, phi)
        alpha = np.linalg.solve(gram, np.einsum("ajd,jd->a", phi, gamma))
        rho = gamma - metric * np.einsum("ajd,a->jd", phi, alpha)
    return y + h * rho[0], np.abs(alpha).max()


CASES = [
    ("kepler", 7, 2, 0.1, ["energy", "angular_momentum"]),
    ("kepler", 12, 4, 0.2, ["lenz[1]", "angular_momentum", "energy"]),
    ("lotka_volterra", 8, 3, 0.2, ["energy", "casimir"]),
    ("sitnikov", 10, 2, 0.3, ["energy", "linear_momentum[2]", "angular_momentum[2]"]),
]


@pytest.mark.parametrize(("name", "k", "s", "h", "names"), CASES)
def test_a_step_solves_the_equations(name, k, s, h, names):
    problem = problems.load(name)
    metric = np.ones(problem.system.dim)
    if name == "sitnikov":
        masses = np.repeat(problem.par, 3)
        metric = np.concatenate([1 / masses, masses])
    expected, alpha = step_by_the_equations(problem, k, s, h, names, metric)
    stepper = (
        LineIntegral(k=k, s=s, h=h, invariants=names).compile(problem.system).start(problem.y0, problem.par)
    )
    stepper.step()
    scale = np.abs(expected).max()
    assert np.abs(stepper.y - expected).max() <= 5e-15 * scale  # measured 1.5e-16
    # The correction counts: without it the step is another one.
    plain = HBVM(k=k, s=s, h=h).compile(problem.system).start(problem.y0, problem.par)
    plain.step()
    assert np.abs(plain.y - expected).max() > 1e-12 * scale  # measured 8.6e-12 to 5.7e-6
    assert alpha > 0.0


def test_hbvm_on_a_poisson_system_solves_its_own_equations():
    problem = problems.load("lotka_volterra")
    system, par, y, h = problem.system, problem.par, problem.y0, 0.2
    table = tables(6, 2)
    slope, structure = targets.numpy(system, system.slope), targets.numpy(system, system.structure)
    rho = np.zeros((2, 3))
    for _ in range(200):
        stages = y + h * table.integrals.hi @ rho
        G = table.projection.hi @ np.array([slope(0.0, Y, par) for Y in stages])
        values = [
            structure(0.0, Y, par).reshape(3, 3) @ (row @ G)
            for Y, row in zip(stages, table.basis.hi, strict=True)
        ]
        rho = table.projection.hi @ np.array(values)
    stepper = HBVM(k=6, s=2, h=h).compile(system).start(y, par)
    stepper.step()
    assert np.abs(stepper.y - (y + h * rho[0])).max() <= 5e-15


def test_a_vector_invariant_stands_for_its_components():
    system = problems.load("kepler").system
    assert list(system.components("lenz")) == ["lenz[0]", "lenz[1]"]
    assert list(system.components("lenz[1]")) == ["lenz[1]"]
    assert list(system.components("energy")) == ["energy"]


def test_parameters_are_run_time_values():
    problem = problems.load("rigid_body", quartic=0.5, t_end=10.0)
    program = HBVMProgram(problem.system, Plan(k=8, s=2, h=0.1, keep=["energy", "casimir"]))
    ends = []
    for quartic in (0.5, 0.0):
        other = problems.load("rigid_body", quartic=quartic, t_end=10.0)
        samples = program.start(other.y0, other.par).advance(np.linspace(0, 10, 11))
        assert other.errors(samples.y)["energy"].max() <= 1e-15  # measured 1.9e-16
        ends.append(samples.y[-1])
    assert np.abs(ends[0] - ends[1]).max() > 0.01
