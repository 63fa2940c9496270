"""The machine in words that say what matters for a timing and nothing about whose it is."""

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def describe() -> dict[str, str | int]:
    """Return processor, cores, memory, instruction sets, operating system and Python."""
    return {
        "processor": _processor(),
        "cores": len(cores()),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30),
        "vector_instructions": _vector_instructions(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": f"{platform.python_implementation()} {platform.python_version()}",
    }


def cores() -> list[int]:
    """Return the numbers of the cores this process may use."""
    return sorted(os.sched_getaffinity(0))


@contextmanager
def leaving_a_core() -> Iterator[int | None]:
    """Keep this process off the core that is yielded, for another one to be timed there.

    Where there is only one core this process cannot leave it.
    """
    mine = cores()
    core = max(mine, default=None)
    others = set(mine) - {core}
    if others:
        os.sched_setaffinity(0, others)
    try:
        yield core
    finally:
        os.sched_setaffinity(0, mine)


@contextmanager
def staying_on_a_core() -> Iterator[None]:
    """Keep this process on one core, the last one it may use."""
    mine = cores()
    os.sched_setaffinity(0, {mine[-1]})
    try:
        yield
    finally:
        os.sched_setaffinity(0, mine)


def flags() -> set[str]:
    """Return what the processor says that it can do, in the words of ``/proc/cpuinfo``."""
    return set(_cpuinfo("flags").split())


def _cpuinfo(field: str) -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    for line in text.splitlines():
        name, _, value = line.partition(":")
        if name.strip() == field:
            return value.strip()
    return ""


def _processor() -> str:
    return _cpuinfo("model name") or platform.processor() or "unknown processor"


def _vector_instructions() -> str:
    has = flags()
    for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2"), ("avx", "AVX")):
        if flag in has:
            return name
    return "SSE2" if "sse2" in has else "none known"
