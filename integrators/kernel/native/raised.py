"""What is raised in Python while compiled code runs, kept until it has returned.

Nothing may be raised through compiled code: ctypes prints what leaves a callback, and drops it.
A callback keeps what its function raises. What a handler of signals raises (Ctrl-C) may come
before a callback's first line, where nothing can catch it, so the handler is taken over.
"""

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

from integrators.protocol import UserError


class _Raised(threading.local):
    """What was raised last; a callback runs in the thread that has called compiled code."""

    error: BaseException | None = None


_raised = _Raised()


def keep(error: BaseException) -> None:
    """Keep what was raised in this thread."""
    _raised.error = error


def kept() -> BaseException | None:
    """Return what has been raised in this thread since the last `raise_kept`."""
    return _raised.error


def raise_kept() -> None:
    """Raise what has been raised in this thread since the last call.

    Raises
    ------
    integrators.protocol.UserError
        For exceptions; Ctrl-C and the like are raised as they are.
    """
    error, _raised.error = _raised.error, None
    if isinstance(error, Exception):
        raise UserError(error) from error
    if error is not None:
        raise error


class Interrupts:
    """While entered, what the handler of Ctrl-C raises is kept; a second one is raised where it comes."""

    def __enter__(self) -> None:
        self._handler: Any = None
        if threading.current_thread() is threading.main_thread():
            handler = signal.getsignal(signal.SIGINT)
            if callable(handler):
                self._handler = handler
                signal.signal(signal.SIGINT, self._keep)

    def _keep(self, number: int, frame: FrameType | None) -> None:
        try:
            self._handler(number, frame)
        except BaseException as error:
            if _raised.error is not None:  # the first one was not enough: a function does not return
                raise
            _raised.error = error

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._handler is not None:
            signal.signal(signal.SIGINT, self._handler)
