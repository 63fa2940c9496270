"""The memory of processes: as Linux tells it in ``/proc``, elsewhere as psutil does."""

import contextlib
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil

try:
    import resource
except ImportError:  # Windows
    resource = None

PROCESSES = Path("/proc")


@dataclass(frozen=True)
class Memory:
    """The memory of a process in KiB; 0 for what the system does not tell.

    Attributes
    ----------
    resident, peak : int
        What it holds now, and the most that it has held.
    swapped : int
        What was moved to the disk.
    """

    resident: int = 0
    peak: int = 0
    swapped: int = 0


def of_process(pid: int) -> Memory:
    """Return the memory of a process; zeros if it has ended."""
    try:
        status = (PROCESSES / str(pid) / "status").read_text(encoding="ascii", errors="replace")
    except OSError:
        return _elsewhere(pid)
    words = (line.split() for line in status.splitlines() if line.endswith(" kB"))
    sizes = {name: int(size) for name, size, _ in words}
    names = ("VmRSS:", "VmHWM:", "VmSwap:")
    return Memory(*(sizes.get(name, 0) for name in names))


def own_peak() -> int:
    """Return the largest resident memory of this process in KiB, since `forget_peak` where Linux forgets."""
    largest = of_process(os.getpid()).peak
    if resource is None or PROCESSES.is_dir():
        return largest
    unit = 2**10 if sys.platform == "darwin" else 1  # bytes there
    return max(largest, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // unit)


def forget_peak() -> None:
    """Let the largest resident memory of this process be what it holds now, where Linux is the system."""
    with contextlib.suppress(OSError):
        (PROCESSES / "self" / "clear_refs").write_text("5", encoding="ascii")


def together_gib(leader: int) -> float:
    """Return what a process and those that it started hold together; memory that they share counts once."""
    members = list(_members(leader))
    return sum(map(_share, members)) / 2**30 if len(members) > 1 else 0.0


def _elsewhere(pid: int) -> Memory:
    try:
        told = psutil.Process(pid).memory_info()
    except psutil.Error:
        return Memory()
    return Memory(told.rss // 2**10, getattr(told, "peak_wset", told.rss) // 2**10)


def _members(leader: int) -> Iterator[psutil.Process]:
    """Yield the processes of a session, or the descendants where there are no sessions."""
    if hasattr(os, "getsid"):
        for member in psutil.process_iter():
            with contextlib.suppress(OSError):
                if os.getsid(member.pid) == leader:
                    yield member
        return
    with contextlib.suppress(psutil.Error):
        process = psutil.Process(leader)
        yield process
        yield from process.children(recursive=True)


def _share(process: psutil.Process) -> int:
    with contextlib.suppress(psutil.Error):  # it has just ended
        memory = process.memory_full_info()
        return getattr(memory, "pss", memory.uss) + getattr(memory, "swap", 0)
    return 0
