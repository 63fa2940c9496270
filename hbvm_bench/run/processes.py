"""A child process that measures: told by Ctrl-C through its parent, and never left behind."""

import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from hbvm_bench.measure import machine
from hbvm_bench.run.worker import ENVIRONMENT

STDERR = 2  # the file descriptor


def wait(command: Sequence[str], environment: Mapping[str, str] = MappingProxyType({})) -> int:
    """Run a command with one thread for every library, and return its exit code.

    ``environment`` is added to the one it inherits. What it prints goes to our standard error. On
    Ctrl-C, or whatever else ends the waiting, it is killed first.
    """
    child = subprocess.Popen(
        list(command),
        stdin=subprocess.DEVNULL,
        stdout=STDERR,
        env={**os.environ, **ENVIRONMENT, **environment},
    )
    try:
        return child.wait()
    finally:
        child.kill()
        child.wait()


def settle() -> None:
    """Make this process a child that measures: deaf to Ctrl-C, gone with its parent, on one core."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)
    cores = machine.cores()
    if len(cores) > 1:
        os.sched_setaffinity(0, {cores[-1]})
