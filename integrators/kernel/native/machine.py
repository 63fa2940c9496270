"""LLVM's text made machine code of this processor, and loaded; numba is not needed."""

import ctypes.util
import gc
import logging  # noqa: F401 -- its lock must be taken after ours at a fork: whoever compiles may log
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import llvmlite.binding as llvm

ENTRY = "hbvm_entry"

LEVELS: dict[str, dict[str, frozenset[str]]] = {
    "x86_64": {
        "x86-64-v4": frozenset({"avx2", "avx512bw", "avx512cd", "avx512dq", "avx512f", "avx512vl", "fma"}),
        "x86-64-v3": frozenset({"avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"}),
    },
    "aarch64": {"generic": frozenset()},
    "arm64": {"generic": frozenset()},
}
"""Processors that code is shipped for, the best ones first: LLVM's names, and the features that tell them."""

lock = threading.RLock()
"""Held while code is compiled or loaded, and during a fork, which waits for that: LLVM's and numba's own
locks would stay locked for ever in the child, where the thread that holds them does not exist."""
if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=lock.acquire, after_in_parent=lock.release, after_in_child=lock.release)
_engines: list[Any] = []  # an engine owns its code: none may be collected


def emitted(lowered: tuple[Any, str], arguments: Sequence[tuple[Any, str]], returns: str) -> bytes:
    """Return the object file of what `jit.module` has returned; the rest as for `build`."""
    with alone():
        return optimized(entered(lowered, arguments, returns))


def entered(
    lowered: tuple[Any, str],
    arguments: Sequence[tuple[Any, str]],
    returns: str,
    around: Callable[[str], str] | None = None,
) -> Any:
    """Return the module with an `ENTRY`, which alone is seen from outside."""
    module, inner = lowered
    text = around(inner) if around else entry(inner, [text for _, text in arguments], returns)
    module.link_in(llvm.parse_assembly(text))
    for value in [*module.functions, *module.global_variables]:
        if not value.is_declaration and value.name != ENTRY:
            value.linkage = "internal"
    return module


def optimized(module: Any, level: str | None = None) -> bytes:
    """Optimize a module for this processor, or for one of `LEVELS`, and return its object file."""
    machine = target_machine(level)
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


def simplified(module: Any) -> Any:
    """Return a module after the passes that depend on no processor; none of them changes a number.

    Vectors and unrolled loops are left to `optimized`, which knows the processor.
    """
    _initialize()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = False
    builder = llvm.create_pass_builder(target.create_target_machine(cpu="generic", opt=2), options)
    builder.getModulePassManager().run(module, builder)
    return module


@contextmanager
def alone() -> Iterator[None]:
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


def levels() -> list[str]:
    """Return the names in `LEVELS` of this kind of processor; none where none is shipped."""
    return list(LEVELS.get(llvm.get_process_triple().split("-")[0], {}))


def level() -> str | None:
    """Return the best one of `levels` whose instructions code may use."""
    allowed = {feature[1:] for feature in features().split(",") if feature.startswith("+")}
    needed = LEVELS.get(llvm.get_process_triple().split("-")[0], {})
    return next((name for name, all_of in needed.items() if all_of <= allowed), None)


def many_registers() -> bool:
    """Whether the processor has 32 registers of eight doubles, and not 16 of four or 32 of two."""
    return "+avx512f" in features().split(",")


def load(code: bytes) -> int:
    """Put an object file into this process; return the address of its `ENTRY`."""
    with lock:
        _initialize()
        if hasattr(llvm, "create_mcjit_compiler"):
            engine: Any = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
            engine.add_object_file(llvm.ObjectFileRef.from_data(code))
            engine.finalize_object()
            _engines.append(engine)
            return engine.get_function_address(ENTRY)
        # LLVM's successor of MCJIT comes second: the tests of the recorded bits run with MCJIT.
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


def target_machine(level: str | None = None) -> Any:
    """Return LLVM's description of this processor, or of one of `LEVELS`, for which code is optimized."""
    _initialize()
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=level or processor(),
        features="" if level else features(),
        opt=3,
        codemodel="jitdefault",
        jit=True,
    )


def entry(inner: str, kinds: Sequence[str], returns: str, name: str = ENTRY) -> str:
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
define {returns} @{name}({outer}) {{
  %result = alloca {slot}
  %exception = alloca ptr
{loads}
  %status = call i32 @"{inner}"(ptr %result, ptr %exception, {values})
{result}
}}
"""
