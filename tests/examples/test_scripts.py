"""Each example script runs, and says what it says it shows."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "examples"

SAYS = {
    "bouncing_ball.py": ["by an event: each impact found: True to 1e-9: True", "us each"],
    "geodesics.py": ["from 3.30 to 20.47 ", "energy kept: True"],
    "lattice.py": ["energy kept: True"],
    "bodies.py": ["the same places to 1e-8 au: True", "names are kept: True"],
    "exponents.py": ["the interval holds 0.9056: True", "their sum is -41/3: True"],
    "ensemble.py": ["28% of 10000 orbits are chaotic"],
    "own_campaign.py": ["exit code: 0 report: True", "DOP853"],
    "mass_matrix.py": ["the same trajectory as SciPy's: True", "energy kept: True"],
    "measured_forcing.py": ["steps that end at a knot: 40 of 40"],
    "long_run.py": ["interrupted at t = ", "the same bits as without a break: True"],
    "section.py": ["3600 passages", "each on the surface: True", "each at the energy: True"],
    "solution.py": ["the same from a file: True True", "the same from another process: True"],
}


def test_every_script_has_its_words():
    names = {path.name for path in SCRIPTS.glob("*.py")} - {"side_by_side.py"}  # which others import
    assert names == set(SAYS)


# Its reference is computed by two methods, half a minute of compiling (that of the tutorial is stored);
# bodies.py compiles for 14 s, and exponents.py lets SciPy compute for 10.
SLOW = {"own_campaign.py", "bodies.py", "exponents.py"}


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
