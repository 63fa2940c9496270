"""Processes that end with their parent, and with what they have started.

Linux ends a process with its parent, and Unix ends the group of a process at once. Elsewhere a thread looks
for the parent, and the descendants are ended one by one; those of a process that has ended itself go on.
"""

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil

try:
    import resource
except ImportError:  # Windows: a worker gone wild may fill the disk
    resource = None

KILLED = -9  # the exit code of a process that was killed
LARGEST_FILE = 2**32  # bytes: a worker gone wild does not fill the disk
LOOK = 1.0  # seconds between two looks for the parent
SET_PDEATHSIG = 1

APART: dict[str, Any] = (
    {"start_new_session": True}
    if hasattr(os, "setsid")
    else {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
)
"""How ``subprocess`` starts a process that a Ctrl-C at the terminal does not reach: the runner only."""


def kill(pid: int) -> None:
    """Kill a process that was started `APART`, and what it has started."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(pid, signal.SIGKILL)
        return
    with contextlib.suppress(psutil.NoSuchProcess):
        process = psutil.Process(pid)
        for member in (*process.children(recursive=True), process):
            with contextlib.suppress(psutil.Error):
                member.kill()


def limit_and_die_with(parent: int) -> None:
    """Leave no core and no huge file behind, end first where memory is short, and with this parent."""
    if resource is not None:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))
    with contextlib.suppress(OSError):  # Linux, short of memory, ends this process and not the runner
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    if (prctl := _prctl()) is not None:
        prctl(SET_PDEATHSIG, signal.SIGKILL)
    else:
        threading.Thread(target=_end_after, args=(parent,), daemon=True).start()
    if os.getppid() != parent:  # it died while this process was starting
        sys.exit(1)


def _prctl() -> Callable[[int, int], object] | None:
    try:
        return ctypes.CDLL(None).prctl
    except (AttributeError, TypeError):  # macOS; Windows
        return None


def _end_after(parent: int) -> None:
    with contextlib.suppress(psutil.NoSuchProcess):
        process = psutil.Process(parent)
        while os.getppid() == parent and process.is_running():
            time.sleep(LOOK)
    os._exit(1)
