"""Warm processes: a case gets a process of its own by a fork of one that has loaded what it needs.

A fresh interpreter takes half a second to import the libraries, and as long again to load compiled
code, for a case of milliseconds. A `ForkServer` is a process that has imported them and, of each library,
one that has done a case well; the next case of that library on that problem is a fork of the latter.
Every case has a process, a memory and an end of its own, and none is done in a process that did
another one: what it finds there was loaded, and no more.

``multiprocessing``'s fork server is not used. It forks only from a process that has imported, never from
one that has loaded compiled code: a case of about 100 steps took 0.40 s with it, 0.07 s here and 1.36 s in a
fresh interpreter (medians of 12 in a row, beside other work). It also cannot be replaced where it is stopped,
and has one environment and one set of cores for all that it starts. Where a system lacks what a fork server
needs (`possible`), every case runs in a new interpreter.

A warm process is asked over a socket::

    runner -> warm process    the path of a request; with it the case's own socket and its output
    warm process -> runner    on the case's socket: the process of the case and the pipe at which it waits
                              until the runner knows it; at its end the exit code
    case -> runner            on the case's socket: that it is done, and stays to be forked from
"""

import atexit
import contextlib
import gc
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from hbvm_bench.measure import machine, memory
from hbvm_bench.run import ending, worker

DONE = b"done"
LONGEST = 2**16  # bytes of a message: a path
PATIENCE = 60.0  # seconds for an interpreter to start on a busy machine
LOOK = 0.2  # seconds between two looks whether the run was stopped meanwhile
GRACE = 5.0  # seconds for a warm process to say how a case ended, or to end itself; a stopped one never does
TASKS = Path("/proc/self/task")  # the threads of a process, which Linux tells
GROWTH = 2**18  # KiB that a process may have grown by and still be forked from


@dataclass
class ForkServer:
    """A process that has imported the libraries, and those that have done a case, one of each library."""

    place: object  # the environment, the directory and the cores of its processes
    process: "subprocess.Popen[bytes]"
    asked: socket.socket
    done: dict[str, tuple[str, socket.socket]] = field(
        default_factory=dict
    )  # by library: problem, where to ask

    def start(self, path: Path, library: str, problem: str) -> "Fork":
        """Start the process of a request.

        Raises
        ------
        OSError
            If the fork server has ended.
        """
        if self.done.get(library, ("",))[0] == problem:
            with contextlib.suppress(OSError):
                return Fork(self.done[library][1], path)
        return Fork(self.asked, path, lambda asked: self._keep(library, problem, asked))

    def close(self) -> None:
        """End its processes; one that does not end is killed, and those forked from it with it."""
        for asked in (self.asked, *(asked for _, asked in self.done.values())):
            asked.close()
        try:
            self.process.wait(GRACE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def _keep(self, library: str, problem: str, asked: socket.socket) -> None:
        if library in self.done:
            self.done[library][1].close()
        self.done[library] = problem, asked


class Fork:
    """The process of one case, a fork of a warm one; see `hbvm_bench.run.supervise.watch`.

    Attributes
    ----------
    lost : bool
        Whether the warm process does not say how it ended, because it was killed or stopped; an exit
        then says nothing of the case.
    """

    def __init__(
        self, asked: socket.socket, path: Path, keep: Callable[[socket.socket], None] | None = None
    ) -> None:
        self._keep = keep
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.output, out = os.pipe()
        try:
            socket.send_fds(asked, [os.fsencode(path)], [theirs.fileno(), out])
            theirs.close()  # or nobody would be seen to be gone
            _until_answered(self._socket)
            said, handles, _, _ = socket.recv_fds(self._socket, LONGEST, 2, socket.MSG_CMSG_CLOEXEC)
            if not handles:
                raise ConnectionError("the warm process has ended")
        except OSError:
            self._socket.close()
            os.close(self.output)
            raise
        finally:
            theirs.close()
            os.close(out)
        self.pid, (self._handle, opens) = int(said), handles
        self.lost = False
        with contextlib.suppress(BrokenPipeError):  # it was killed meanwhile
            os.write(opens, b"\0")  # not left to the warm process, which may be stopped before it does
        os.close(opens)

    def wait(self, seconds: float | None = None) -> int | None:
        """Return the exit code, or ``None`` where it still runs after so many seconds."""
        poll = select.poll()
        poll.register(self._socket, select.POLLIN)
        poll.register(self._handle, select.POLLIN)
        if not poll.poll(None if seconds is None else 1000 * seconds):
            return None
        self._socket.settimeout(GRACE)  # one of a stopped warm process ends, and nobody says how
        try:
            said = self._socket.recv(LONGEST)
        except OSError:
            said = b""
        self.lost = not said
        if self.lost:  # what it has started is left to this process
            ending.kill(self.pid)
        os.close(self._handle)
        if said == DONE and self._keep is not None:
            self._keep(self._socket)
            return 0
        self._socket.close()
        return int(said) if said else ending.KILLED  # with the process that would have said it

    def kill(self) -> None:
        """Kill it; what it has started is killed by the process that it is a fork of."""
        with contextlib.suppress(OSError):
            signal.pidfd_send_signal(self._handle, signal.SIGKILL)


stopping = threading.Event()
"""Set while all cases are to end: no thread waits for a warm process then."""

_idle: list[ForkServer] = []
_lock = threading.Lock()


def _until_answered(asked: socket.socket) -> None:
    """Wait for a warm process to answer; a stopped one never does."""
    deadline = time.monotonic() + PATIENCE
    while not select.select([asked], [], [], LOOK)[0]:
        if stopping.is_set() or time.monotonic() > deadline:
            raise TimeoutError("the warm process does not answer")


def possible() -> bool:
    """Whether this system supports a fork server; else every case runs in a new interpreter."""
    return hasattr(os, "fork") and hasattr(os, "pidfd_open") and TASKS.is_dir()


@contextmanager
def fork_server(environment: Mapping[str, str]) -> Iterator[ForkServer]:
    """Yield an unused fork server, an existing or a new one; after an error it is ended.

    ``environment`` is added to the one that it inherits.
    """
    whole = {**os.environ, **environment}
    place = whole, Path.cwd(), machine.cores()
    with _lock:
        server = next((idle for idle in _idle if idle.place == place), None)
        if server is not None:
            _idle.remove(server)
    server = server or _new(whole, place)
    try:
        yield server
    except BaseException:
        server.close()
        raise
    with _lock:
        _idle.append(server)


@atexit.register
def close() -> None:
    """End the unused fork servers."""
    with _lock:
        while _idle:
            _idle.pop().close()


def _new(environment: Mapping[str, str], place: object) -> ForkServer:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-m", "hbvm_bench.run.warm", str(theirs.fileno())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=environment,
            pass_fds=[theirs.fileno()],
            start_new_session=True,  # a Ctrl-C at the terminal reaches the runner only
        )
    return ForkServer(place, process, ours)


def main(asked: socket.socket) -> None:
    """Be a warm process: what returns from `_fork` is the process of a case, which may become one itself."""
    cores, size, first = machine.cores(), _resident(), True
    while True:
        parent, path, runner = _fork(asked)
        code = _code(path, parent, first)
        sys.stdout.flush()
        sys.stderr.flush()
        if code or not (first and _is_alone() and _resident() - size < GROWTH):
            os._exit(code)
        machine.bind(cores)
        for stream in (1, 2):  # its output has ended
            os.dup2(0, stream)
        gc.collect()
        runner.send(DONE)
        asked, first = runner, False


def _fork(asked: socket.socket) -> tuple[int, Path, socket.socket]:
    """Make a process for every request, and say how it ended; return in each of them, with its parent."""
    parent = os.getpid()
    running: dict[int, tuple[int, socket.socket]] = {}
    poll = select.poll()
    poll.register(asked, select.POLLIN)
    while True:
        for handle, _ in poll.poll():
            if handle in running:
                poll.unregister(handle)
                os.close(handle)
                _bury(*running.pop(handle))
                continue
            path, handles, _, _ = socket.recv_fds(asked, LONGEST, 2)
            if not path:  # the runner has ended, or needs it no more
                for pid, _ in running.values():
                    ending.kill(pid)
                os._exit(0)
            runner, out = socket.socket(fileno=handles[0]), handles[1]
            gate, opens = os.pipe()
            pid = os.fork()
            if pid == 0:
                os.setsid()
                os.close(opens)
                os.read(gate, 1)  # until the runner knows it, or is gone
                for stream in (1, 2):
                    os.dup2(out, stream)
                for inherited in (gate, out, *running):
                    os.close(inherited)
                for other in (asked, *(other for _, other in running.values())):
                    other.close()
                return parent, Path(os.fsdecode(path)), runner
            handle = os.pidfd_open(pid)
            with contextlib.suppress(OSError):
                socket.send_fds(runner, [str(pid).encode()], [handle, opens])
            for inherited in (gate, opens, out):
                os.close(inherited)
            running[handle] = pid, runner
            poll.register(handle, select.POLLIN)


def _bury(pid: int, runner: socket.socket) -> None:
    ending.kill(pid)  # before its number may be given to another one
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    with runner, contextlib.suppress(OSError):
        runner.send(str(code).encode())


def _code(path: Path, parent: int, first: bool) -> int:
    """Do what the request at ``path`` asks, and return the exit code."""
    sys.argv[1:] = [str(path)]
    try:
        worker.work(path, parent, "libraries" if first else "code")
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else 1
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def _is_alone() -> bool:
    """Whether this process has one thread and no children: others would not be there in a fork."""
    tasks = list(TASKS.iterdir())
    return len(tasks) == 1 and not (tasks[0] / "children").read_text(encoding="ascii")


def _resident() -> int:
    return memory.of_process(os.getpid()).resident


if __name__ == "__main__":
    main(socket.socket(fileno=int(sys.argv[1])))
