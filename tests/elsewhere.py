"""A Python that has nothing that only Linux or only Unix has: what tests hide from their child processes."""

import os
from pathlib import Path

HIDE = """
import importlib.abc, builtins, io, os, sys

MODULES = ("fcntl", "resource", "termios", "pwd", "grp")
NAMES = (
    "sched_setaffinity", "sched_getaffinity", "fork", "register_at_fork", "pidfd_open", "getuid", "getpgid",
    "getsid", "killpg", "setsid", "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "sysconf", "fchmod", "nice",
    "getloadavg",
)

import ctypes, signal, numpy, numba, psutil, scipy.linalg, scipy.interpolate  # as they are for that system
for name in MODULES:
    sys.modules.pop(name, None)
    sys.modules[name] = None  # its import fails
for name in NAMES:
    if hasattr(os, name):
        delattr(os, name)
for name in ("setitimer", "alarm", "SIGALRM", "pthread_kill", "pthread_sigmask", "pidfd_send_signal"):
    if hasattr(signal, name):
        delattr(signal, name)
del psutil.Process.cpu_affinity
kept_open, kept_library = open, ctypes.CDLL
def opened(file, *arguments, **options):
    by_psutil = sys._getframe(1).f_globals.get("__name__", "").startswith("psutil")
    if str(file).startswith(("/proc/", "/sys/")) and not by_psutil:
        raise FileNotFoundError(file)
    return kept_open(file, *arguments, **options)
builtins.open = io.open = opened
class Library(kept_library):
    def __init__(self, name, *arguments, **options):
        if name is None:
            raise TypeError("there is no library without a name")
        super().__init__(name, *arguments, **options)
ctypes.CDLL = Library
"""


def elsewhere(folder: Path) -> dict[str, str]:
    """Return an environment in which Python, and what it starts, lacks all that; ``folder`` has the code."""
    (folder / "sitecustomize.py").write_text(HIDE)
    more = os.environ.get("PYTHONPATH", "")
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *filter(None, [more])])}
