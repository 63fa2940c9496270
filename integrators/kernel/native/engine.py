"""Compiled entries in this process, called with integers and addresses."""

import ctypes
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import Any

from integrators.kernel.native import binary, lowered, store
from integrators.kernel.native.raised import Interrupts, calls_back, raise_kept

# What the entry of `step` can do; see `integrators.kernel.step.entry`.
RESET, ADVANCE, TAKE, PART, GO_ON, ACT = range(6)
ENTRY = "operation ctx partial between count times targets parts first out budget"

WAIT = "integrators: compiling the kernel for this processor, once: 2 to 10 s (ahead: `hbvm-bench warm`)"


def _say_what_is_waited_for() -> None:
    """Tell somebody who sits at a terminal why nothing happens."""
    if sys.stderr is not None and sys.stderr.isatty():
        print(WAIT, file=sys.stderr, flush=True)


class Engine:
    """A compiled function: compiled, loaded, or loaded before, when it is first needed.

    Parameters
    ----------
    function : callable
        Returns the numba function; called, and numba imported, only where it has to be compiled.
    arguments : str
        Names of the integers that it takes.
    *sources : str
        Folders and modules of the kernel whose code is in it: an edit of any makes another one.
    """

    def __init__(self, function: Callable[[], Any], arguments: str, *sources: str):
        self._make, self._arguments, self._sources = function, arguments.split(), sources

    def code(self) -> binary.Native:
        """Return the machine code."""

        def make() -> tuple[str, bytes]:
            _say_what_is_waited_for()
            if (text := lowered.get(self.key)) is not None:
                with suppress(RuntimeError):
                    return " ", binary.build_lowered(text)
            return " ", binary.build(*self._compiled())

        return binary.obtain(self.key, make)

    def lower(self) -> str:
        """Return it as LLVM's text; see `integrators.kernel.native.lowered`."""
        return binary.lower(*self._compiled())

    def _compiled(self) -> tuple[Any, list[tuple[Any, str]], str]:
        from numba import types

        return self._make(), [(types.int64, "i64")] * len(self._arguments), "i64"

    @property
    def key(self) -> str:
        """What the machine code is kept by: the function, and the sources of all that is in it."""
        make = self._make
        return store.key("engine", make.__module__, make.__qualname__, binary.sources(*self._sources))

    @cached_property
    def _function(self) -> Any:
        # Integers pass as addresses in half the time that they take as c_int64; negative ones too.
        kinds = [ctypes.c_void_p] * len(self._arguments)
        return ctypes.CFUNCTYPE(ctypes.c_int64, *kinds)(self.code().address)

    def __call__(self, *arguments: int, **named: int) -> int:
        """Call it; missing arguments are 0. The interpreter's lock is released meanwhile.

        What a field in Python raised is raised here, as a `UserError`, and Ctrl-C as it is; the memory holds
        what was made before.
        """
        if len(arguments) < len(self._arguments):
            arguments += tuple(named.get(name, 0) for name in self._arguments[len(arguments) :])
        if not calls_back():
            return self._function(*arguments)
        with Interrupts():
            outcome = self._function(*arguments)
        raise_kept()
        return outcome
