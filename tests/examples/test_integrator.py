"""The example package of a third party: built, installed into a directory of its own, and used."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from integrators import Status, integrate, testing
from integrators.testing.capabilities import CHECK_OF

EXAMPLE = Path(__file__).parents[2] / "examples" / "integrator"

STEPS = [0.5, 0.4, 0.32, 0.25]

CHECK = """
import integrators, problems
from integrators import registry

assert "duffing" in problems.names()
assert "Yoshida6" in registry.names()
assert integrators.Yoshida6 is registry.get("Yoshida6")
problem = problems.load("duffing", energy=0.1)
solution = integrators.integrate(problem, registry.create("Yoshida6", h=0.1))
print(solution.status, problem.errors(solution.y)["energy"].max())
try:
    problems.load("duffing", energi=0.1)
except problems.UnknownNameError as error:
    print(error)
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return an environment in which the example is installed, beside this one's packages."""
    source = tmp_path_factory.mktemp("source") / "integrator"
    shutil.copytree(EXAMPLE, source, ignore=shutil.ignore_patterns("__pycache__"))
    target = tmp_path_factory.mktemp("target")
    build = "import hatchling.build as b; print(b.build_wheel('dist'))"
    (source / "dist").mkdir()
    done = subprocess.run(
        [sys.executable, "-c", build], cwd=source, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(next((source / "dist").glob("*.whl"))) as wheel:
        wheel.extractall(target)
    path = os.pathsep.join(filter(None, [str(target), os.environ.get("PYTHONPATH")]))
    return {**os.environ, "PYTHONPATH": path}


def _python(arguments: list[str], environment: dict[str, str], **options) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, check=False, **options
    )


def test_a_third_partys_problem_and_integrator_are_found_and_run(installed):
    done = _python(["-c", CHECK], installed)
    assert done.returncode == 0, done.stderr
    status, error, *rest = done.stdout.split(maxsplit=2)
    assert status == "finished"
    assert float(error) < 1e-4  # measured 2.9e-6
    assert "did you mean 'energy'" in " ".join(rest)


@pytest.mark.slow
def test_the_command_line_knows_a_third_partys_problem_and_integrator(installed, tmp_path):
    program = ["-m", "hbvm_bench.cli"]
    listed = _python([*program, "list", "problems"], installed)
    assert "duffing(energy=" in listed.stdout, listed.stderr
    found = _python([*program, "inspect", "duffing", "--json"], installed)
    answer = json.loads(found.stdout)
    assert answer["degree"] == 4
    assert answer["engines"]["Yoshida6"] is None
    run = ["run", "-p", "duffing(t_end=20.0)", "-m", "Yoshida6(h=0.1)", "-m", "HBVM(k=4, s=2, h=0.1)"]
    done = _python([*program, *run, "--no-timing", "--out", str(tmp_path / "run")], installed, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    shown = _python([*program, "show", str(tmp_path / "run"), "--json"], installed)
    cases = json.loads(shown.stdout)["cases"]
    assert {case["method"]: case["status"] for case in cases} == {
        "Yoshida6(h=0.1)": "finished",
        "HBVM(k=4, s=2, h=0.1)": "finished",
    }


def test_without_it_nothing_is_known_of_it():
    import problems
    from integrators import registry

    assert "duffing" not in problems.names()
    assert "Yoshida6" not in registry.names()


@pytest.fixture
def yoshida(monkeypatch):
    """The example's integrator, imported from its folder."""
    monkeypatch.syspath_prepend(str(EXAMPLE))
    from hbvm_bench_duffing.yoshida import Yoshida6

    return Yoshida6


@pytest.mark.parametrize("problem", [testing.pendulum, testing.two_bodies], ids=lambda make: make.__name__)
def test_it_conforms(yoshida, problem):
    reasons = testing.check_method(yoshida(h=0.05), problem())
    said = {name for name, reason in reasons.items() if reason is not None}
    unregistered = {"is_a_value", "refuses_unknown_options"}
    # The rest are capabilities that it does not offer; an error in the user's field needs another system.
    optional = {testing.name_of(check) for check in CHECK_OF.values()}
    offered = {
        name for name in optional if "samplings" in name or "destination" in name or "checkpoint" in name
    }
    assert unregistered <= said <= unregistered | optional - offered


def test_its_order_is_six_on_a_nonlinear_problem(yoshida):
    problem = testing.pendulum()
    order = testing.measured_order(lambda h: yoshida(h=h), problem, STEPS)
    assert abs(order - 6.0) < 0.2  # measured 5.92


def test_a_driven_force_is_evaluated_at_its_own_times(yoshida):
    import problems

    def H(q, p, t, m):
        return p[0] * p[0] / 2 - m.cos(q[0]) - q[0] * m.sin(t)

    driven = problems.Problem(problems.Hamiltonian(H, dof=1), q0=[0.0], p0=[0.5], t_end=8.0)
    order = testing.measured_order(lambda h: yoshida(h=h), driven, STEPS)
    assert abs(order - 6.0) < 0.3  # measured 5.81


def test_counters_samples_and_checkpoints_come_from_the_base(yoshida):
    problem = testing.pendulum()
    program = yoshida(h=0.25).compile(problem.system)
    stepper = program.start(problem.y0)
    samples = stepper.advance(np.array([1.0, 1.1, 2.0]))
    assert (stepper.stats.steps, stepper.stats.evaluations) == (8, 56)  # none for the sample aside
    checkpoint = stepper.checkpoint()
    landed = program.start(problem.y0).advance(np.array([1.0, 1.1]), sample="stop")
    assert np.array_equal(landed.y, samples.y[:2])
    own = program.start(problem.y0).advance(np.array([2.1]), sample="steps")
    assert np.array_equal(own.t, 0.25 * np.arange(1, 9))
    assert np.array_equal(own.y[[3, 7]], samples.y[[0, 2]])
    back = stepper.advance(np.array([0.0])).y[0]
    assert np.abs(back - problem.y0).max() < 1e-14  # measured 7e-16: symmetric
    stepper.restore(checkpoint)
    assert stepper.t == 2.0
    assert np.array_equal(stepper.y, samples.y[2])


def test_what_is_not_finite_is_a_status_with_time_and_reason(yoshida):
    solution = integrate(testing.blow_up(), yoshida(h=0.25))
    assert solution.status is Status.NOT_FINITE
    assert "not finite at t = " in solution.reason
    assert 0.0 < solution.t_stop <= 2.0
    assert np.isfinite(solution.y).all()


def test_a_problem_that_is_not_separable_and_a_bad_step_are_refused_in_a_sentence(yoshida):
    import problems

    rotor = problems.Problem(
        problems.Hamiltonian(lambda q, p: p[0] ** 2 * (1 + q[0] ** 2), dof=1), q0=[1.0], p0=[0.0], t_end=1.0
    )
    with pytest.raises(problems.InputError, match=r"cannot integrate .*it needs H = sum of"):
        integrate(rotor, yoshida(h=0.1))
    with pytest.raises(problems.InputError, match="h=-1 of Yoshida6 must be a finite step above 0"):
        yoshida(h=-1)
