"""A child process under hard limits of wall time and memory.

Address-space limits are too blunt for libraries that compile at run time, so
the resident memory of the child, and of what it starts, is watched from outside;
all are killed when they pass the limit together, whatever they are doing.
"""

import contextlib
import os
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Literal

from hbvm_bench.campaign.file import Limits

Cause = Literal["exit", "compiling", "timeout", "memory", "stopped"]
POLL = 0.02  # seconds, at first
LONGEST_POLL = 0.2  # of a case that takes long: the runner needs little of the machine
WALK = 1.0  # seconds between walks over all processes: they take milliseconds that a timing must not lose
KEPT_OUTPUT = 64  # chunks of at most 4 KiB

_children: set[subprocess.Popen[bytes]] = set()
_lock = threading.Lock()
_stopping = threading.Event()


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
        if self.code < 0:
            return f"ended by signal {_signal_name(-self.code)}"
        return f"ended with exit code {self.code}"


def run(
    command: Sequence[str], environment: Mapping[str, str], limits: Limits, compiled: Path | None = None
) -> Ended:
    """Run a command to its end, or to its limits.

    Parameters
    ----------
    command : sequence of str
        The program and its arguments.
    environment : mapping of str
        Added to this process's environment.
    limits : Limits
        Wall seconds and resident memory.
    compiled : Path, optional
        The child makes this file when it has compiled: the wall seconds count from then on, and the
        seconds to compile until then.

    Returns
    -------
    Ended
    """
    start = time.monotonic()
    begun = start if compiled is None else None
    child = subprocess.Popen(
        list(command),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={**os.environ, **environment},
        start_new_session=True,  # a Ctrl-C at the terminal reaches the runner only
    )
    with _lock:
        _children.add(child)
    kept: deque[bytes] = deque(maxlen=KEPT_OUTPUT)
    assert child.stdout is not None
    reader = threading.Thread(target=_drain, args=(child.stdout, kept), daemon=True)
    reader.start()
    cause: Cause = "exit"
    peak, delay, walked = 0.0, POLL, start
    try:
        while child.poll() is None:
            peak = max(peak, _peak_gib(child.pid))
            if time.monotonic() - walked > WALK:
                peak, walked = max(peak, _together_gib(child.pid)), time.monotonic()
            if _stopping.is_set():
                cause = "stopped"
            elif peak > limits.memory_gib:
                cause = "memory"
            elif begun is not None and time.monotonic() - begun > limits.wall_seconds:
                cause = "timeout"
            elif begun is None and compiled is not None:
                if compiled.exists():
                    begun = time.monotonic()
                elif time.monotonic() - start > limits.compile_seconds:
                    cause = "compiling"
            if cause != "exit":
                break
            _stopping.wait(delay)
            delay = min(1.25 * delay, LONGEST_POLL)
    finally:
        _kill(child)
        with _lock:
            _children.discard(child)
    reader.join(timeout=5.0)
    return Ended(
        code=child.returncode,
        cause="stopped" if _stopping.is_set() else cause,
        seconds=time.monotonic() - start,
        peak_gib=peak,
        output=b"".join(kept).decode(errors="replace"),
    )


def stop_all() -> None:
    """Kill all children; every `run` under way returns with the cause ``"stopped"``."""
    _stopping.set()
    with _lock:
        children = list(_children)
    for child in children:
        _kill(child)


def allow() -> None:
    """Let `run` start children again after `stop_all`."""
    _stopping.clear()


def _kill(child: subprocess.Popen[bytes]) -> None:
    # its session too: a child may have started processes of its own
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, signal.SIGKILL)
    child.wait()


def _drain(stream: IO[bytes], kept: deque[bytes]) -> None:
    with stream:
        while chunk := os.read(stream.fileno(), 4096):
            kept.append(chunk)


def _peak_gib(pid: int) -> float:
    try:
        status = Path(f"/proc/{pid}/status").read_text(encoding="ascii", errors="replace")
    except OSError:
        return 0.0
    sizes = {name: value for name, _, value in (line.partition(":") for line in status.splitlines())}
    peak, resident, swapped = (
        int((sizes.get(name) or "0").split()[0]) for name in ("VmHWM", "VmRSS", "VmSwap")
    )
    return max(peak, resident + swapped) / 2**20  # what was swapped out is eaten, too


def _together_gib(session: int) -> float:
    """Return what the processes of a session hold together; memory that they share counts once."""
    members = [pid for pid in _processes() if _session_of(pid) == session]
    return sum(map(_share_gib, members)) if len(members) > 1 else 0.0


def _processes() -> list[int]:
    return [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]


def _session_of(pid: int) -> int | None:
    with contextlib.suppress(OSError):
        return os.getsid(pid)
    return None


def _share_gib(pid: int) -> float:
    try:
        rolled = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii", errors="replace")
    except OSError:  # it has just ended
        return 0.0
    sizes = {name: value for name, _, value in (line.partition(":") for line in rolled.splitlines())}
    return sum(int((sizes.get(name) or "0").split()[0]) for name in ("Pss", "SwapPss")) / 2**20


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return str(number)
