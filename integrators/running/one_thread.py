"""What keeps a second thread out of a stepper that is at work.

Compiled code and the peers' libraries release the interpreter's lock while they work on a
stepper's memory: two threads in it at once would give numbers that belong to neither.
"""

import functools
import threading
from collections.abc import Callable
from typing import Concatenate, ParamSpec, Protocol, TypeVar

from problems.errors import InputError

P = ParamSpec("P")
Result = TypeVar("Result")


class Guarded(Protocol):
    """What has a lock of its own."""

    _at_work: threading.RLock  # type: ignore[valid-type]


S = TypeVar("S", bound=Guarded)


def one_thread(method: Callable[Concatenate[S, P], Result]) -> Callable[Concatenate[S, P], Result]:
    """Let a method of a stepper raise `InputError` while another thread is in one of its methods."""

    @functools.wraps(method)
    def guarded(stepper: S, *args: P.args, **kwargs: P.kwargs) -> Result:
        if not stepper._at_work.acquire(blocking=False):
            raise InputError(
                f"this {type(stepper).__name__} is at work in another thread; "
                "start one stepper for each thread (one program serves them all)."
            )
        try:
            return method(stepper, *args, **kwargs)
        finally:
            stepper._at_work.release()

    return guarded
