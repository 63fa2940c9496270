"""Threads that share the work of a trajectory's steps; see `integrators.kernel.parts.team`."""

import ctypes
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import lru_cache
from typing import Any

from integrators.kernel.context import Context
from integrators.kernel.engines import work
from integrators.kernel.native import binary
from integrators.kernel.parts.team import BLOCK, CLOSED, PIECES, Team


class Threads:
    """The threads of a trajectory, which are at work while the kernel is.

    Parameters
    ----------
    count : int
        Threads, that of the trajectory included.
    contexts : sequence of Context
        Memory of the trajectory, and of its partial steps.
    field : Native
        The field, on eight stages of those that lie side by side.
    part : Native or None
        What sets some of its rows, if there is such a function.
    """

    def __init__(
        self, count: int, contexts: tuple[Context, Context], field: binary.Native, part: binary.Native | None
    ):
        shape = contexts[0].shape
        block = BLOCK * -(-shape.rows // (BLOCK * PIECES))
        pieces = max(PIECES, -(-shape.constants.k // 8))
        self._team = Team(
            {"most": pieces}, {}, {"code": work.code(), "rest": _Rest(), "field": field, "part": part}
        )
        self._team.block = block
        for context in contexts:
            context.team = self._team
        self._helpers, self._pool = count - 1, ThreadPoolExecutor(count - 1)

    def during(self, call: Callable[[], int]) -> int:
        """Return what a call of the kernel returns, during which the threads work."""
        self._team.pieces[CLOSED] = 0
        helpers = [self._pool.submit(work, self._team, 1) for _ in range(self._helpers)]
        try:
            return call()
        finally:
            self._team.pieces[CLOSED] = 1
            wait(helpers)


class _Rest:
    """The address of what lets another thread have the processor."""

    def __init__(self) -> None:
        self.address = ctypes.cast(_yielding(), ctypes.c_void_p).value or 0


@lru_cache(maxsize=1)
def _yielding() -> Any:
    if sys.platform == "win32":
        return ctypes.windll.kernel32.SwitchToThread
    return ctypes.CDLL(None).sched_yield
