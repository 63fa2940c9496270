"""Each example script runs, and says what it says it shows."""

import ast
import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from scipy.integrate import solve_ivp

from integrators import HBVM, integrate

SCRIPTS = Path(__file__).parents[2] / "examples"

SAYS = {
    "bouncing_ball.py": ["by an event: each impact found: True to 1e-9: True", "us each"],
    "own_system.py": ["accurate: HBVM, heyoka, SciPy's DOP853"],
    "long_runs.py": ["accurate: HBVM, Gauss, REBOUND's IAS15"],
    "campaign.py": ["accurate: hbvm-bench run"],
    "encounters.py": ["accurate: HBVM, heyoka, REBOUND's IAS15"],
    "stiff.py": ["accurate: HBVM, SciPy's Radau, SciPy's LSODA, SUNDIALS' CVODE"],
    "star_cluster.py": ["accurate: HBVM, Gauss, REBOUND's IAS15"],
    "plugin.py": ["accurate: HBVM, SciPy's DOP853"],
    "fit.py": ["accurate: HBVM, variations, diffrax's Dopri8, jacfwd"],
    "radial_velocities.py": ["accurate: HBVM, states, diffrax's Dopri8, reverse"],
    "impacts.py": ["104 impacts", "accurate: HBVM, Event(then=...), heyoka, callbacks"],
    "short.py": ["accurate: HBVM, heyoka, SciPy's DOP853"],
    "molecular_dynamics.py": ["accurate: HBVM, Verlet in numba"],
    "geodesics.py": ["from 3.30 to 20.47 ", "energy kept: True"],
    "linkages.py": ["energy and rods at round-off: True"],
    "lattice.py": ["accurate: HBVM, Gauss, heyoka, REBOUND's leapfrog, SciPy's DOP853"],
    "bodies.py": ["the same places to 1e-8 au: True", "names are kept: True"],
    "chaos_map.py": ["regular and chaotic alike: True", "the difference of two orbits: True", "12 x 12 in "],
    "exponents.py": ["accurate: integrators.lyapunov, heyoka"],
    "ensemble.py": ["28% of 10000 orbits are chaotic"],
    "grids.py": ["brusselator(6), 72 unknowns\n  HBVM(1e-6): ", "kuramoto(100), 100 unknowns"],
    "own_campaign.py": ["exit code: 0 report: True", "DOP853"],
    "mass_matrix.py": ["the same trajectory as SciPy's: True", "energy kept: True"],
    "measured_forcing.py": ["steps that end at a knot: 40 of 40"],
    "long_run.py": ["interrupted at t = ", "the same bits as without a break: True"],
    "scaling.py": ["| threads | time (s) | speed-up | efficiency |", "\n| 1 | ", " | 1.00 | 100% |"],
    "section.py": ["3793 passages", "accurate: HBVM, heyoka"],
    "rattle.py": ["HBVM() is nearest to the problem in angles: True"],
    "squeezer.py": ["energy and loops at round-off: True", "the published solution to nine digits: True"],
    "water.py": ["HBVM() keeps energy and bonds at round-off: True"],
    "solution.py": ["the same from a file: True True", "the same from another process: True"],
}


MINUTES = "molecular_dynamics_sizes.py"
NO_EXAMPLES = {"side_by_side.py", "heyoka_bodies.py", "run_all.py"}  # others import them, or it runs others


def test_every_script_has_its_words_and_a_field():
    names = {path.name for path in SCRIPTS.glob("*.py")} - NO_EXAMPLES
    assert names == {*SAYS, MINUTES}
    made = ast.parse((SCRIPTS.parent / "docs" / "_ext" / "made.py").read_text(encoding="utf-8"))
    fields = next(
        ast.literal_eval(node.value)
        for node in made.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "FIELDS"
    )
    assert sorted(f"{name}.py" for listed in fields.values() for name in listed) == sorted(names)


def test_the_sizes_of_molecular_dynamics_are_measured(monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    import molecular_dynamics_sizes

    monkeypatch.setattr(molecular_dynamics_sizes, "RUNS", 1)
    atoms, *times = molecular_dynamics_sizes.row(2)
    assert (atoms, len(times)) == (32, 3)
    assert min(times) > 0.0


@pytest.mark.parametrize(
    ("name", "n", "times"),  # between which the right-hand side is smooth
    [
        ("brusselator", 4, [0.0, 1.1, 1.2]),
        ("medical_akzo_nobel", 8, [0.0, 5.0, 6.0]),
        ("fitzhugh_nagumo", 4, [0.0, 2.0]),
        ("kuramoto", 12, [0.0, 2.0]),
    ],
)
def test_grids_and_networks_are_integrated_like_scipy_integrates_them(name, n, times, monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    import grids

    problem, by_hand = getattr(grids, name)(n)
    found = integrate(problem, HBVM(), times[-1:]).y[-1]
    y = problem.y0
    for start, end in pairwise(times):

        def inside(t, y, ends=(start + 1e-9, end - 1e-9)):
            return by_hand(min(max(t, ends[0]), ends[1]), y)

        y = solve_ivp(inside, (start, end), y, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    assert found == pytest.approx(y, abs=1e-12 * abs(y).max())  # measured 9.9e-15


def test_the_page_of_tasks_is_what_is_stored(monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    import run_all

    tasks = json.loads(run_all.STORED.read_text(encoding="utf-8"))["tasks"]
    assert set(tasks) == set(run_all.TASKS)
    for name, task in tasks.items():  # as many settings of every method
        assert len({row["tried"] for row in task["rows"]}) == 1, name
    assert run_all.page() == run_all.PAGE.read_text(encoding="utf-8")


def test_the_page_of_tasks_says_when_with_what_kernel_and_beside_what_load(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    import run_all

    stored = json.loads(run_all.STORED.read_text(encoding="utf-8"))
    monkeypatch.setattr(run_all, "STORED", tmp_path / "measured.json")
    more = {"day": "2026-11-25", "kernel": "0123456789abcdef", "loads": {"short": [0.01, 0.0]}}
    run_all.STORED.write_text(json.dumps(stored | more), encoding="utf-8")
    assert (
        "\n\nMeasured on 2026-11-25 with the kernel 0123456789ab. While times were taken, other processes "
        "used 1% of a core, and the steal time was 0% of one.\n"
    ) in run_all.page()


# What takes longest: two references, XLA, many processes, a search for settings of each library.
SLOW = {"own_campaign.py", "campaign.py", "bodies.py", "fit.py", "radial_velocities.py", "long_runs.py"}
SLOW |= {"scaling.py", "section.py", "lattice.py", "linkages.py", "star_cluster.py", "encounters.py"}
SLOW |= {"chaos_map.py", "ensemble.py"}
SLOW |= {
    "water.py",
    "rattle.py",
    "squeezer.py",
    "molecular_dynamics.py",
    "exponents.py",
    "plugin.py",
    "stiff.py",
    "own_system.py",
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in SAYS]
)
def test_a_script_runs(name, tmp_path):
    path = os.pathsep.join(filter(None, [str(SCRIPTS.parent), os.environ.get("PYTHONPATH")]))
    done = subprocess.run(
        [sys.executable, "-W", "error", str(SCRIPTS / name)],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": path},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    for words in SAYS[name]:
        assert words in done.stdout
