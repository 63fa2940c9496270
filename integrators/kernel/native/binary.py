"""Numba functions as machine code that needs no numba to be loaded again.

`build` compiles a function of plain numbers and addresses to one object file
with one C entry, and `load` puts such a file into this process through
llvmlite. A process that finds its code in the store therefore never imports
numba, which costs more than everything else it does before its first step.
"""

import hashlib
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

import llvmlite
import llvmlite.binding as llvm

from integrators.kernel.native import machine, store
from integrators.kernel.native.machine import load, lock

ROOT = Path(__file__).parents[3]
IMPORT = re.compile(r"^[ ]*from ((?:integrators|problems)[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
TYPES_ONLY = re.compile(r"^if TYPE_CHECKING:.*\n(?:(?: .*)?\n)*", re.MULTILINE)

_loaded: dict[str, "Native"] = {}
_waited: list[float] = []  # seconds, for other processes


@dataclass(frozen=True)
class Native:
    """Machine code in this process.

    Attributes
    ----------
    address : int
        Of its C function.
    note : str
        What its maker says about it, one character.
    from_cache : bool
        Whether it came from the store, or from this process's memory.
    seconds : float
        What compiling or loading it took.
    calls_back : bool
        Whether it calls Python back.
    owner : object
        What keeps it alive, where that is not this module.
    """

    address: int
    note: str
    from_cache: bool
    seconds: float
    calls_back: bool = False
    owner: Any = None


@lru_cache(maxsize=1)
def platform() -> str:
    """Return all that machine code depends on besides its source, as text."""
    parts = [
        llvm.get_host_cpu_name(),
        llvm.get_host_cpu_features().flatten(),
        llvm.get_process_triple(),
        version("numba"),
        llvmlite.__version__,
        *(
            f"{name}={os.environ.get(name, '')}"
            for name in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_OPT")
        ),
    ]
    return "\n".join(parts)


@lru_cache(maxsize=64)
def sources(*modules: str) -> str:
    """Return the digest of modules and of all that they import of these packages: an edit voids their code.

    What numba compiles, it takes from there: functions, constants, the layout of memory. What is imported for
    the checker of types alone does not count.
    """
    reached: dict[str, bytes] = {}
    waiting = [*modules, __name__]  # this one turns functions into machine code
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached[name] = _file(name).read_bytes()
            waiting += imported(reached[name].decode())
    return hashlib.sha256(b"".join(reached[name] for name in sorted(reached))).hexdigest()


def imported(text: str) -> set[str]:
    """Return the modules of these packages that one imports, at its top or in its functions."""
    found: set[str] = set()
    for package, names in IMPORT.findall(TYPES_ONLY.sub("", text)):
        parts = [part.split()[0] for part in re.sub(r"#.*", "", names).strip("()").split(",") if part.strip()]
        found.update(name if _file(name := f"{package}.{part}").exists() else package for part in parts)
    return {name for name in found if _file(name).exists()}


def _file(module: str) -> Path:
    path = ROOT.joinpath(*module.split("."))
    return path.with_suffix(".py") if not path.is_dir() else path / "__init__.py"


def obtain(name: str, make: Callable[[], tuple[str, bytes]]) -> Native:
    """Return the code of a key: from this process, from the store, or by making it.

    Parameters
    ----------
    name : str
        A key of `store.key`, of everything the code depends on but `platform`.
    make : callable
        Returns a note of one character and the object file.
    """
    with lock:
        if (known := _loaded.get(name)) is not None:
            return Native(known.address, known.note, True, 0.0)
        full = store.key(name, platform())
        started = clock()
        kept = store.get(full)
        if not kept:
            before = perf_counter()
            with store.making(full):  # processes that start together need it made once
                _waited.append(perf_counter() - before)
                kept = store.get(full)
                if not kept:
                    note, code = make()
                    store.put(full, note.encode("ascii") + code)
                    return _keep(name, Native(load(code), note, False, clock() - started))
        return _keep(name, Native(load(kept[1:]), chr(kept[0]), True, clock() - started))


def clock() -> float:
    """Return seconds, but for those in which another process compiled what this one waited for."""
    return perf_counter() - sum(_waited)


def _keep(name: str, native: Native) -> Native:
    _loaded[name] = native
    return native


def build(
    function: Any,
    arguments: Sequence[tuple[Any, str]],
    returns: str = "void",
    around: Callable[[str], str] | None = None,
) -> bytes:
    """Compile a numba function to an object file with the C function `ENTRY`.

    Parameters
    ----------
    function : compiled function
        Of `integrators.kernel.native.jit`.
    arguments : sequence of (numba type, LLVM type)
        The C function takes the LLVM types. A vector is passed by the address
        of its lanes, since its place in a call depends on the processor.
    returns : {"void", "i64"}
        What the function returns.
    around : callable, optional
        Given the name of the compiled function, returns LLVM's text of an `ENTRY` that
        calls it; by default one with the function's own arguments.

    Raises
    ------
    numba.NumbaError
        If it cannot be compiled for these types.
    """
    with machine.alone():
        return machine.optimized(linked(function, arguments, returns, around))


def lower(function: Any, arguments: Sequence[tuple[Any, str]], returns: str = "void") -> str:
    """Return what `build` makes machine code of as LLVM's text, simplified, the same for all processors."""
    with machine.alone():
        return str(machine.simplified(linked(function, arguments, returns)))


def build_for(level: str, text: str) -> bytes:
    """Return an object file of what `lower` returned, for one of `machine.LEVELS`, with `build`'s results."""
    with machine.alone():
        return machine.optimized(llvm.parse_assembly(text), level)


def linked(
    function: Any,
    arguments: Sequence[tuple[Any, str]],
    returns: str,
    around: Callable[[str], str] | None = None,
) -> Any:
    """Return a module of the `ENTRY` and all that it calls."""
    from integrators.kernel.native import jit  # imports numba

    lowered = jit.module(function, tuple(kind for kind, _ in arguments))
    return machine.entered(lowered, arguments, returns, around)
