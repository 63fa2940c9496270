"""A child process under hard limits of wall time and memory.

Address-space limits are too blunt for libraries that compile at run time, so
the resident memory of the child, and of what it starts, is watched from outside;
all are killed when they pass the limit together, whatever they are doing.
"""

import contextlib
import os
import select
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from hbvm_bench.campaign.file import Limits
from hbvm_bench.measure import memory
from hbvm_bench.run import ending, warm
from hbvm_bench.run.warm import Fork

Cause = Literal["exit", "compiling", "timeout", "memory", "stopped"]
POLL = 0.02  # seconds, at first
LONGEST_POLL = 0.2  # of a case that takes long: the runner needs little of the machine
WALK = 1.0  # seconds between walks over all processes: they take milliseconds that a timing must not lose
KEPT_OUTPUT = 64  # chunks of at most 4 KiB


@dataclass(frozen=True)
class Ended:
    """How a child process ended.

    Attributes
    ----------
    code : int
        Its exit code; negative for a signal.
    cause : {"exit", "compiling", "timeout", "memory", "stopped"}
        Whether it ended itself, or what it was killed for.
    seconds : float
        Wall time from start to end.
    peak_gib : float
        Largest memory, with that of the processes it started.
    output : str
        The end of what it printed.
    """

    code: int
    cause: Cause
    seconds: float
    peak_gib: float
    output: str

    @property
    def words(self) -> str:
        """Say how it ended, as part of a sentence."""
        if self.code >= 0:
            return f"ended with exit code {self.code}"
        known = {signal_.value: signal_.name for signal_ in signal.Signals}
        return f"ended by signal {known.get(-self.code, -self.code)}"


class Subprocess:
    """A new process that runs a command, with additions to this environment.

    It leads a session of its own, as a `hbvm_bench.run.warm.Fork` does, which can be watched likewise.

    Attributes
    ----------
    pid : int
        Of the process.
    output : int
        The file descriptor where what it prints is read.
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str]) -> None:
        self.output, out = os.pipe()
        try:
            self._process = subprocess.Popen(
                list(command),
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=out,
                env={**os.environ, **environment},
                **ending.APART,
            )
        finally:
            os.close(out)
        self.pid = self._process.pid
        # it says that the process has ended while its number cannot be given to another one yet
        self._handle = os.pidfd_open(self.pid) if hasattr(os, "pidfd_open") else None

    def wait(self, seconds: float | None = None) -> int | None:
        """Return its exit code, or ``None`` where it still runs after so many seconds."""
        if self._handle is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(seconds)
                self.kill()
            return self._process.returncode
        ended, _, _ = select.select([self._handle], [], [], seconds)
        if not ended:
            return None
        self.kill()  # what it has started and left behind
        os.close(self._handle)
        return self._process.wait()

    def kill(self) -> None:
        """Kill it and what it has started."""
        ending.kill(self.pid)


_children: set[Subprocess | Fork] = set()
_lock = threading.Lock()


def watch(child: Subprocess | Fork, limits: Limits, compiled: Path | None = None) -> Ended:
    """Wait for the end of a process, or end it at its limits.

    Parameters
    ----------
    child : Subprocess or Fork
        It has just been started.
    limits : Limits
        Wall seconds and resident memory.
    compiled : Path, optional
        The child makes this file when it has compiled: the wall seconds count from then on, and the
        seconds to compile until then.
    """
    start = time.monotonic()
    begun = start if compiled is None else None
    with _lock:
        _children.add(child)
    kept: deque[bytes] = deque(maxlen=KEPT_OUTPUT)
    reader = threading.Thread(target=_drain, args=(child.output, kept), daemon=True)
    reader.start()
    code: int | None = None
    cause: Cause = "exit"
    peak, delay, walked = 0.0, POLL, start
    try:
        while code is None and cause == "exit":
            peak = max(peak, _peak_gib(child.pid))
            if time.monotonic() - walked > WALK:
                peak, walked = max(peak, memory.together_gib(child.pid)), time.monotonic()
            if begun is None and compiled is not None and compiled.exists():
                begun = time.monotonic()
            if warm.stopping.is_set():
                cause = "stopped"
            elif peak > limits.memory_gib:
                cause = "memory"
            elif begun is None and time.monotonic() - start > limits.compile_seconds:
                cause = "compiling"
            elif begun is not None and time.monotonic() - begun > limits.wall_seconds:
                cause = "timeout"
            else:
                code = child.wait(delay)
            delay = min(1.25 * delay, LONGEST_POLL)
    finally:
        if code is None:
            child.kill()
            code = child.wait()
        with _lock:
            _children.discard(child)
    reader.join(timeout=5.0)
    return Ended(
        code=ending.KILLED if code is None else code,
        cause="stopped" if warm.stopping.is_set() else cause,
        seconds=time.monotonic() - start,
        peak_gib=peak,
        output=b"".join(kept).decode(errors="replace"),
    )


def stop_all() -> None:
    """Kill all children; every `watch` under way returns with the cause ``"stopped"``."""
    warm.stopping.set()
    with _lock:
        children = list(_children)
    for child in children:
        child.kill()


def allow() -> None:
    """Let `watch` wait for children again after `stop_all`."""
    warm.stopping.clear()


def _drain(output: int, kept: deque[bytes]) -> None:
    while chunk := os.read(output, 4096):
        kept.append(chunk)
    os.close(output)


def _peak_gib(pid: int) -> float:
    held = memory.of_process(pid)
    return max(held.peak, held.resident + held.swapped) / 2**20  # what was swapped out is eaten, too
