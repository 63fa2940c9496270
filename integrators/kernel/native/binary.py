"""Numba functions as machine code that needs no numba to be loaded again.

`build` compiles a function of plain numbers and addresses to one object file
with one C entry, and `load` puts such a file into this process through
llvmlite. A process that finds its code in the store therefore never imports
numba, which costs more than everything else it does before its first step.
"""

import ctypes.util
import gc
import hashlib
import logging  # noqa: F401 -- its lock must be taken after ours at a fork: whoever compiles may log
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import llvmlite
import llvmlite.binding as llvm

from integrators.kernel.native import store

ENTRY = "hbvm_entry"

Made = TypeVar("Made", bytes, str)

lock = threading.RLock()
"""Held while code is compiled or loaded, and during a fork, which waits for that: LLVM's and numba's own
locks would stay locked for ever in the child, where the thread that holds them does not exist."""
if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=lock.acquire, after_in_parent=lock.release, after_in_child=lock.release)
_loaded: dict[str, "Native"] = {}
_waited: list[float] = []  # seconds, for other processes
_engines: list[Any] = []  # an engine owns its code: none may be collected


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
    """

    address: int
    note: str
    from_cache: bool
    seconds: float


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


@lru_cache(maxsize=32)
def sources(*modules: str) -> str:
    """Return the digest of modules and folders, by paths from the kernel: an edit voids their code."""
    digest = hashlib.sha256()
    for name in modules:
        place = Path(__file__).parents[1] / name
        for file in sorted(place.glob("*.py")) if place.is_dir() else [place.with_suffix(".py")]:
            digest.update(file.read_bytes())
    return digest.hexdigest()


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
    numba.core.errors.NumbaError
        If it cannot be compiled for these types.
    """
    with _alone():
        return _optimized(_linked(function, arguments, returns, around), _object)


def lower(function: Any, arguments: Sequence[tuple[Any, str]], returns: str = "void") -> str:
    """Return what `build` makes machine code of, as LLVM's text: the same for all processors of a system."""
    with _alone():
        return str(_linked(function, arguments, returns))


def build_lowered(text: str) -> bytes:
    """Return the object file that `build` makes, of what `lower` has returned; without numba.

    Raises
    ------
    RuntimeError
        If this LLVM cannot read it.
    """
    with _alone():
        return _optimized(llvm.parse_assembly(text), _object)


def assembly(function: Any, arguments: Sequence[tuple[Any, str]], returns: str = "void") -> str:
    """Return the machine code that `build` makes, as text."""
    with _alone():
        made = _linked(function, arguments, returns)
        return _optimized(made, lambda machine, module: machine.emit_assembly(module))


def _linked(
    function: Any,
    arguments: Sequence[tuple[Any, str]],
    returns: str,
    around: Callable[[str], str] | None = None,
) -> Any:
    """Return a module of the `ENTRY` and all that it calls."""
    from integrators.kernel.native import jit  # imports numba

    made = jit.module(function, tuple(kind for kind, _ in arguments))
    return _entered(made, arguments, returns, around)


def emitted(made: tuple[Any, str], arguments: Sequence[tuple[Any, str]], returns: str) -> bytes:
    """Return the object file of what `jit.module` has returned; the rest as for `build`."""
    with _alone():
        return _optimized(_entered(made, arguments, returns), _object)


def _entered(
    made: tuple[Any, str],
    arguments: Sequence[tuple[Any, str]],
    returns: str,
    around: Callable[[str], str] | None = None,
) -> Any:
    """Return the module with an `ENTRY`, which alone is seen from outside."""
    module, inner = made
    entry = around(inner) if around else _entry(inner, [text for _, text in arguments], returns)
    module.link_in(llvm.parse_assembly(entry))
    for value in [*module.functions, *module.global_variables]:
        if not value.is_declaration and value.name != ENTRY:
            value.linkage = "internal"
    return module


def _optimized(module: Any, emit: Callable[[Any, Any], Made]) -> Made:
    """Return what is emitted of a module that is optimized for this processor."""
    machine = _machine()
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return emit(machine, module)


def _object(machine: Any, module: Any) -> bytes:
    return machine.emit_object(module)


@contextmanager
def _alone() -> Iterator[None]:
    """Let one thread compile, and leave garbage where it is: looking for it takes a tenth of the time."""
    with lock:
        collecting = gc.isenabled()
        gc.disable()
        try:
            yield
        finally:
            if collecting:
                gc.enable()


def processor() -> str:
    """Return LLVM's name of the processor that code is made for."""
    return os.environ.get("NUMBA_CPU_NAME") or llvm.get_host_cpu_name()


def features() -> str:
    """Return the instructions that code may use, as LLVM writes them.

    The variable alone decides, as it does in numba: the name of a processor does not restrict them.
    """
    given = os.environ.get("NUMBA_CPU_FEATURES")
    return llvm.get_host_cpu_features().flatten() if given is None else given


def many_registers() -> bool:
    """Whether the processor has 32 registers of eight doubles, and not 16 of four or 32 of two."""
    return "+avx512f" in features().split(",")


def load(code: bytes) -> int:
    """Put an object file into this process; return the address of its `ENTRY`."""
    with lock:
        _initialize()
        if hasattr(llvm, "create_mcjit_compiler"):
            engine: Any = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())
            engine.add_object_file(llvm.ObjectFileRef.from_data(code))
            engine.finalize_object()
            _engines.append(engine)
            return engine.get_function_address(ENTRY)
        # LLVM's successor of MCJIT takes ten times as long to begin, and so comes second.
        name = f"{ENTRY} {len(_engines)}"
        engine = llvm.create_lljit_compiler(use_jit_link=False)
        image = llvm.JITLibraryBuilder().add_object_img(code).add_current_process().export_symbol(ENTRY)
        library = image.link(engine, name)
        _engines.append((engine, library))
        return library[ENTRY]


@lru_cache(maxsize=1)
def _initialize() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    # Fields may call pow, tan, ... of the C library, which Python need not have loaded for all to see.
    if llvm.address_of_symbol("pow") is None and (library := ctypes.util.find_library("m")) is not None:
        llvm.load_library_permanently(library)


def _machine() -> Any:
    _initialize()
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=processor(),
        features=features(),
        opt=3,
        reloc="static",
        codemodel="jitdefault",
        jit=True,
    )


def _entry(inner: str, kinds: Sequence[str], returns: str) -> str:
    """Write the C function around numba's own calling convention, which returns through a pointer."""
    vectors = [kind.startswith("<") for kind in kinds]
    # What a pointer points to is not reached by the other arguments: values may stay in registers.
    outer = ", ".join(
        f"{'ptr noalias' if v or kind == 'ptr' else kind} %a{i}"
        for i, (kind, v) in enumerate(zip(kinds, vectors, strict=True))
    )
    loads = "\n".join(
        f"  %v{i} = load {kind}, ptr %a{i}, align 64"
        for i, (kind, v) in enumerate(zip(kinds, vectors, strict=True))
        if v
    )
    values = ", ".join(
        f"{kind} %{'v' if v else 'a'}{i}" for i, (kind, v) in enumerate(zip(kinds, vectors, strict=True))
    )
    slot = "ptr" if returns == "void" else returns
    result = "  ret void" if returns == "void" else f"  %z = load {returns}, ptr %result\n  ret {returns} %z"
    return f"""
declare i32 @"{inner}"(ptr, ptr, {", ".join(kinds)})
define {returns} @{ENTRY}({outer}) {{
  %result = alloca {slot}
  %exception = alloca ptr
{loads}
  %status = call i32 @"{inner}"(ptr %result, ptr %exception, {values})
{result}
}}
"""
