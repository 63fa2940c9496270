"""The example package of a third party: built, installed into a directory of its own, and used."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "plugin"

CHECK = """
import integrators, problems
from integrators import registry, testing
from integrators.exercises import two_bodies

assert "duffing" in problems.names()
assert "Verlet" in registry.names()
problem = problems.load("duffing", energy=0.1)
method = registry.create("Verlet", h=0.01)
solution = integrators.integrate(problem, method)
print(solution.status, problem.errors(solution.y)["energy"].max())
testing.check_method(method, two_bodies())
try:
    problems.load("duffing", energi=0.1)
except problems.UnknownNameError as error:
    print(error)
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return an environment in which the example is installed, beside this one's packages."""
    source = tmp_path_factory.mktemp("source") / "plugin"
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
    return {**os.environ, "PYTHONPATH": str(target)}


def _python(arguments: list[str], environment: dict[str, str], **options) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, check=False, **options
    )


def test_a_third_partys_problem_and_method_are_found_run_and_checked(installed):
    done = _python(["-c", CHECK], installed)
    assert done.returncode == 0, done.stderr
    status, error, *rest = done.stdout.split(maxsplit=2)
    assert status == "finished"
    # Verlet with h = 0.01: measured 1.9e-4 relative.
    assert float(error) < 1e-3
    assert "did you mean 'energy'" in " ".join(rest)


def test_the_command_line_knows_a_third_partys_problem_and_method(installed, tmp_path):
    program = ["-m", "hbvm_bench.cli"]
    listed = _python([*program, "list", "problems"], installed)
    assert "duffing(energy=" in listed.stdout, listed.stderr
    found = _python([*program, "inspect", "duffing", "--json"], installed)
    answer = json.loads(found.stdout)
    assert answer["degree"] == 4
    assert answer["engines"]["Verlet"] is None
    run = ["run", "-p", "duffing(t_end=20.0)", "-m", "Verlet(h=0.01)", "-m", "HBVM(k=4, s=2, h=0.1)"]
    done = _python([*program, *run, "--no-timing", "--out", str(tmp_path / "run")], installed, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    shown = _python([*program, "show", str(tmp_path / "run"), "--json"], installed)
    cases = json.loads(shown.stdout)["cases"]
    assert {case["method"]: case["status"] for case in cases} == {
        "Verlet(h=0.01)": "finished",
        "HBVM(k=4, s=2, h=0.1)": "finished",
    }


def test_without_it_nothing_is_known_of_it():
    import problems
    from integrators import registry

    assert "duffing" not in problems.names()
    assert "Verlet" not in registry.names()
