"""What the scripts beside this one print of a computation: its first call, which compiles, and the next."""

from collections.abc import Callable
from time import perf_counter
from typing import TypeVar

T = TypeVar("T")


def clocked(name: str, compute: Callable[[], T]) -> T:
    """Compute twice, print the times of both, and return the result.

    heyoka's integrator is made anew by every call; whoever keeps one saves that time, which is left out.
    """
    began = perf_counter()
    compute()
    first = perf_counter() - began
    began = perf_counter()
    result = compute()
    warm = perf_counter() - began - getattr(result, "compile_seconds", 0.0)
    print(f"{name}: {1e3 * warm:.2f} ms, the first call {first:.2f} s")
    return result
