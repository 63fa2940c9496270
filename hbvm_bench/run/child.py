"""Child processes that do what they are asked, one request after the other, each under hard limits.

A `Child` reads requests at its input and answers at its output, so that its libraries are imported and its
code is loaded once; a case that crashes, hangs or eats memory costs its process and no other case.

Address-space limits are too blunt for libraries that compile at run time, so the resident memory of a child,
and of what it starts, is watched from outside; all are killed when they pass the limit together. A child ends
with its parent: Linux sees to it, elsewhere the end of its input does.
"""

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO, Any, Literal

import psutil

from hbvm_bench.campaign.file import Limits
from hbvm_bench.measure import machine, memory

try:
    import resource
except ImportError:  # Windows: a process gone wild may fill the disk
    resource = None

Cause = Literal["exit", "compiling", "timeout", "memory", "stopped"]
POLL = 0.02  # seconds, at first
LONGEST_POLL = 0.2  # of a case that takes long: the runner needs little of the machine
WALK = 1.0  # seconds between walks over all processes: they take milliseconds that a timing must not lose
KEPT_OUTPUT = 64  # chunks of at most 4 KiB
KILLED = -9  # the exit code of a process that was killed
LARGEST_FILE = 2**32  # bytes: a process gone wild does not fill the disk
LENGTH = 8  # bytes before a message, which say how long it is
COMPILED, STAYS, LEAVES = b"c", b"s", b"l"  # the first byte of a message
SET_PDEATHSIG = 1

ENVIRONMENT = {
    # one thread each, whatever does the linear algebra
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "JAX_PLATFORMS": "cpu",
}
APART: dict[str, Any] = (
    {"start_new_session": True}
    if hasattr(os, "setsid")
    else {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
)
"""How ``subprocess`` starts a process that a Ctrl-C at the terminal does not reach: the runner only."""

stopping = threading.Event()
"""Set while all cases are to end."""


def caches_in(directory: Path) -> dict[str, str]:
    """Return the environment in which every library keeps its compiled code in this directory.

    All of them keep it below the user's own directories, so these are moved.
    """
    return {
        "HOME": str(directory),
        "XDG_CACHE_HOME": str(directory / "cache"),
        "HBVM_BENCH_CACHE": str(directory / "kernel"),
        "NUMBA_CACHE_DIR": str(directory / "numba"),
    }


@dataclass(frozen=True)
class Ended:
    """How a request ended.

    Attributes
    ----------
    reply : bytes
        The answer; empty without one.
    cause : {"exit", "compiling", "timeout", "memory", "stopped"}
        Without an answer: whether the process ended itself, or what it was killed for.
    code : int
        Its exit code then; negative for a signal.
    seconds : float
        Wall time; of a process that was started for it, from its start on.
    peak_gib : float
        Largest memory, with that of the processes it started.
    output : str
        The end of what it printed.
    """

    reply: bytes
    cause: Cause
    code: int
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


class Child:
    """A process that runs a command, or `hbvm_bench.run.worker`, and what it has started.

    Parameters
    ----------
    environment : mapping, optional
        What is added to the environment of this process.
    command : sequence of str, optional
        Arguments of Python.
    """

    def __init__(
        self,
        environment: Mapping[str, str] | None = None,
        command: Sequence[str] = ("-m", "hbvm_bench.run.worker"),
    ) -> None:
        self.born, self.asked = time.monotonic(), False
        self.process = subprocess.Popen[bytes](
            [sys.executable, *command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, **ENVIRONMENT, **(environment or {})},
            **APART,
        )
        self._answers: SimpleQueue[bytes] = SimpleQueue()
        self._printed: deque[bytes] = deque(maxlen=KEPT_OUTPUT)
        self._readers = [
            threading.Thread(target=target, args=arguments, daemon=True)
            for target, arguments in (
                (take, (self.process.stdout, self._answers)),
                (_drain, (self.process.stderr, self._printed)),
            )
        ]
        for reader in self._readers:
            reader.start()
        self.close = weakref.finalize(self, _end, self.process)

    @property
    def alive(self) -> bool:
        """Whether it may be asked again."""
        return self.close.alive and all(reader.is_alive() for reader in self._readers)

    def ask(self, request: bytes, limits: Limits, *, compiles: bool = True) -> Ended:
        """Send a request and wait for the answer, or end the process at its limits.

        With ``compiles`` it says when it has compiled: the wall seconds count from then on, and the seconds
        to compile until then. A child without an answer is closed, as is one that wants to leave.
        """
        start = time.monotonic() if self.asked else self.born
        self.asked = True
        self._printed.clear()
        # not here: a process that is stopped may never read it, and has its limits all the same
        threading.Thread(target=_give, args=(self.process.stdin, request), daemon=True).start()
        begun = None if compiles else start
        reply: bytes | None = None
        cause: Cause = "exit"
        peak, delay, walked = 0.0, POLL, start
        while reply is None and cause == "exit":
            try:
                reply = self._answers.get(timeout=delay)
                if reply == COMPILED:
                    begun, reply, delay = time.monotonic(), None, POLL
            except Empty:
                delay = min(1.25 * delay, LONGEST_POLL)
            now = time.monotonic()
            peak = max(peak, _peak_gib(self.process.pid))
            if now - walked > WALK:
                peak, walked = max(peak, memory.together_gib(self.process.pid)), now
            if stopping.is_set():
                cause = "stopped"
            elif peak > limits.memory_gib:
                cause = "memory"
            elif reply is None and begun is None and now - start > limits.compile_seconds:
                cause = "compiling"
            elif reply is None and begun is not None and now - begun > limits.wall_seconds:
                cause = "timeout"
        seconds = time.monotonic() - start
        if cause != "exit" or not reply or reply[:1] == LEAVES:
            self.close()
            for reader in self._readers:
                reader.join(timeout=5.0)
        answered = reply if reply and cause == "exit" else b""
        return Ended(
            reply=answered[1:],
            cause=cause,
            code=0 if answered else KILLED if self.process.returncode is None else self.process.returncode,
            seconds=seconds,
            peak_gib=peak,
            output=b"".join(self._printed).decode(errors="replace"),
        )


class Idle:
    """Processes that wait to be asked again: a run finds those of the one before, too."""

    def __init__(self) -> None:
        self._waiting: list[tuple[object, Child]] = []  # with what they serve, the longest idle first
        self._lock = threading.Lock()
        # Linux ends a process with the thread that started it
        self._starter = ThreadPoolExecutor(1, thread_name_prefix="starter")

    @contextmanager
    def one(self, serves: str, *, fresh: bool = False) -> Iterator[Child]:
        """Yield a process that serves this, or a ``fresh`` one; afterwards it waits, unless it is closed."""
        place = serves, dict(os.environ)
        with self._lock:
            found = next((pair for pair in self._waiting if pair[0] == place and pair[1].alive), None)
            if found is not None and not fresh:
                self._waiting.remove(found)
        child = found[1] if found is not None and not fresh else self._starter.submit(Child).result()
        yield child
        with self._lock:
            self._waiting = [pair for pair in (*self._waiting, (place, child)) if pair[1].alive]
            while len(self._waiting) > len(machine.cores()):
                self._waiting.pop(0)[1].close()


def send(stream: IO[bytes], message: bytes) -> None:
    """Write a message for `received`."""
    stream.write(len(message).to_bytes(LENGTH, "big") + message)
    stream.flush()


def received(stream: IO[bytes]) -> bytes:
    """Return the next message; empty at the end."""
    length = int.from_bytes(stream.read(LENGTH), "big")
    message = stream.read(length)
    return message if len(message) == length else b""


def _give(stream: IO[bytes], request: bytes) -> None:
    with contextlib.suppress(OSError, ValueError):  # it has ended: there will be no answer
        send(stream, request)


def take(stream: IO[bytes], messages: "SimpleQueue[bytes]") -> None:
    """Queue the messages of a stream; an empty one at its end."""
    with stream, contextlib.suppress(OSError):
        while message := received(stream):
            messages.put(message)
    messages.put(b"")


def limit() -> None:
    """Leave no core and no huge file behind, end first where memory is short, and with the parent."""
    if resource is not None:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))
    with contextlib.suppress(OSError):  # Linux, short of memory, ends this process and not the runner
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    with contextlib.suppress(AttributeError, TypeError):  # macOS; Windows
        ctypes.CDLL(None).prctl(SET_PDEATHSIG, signal.SIGKILL)


def _drain(stream: IO[bytes], printed: deque[bytes]) -> None:
    with stream:
        while chunk := os.read(stream.fileno(), 4096):
            printed.append(chunk)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """Kill a process and what it has started, before its number may be given to another one."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        with contextlib.suppress(psutil.NoSuchProcess):
            leader = psutil.Process(process.pid)
            for member in (*leader.children(recursive=True), leader):
                with contextlib.suppress(psutil.Error):
                    member.kill()
    process.wait()
    if process.stdin is not None:
        with contextlib.suppress(OSError):
            process.stdin.close()


def _peak_gib(pid: int) -> float:
    held = memory.of_process(pid)
    return max(held.peak, held.resident + held.swapped) / 2**20  # what was swapped out is eaten, too
