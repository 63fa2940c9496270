"""Compiled entries in this process, called with integers and addresses."""

import ctypes
import sys
from collections.abc import Callable
from functools import cached_property, partial
from importlib import import_module
from typing import Any

from integrators.kernel.native import binary, machine, shipped, store
from integrators.kernel.native.memory import Memory
from integrators.kernel.native.raised import Interrupts, raise_kept

KERNEL = "integrators.kernel"

WAIT = "integrators: compiling the kernel for this processor, once: 2 to 10 s (ahead: `hbvm-bench warm`)"


def _say_what_is_waited_for() -> None:
    """Tell somebody who sits at a terminal why nothing happens."""
    if sys.stderr is not None and sys.stderr.isatty():
        print(WAIT, file=sys.stderr, flush=True)


class Engine:
    """A compiled function: compiled, loaded, or loaded before, when it is first needed.

    Parameters
    ----------
    module : str
        Of the kernel, where the function is.
    function : str
        Its name.
    arguments : str
        Names of the integers that it takes.
    """

    def __init__(self, module: str, function: str, arguments: str):
        self._module, self._name, self._arguments = f"{KERNEL}.{module}", function, arguments.split()

    def code(self) -> binary.Native:
        """Return the machine code."""

        def make() -> tuple[str, bytes]:
            level = machine.level()
            if level is not None and (code := shipped.code(f"{self.key} {level}")) is not None:
                return " ", code
            _say_what_is_waited_for()
            return " ", binary.build(*self._compiled())

        return binary.obtain(self.key, make)

    @cached_property
    def _loaded(self) -> binary.Native:
        return self.code()

    @property
    def address(self) -> int:
        """Where the machine code is, for other code that calls it."""
        return self._loaded.address

    def for_levels(self) -> dict[str, bytes]:
        """Return machine code for each of `machine.levels`; see `integrators.kernel.native.shipped`."""
        text = binary.lower(*self._compiled())
        return {f"{self.key} {level}": binary.build_for(level, text) for level in machine.levels()}

    def _compiled(self) -> tuple[Any, list[tuple[Any, str]], str]:
        from numba import types

        function = getattr(import_module(self._module), self._name)
        return function, [(types.int64, "i64")] * len(self._arguments), "i64"

    @cached_property
    def key(self) -> str:
        """What the machine code is kept by: the function, and the sources of all that is in it."""
        return store.key("engine", self._module, self._name, binary.sources(self._module))

    @cached_property
    def _function(self) -> Any:
        # Integers pass as addresses in half the time that they take as c_int64; negative ones too.
        kinds = [ctypes.c_void_p] * len(self._arguments)
        return ctypes.CFUNCTYPE(ctypes.c_int64, *kinds)(self.address)

    def __call__(self, *arguments: int | Memory, **named: int | Memory) -> int:
        """Call it with numbers, and with memories by their addresses; missing arguments are 0.

        The interpreter's lock is released meanwhile. What a field in Python raised is raised here, as a
        `UserError`, and Ctrl-C as it is; the memory holds what was made before.
        """
        return self.prepared(*arguments, **named)()

    def prepared(self, *arguments: int | Memory, **named: int | Memory) -> Callable[[], int]:
        """Return what calls it with these arguments, whose memories are kept by whoever asks."""
        if len(arguments) < len(self._arguments):
            arguments += tuple(named.get(name, 0) for name in self._arguments[len(arguments) :])
        words, calls_back = [], False
        for argument in arguments:
            if isinstance(argument, Memory):
                words.append(argument.address)
                calls_back = calls_back or argument.pointed.calls_back
            else:
                words.append(argument)
        call = partial(self._function, *words)
        return partial(_heard, call) if calls_back else call


def _heard(call: Callable[[], int]) -> int:
    """Return what a call returns that may call Python back; raise what is raised there."""
    with Interrupts():
        outcome = call()
    raise_kept()
    return outcome
