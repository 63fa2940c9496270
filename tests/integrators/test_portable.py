"""`problems` and `integrators` run where Python has nothing that only Linux or only Unix has."""

import subprocess
import sys

ELSEWHERE = """
import os, sys, importlib.abc

MODULES = ("fcntl", "resource", "termios", "pwd", "grp")
NAMES = (
    "sched_setaffinity", "sched_getaffinity", "fork", "register_at_fork", "pidfd_open", "getuid", "getpgid",
    "killpg", "setsid", "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "sysconf", "fchmod", "nice", "getloadavg",
)

class Missing(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

import signal, numpy, numba, scipy.linalg, scipy.interpolate  # as their own packages for that system are
for name in MODULES:
    sys.modules.pop(name, None)
sys.meta_path.insert(0, Missing())
for name in NAMES:
    if hasattr(os, name):
        delattr(os, name)
for name in ("setitimer", "alarm", "SIGALRM", "SIGKILL", "pthread_kill", "pthread_sigmask"):
    if hasattr(signal, name):
        delattr(signal, name)
kept_open = open
def opened(file, *arguments, **options):
    assert not str(file).startswith("/proc/"), file
    return kept_open(file, *arguments, **options)
import builtins, io
builtins.open = io.open = opened

import numpy as np
from pathlib import Path
import problems, integrators
from problems.emit.cache import locked
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
print(problems.load("kepler"), len(problems.names()), *sorted(set(MODULES) & set(sys.modules)))
"""


def test_they_run_without_what_only_unix_has(tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", ELSEWHERE],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("kepler(e=0.6) ")
    assert len(done.stdout.split()) == 2  # and none of the modules was found after all
