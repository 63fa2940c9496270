"""The command line, ``hbvm-bench``, which ends at a Ctrl-C whenever it comes.

Only what comes with Python is imported above, for the commands take 0.4 s to import.
"""

import _thread
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

INTERRUPTED = 130
LATER = 0.05  # seconds until a Ctrl-C that was lost is sent again


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code: 0, 2 for input errors, 130 for Ctrl-C."""
    try:
        with _sent_again():
            from hbvm_bench.commands.app import run

            return run(arguments)
    except KeyboardInterrupt:
        return INTERRUPTED


@contextmanager
def _sent_again() -> Iterator[None]:
    """Send a Ctrl-C again that came where Python cannot raise, as in a function that LLVM calls.

    Python tells its hook for such exceptions, and otherwise goes on as if nothing had come.
    """
    before = sys.unraisablehook
    timers: list[threading.Timer] = []

    def hook(lost: "sys.UnraisableHookArgs") -> None:
        if issubclass(lost.exc_type, KeyboardInterrupt):
            timers.append(threading.Timer(LATER, _thread.interrupt_main))
            timers[-1].daemon = True
            timers[-1].start()
        else:
            before(lost)

    sys.unraisablehook = hook
    try:
        yield
        if any(timer.is_alive() for timer in timers):
            raise KeyboardInterrupt
    finally:
        for timer in timers:
            timer.cancel()
        sys.unraisablehook = before


if __name__ == "__main__":
    sys.exit(main())
