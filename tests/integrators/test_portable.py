"""`problems` and `integrators` run where Python has nothing that only Linux or only Unix has."""

import subprocess
import sys

from tests.elsewhere import elsewhere

RUN = """
import os
import numpy as np
from pathlib import Path
import problems, integrators

assert not hasattr(os, "fork")
from problems.targets.cache import locked
from integrators import HBVM, Gauss, integrate

def energy(q, p, m):
    return p[0] ** 2 / 2 - m.cos(q[0])

pendulum = problems.Problem(problems.Hamiltonian(energy, dof=1), q0=[0.0], p0=[1.0], t_end=10.0)
times = np.linspace(0.0, 10.0, 5)
for method in (HBVM(), Gauss(s=2, h=0.1)):
    solution = integrate(pendulum, method, times=times, checkpoint="own.checkpoint", every_seconds=0.001)
    assert solution.status.value == "finished", solution
    assert solution.errors()["energy"].max() < 1e-6
solution.save("own.npz")
assert (integrators.load("own.npz").y == solution.y).all()
with locked(Path("own.lock")):  # as whoever compiles does
    integrators.integrate_many(pendulum, Gauss(s=2, h=0.1), starts=np.tile([0.0, 1.0], (8, 1)))
print(problems.load("kepler"), len(problems.names()))
"""


def test_they_run_without_what_only_unix_has(tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", RUN],
        cwd=tmp_path, env=elsewhere(tmp_path), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("kepler(e=0.6) ")
