"""The machine in words that say what matters for a timing and nothing about whose it is."""

import os
import platform
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import psutil

from problems.errors import InputError

VENDORS = {"AuthenticAMD": "AMD", "GenuineIntel": "Intel"}
VECTORS = (("avx512f", "AVX-512"), ("avx2", "AVX2"), ("avx", "AVX"), ("sse2", "SSE2"), ("neon", "NEON"))

MEASURED = ("vector_bits", "clock_ghz")
"""What `describe` measures: it may differ from one look at a processor to the next."""

# What `words` say, for under a table; then what the option --avx2 does.
COLUMNS = (
    "Restricted to AVX2: all that numba compiles (HBVM, Gauss, the forces and right-hand sides handed to "
    "REBOUND and SciPy) without AVX-512."
)
AVX2 = (
    "Without AVX-512 in all that numba compiles: HBVM, Gauss, and the forces and right-hand sides handed to "
    "REBOUND and SciPy."
)
BINDS = hasattr(psutil.Process, "cpu_affinity")  # to cores: Linux and Windows do
FEATURES, NAME = "NUMBA_CPU_FEATURES", "NUMBA_CPU_NAME"


def describe(*, measure: bool = False) -> dict[str, str | int]:
    """Return processor, cores, memory, instruction sets, operating system and Python.

    With ``measure`` also the width of the arithmetic and the clock (some 50 ms), to be printed beside times.
    """
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    described: dict[str, str | int] = {
        "processor": _processor(),
        **_family(),
        "llvm_processor": binding.get_host_cpu_name(),
        "cores": len(cores()),
        "memory_gib": round(psutil.virtual_memory().total / 2**30),
        "vector_instructions": next((name for flag, name in VECTORS if features.get(flag)), "none known"),
        "system": f"{platform.system()} {platform.machine()}",
        "python": f"{platform.python_implementation()} {platform.python_version()}",
    }
    if os.environ.get(NAME) or FEATURES in os.environ:
        without = "-avx512f" in os.environ.get(FEATURES, "").split(",")
        described["ours_built_for"] = "AVX2" if without else os.environ.get(NAME) or "other instructions"
    if measure:
        from hbvm_bench.measure import processor

        described |= processor.measured()
    return described


def same(a: Mapping[str, str | int], b: Mapping[str, str | int]) -> bool:
    """Whether two descriptions are of one machine: equal in what both say and neither measured."""
    restricted = a.get("ours_built_for") == b.get("ours_built_for")
    return restricted and all(a[name] == b[name] for name in a.keys() & b.keys() if name not in MEASURED)


def kind(described: Mapping[str, str | int]) -> str:
    """Return the kind of processor in one word, for file names and columns.

    ``znver4-256bit``: LLVM's name and how wide the arithmetic is, where that was measured, for
    it differs among processors of one name; ``znver4-256bit-avx2`` with code restricted to AVX2.
    """
    bits, built = described.get("vector_bits"), described.get("ours_built_for")
    words = [str(described.get("llvm_processor", "unknown"))]
    words += [f"{bits}bit"] if bits else []
    words += [str(built).lower()] if built else []
    return "-".join(words).replace(" ", "-").replace("/", "-")


def sentence(described: Mapping[str, str | int]) -> str:
    """Say what kind of processor times and their ratios belong to."""
    known = (("family", "{}"), ("llvm_processor", "LLVM: {}"))
    names = [words.format(described[key]) for key, words in known if key in described]
    bits, clock = described.get("vector_bits"), described.get("clock_ghz")
    width = f"{bits}-bit vector arithmetic" if bits else "width of the arithmetic not recorded"
    restricted = (
        "; all that numba compiles (HBVM, Gauss, and the forces and right-hand sides handed to REBOUND "
        f"and SciPy) was restricted to {described.get('ours_built_for')}, "
        "the code of the other libraries was not"
    )
    return (
        f"Measured on {described.get('processor', 'unknown')}"
        + (f" ({'; '.join(names)})" if names else "")
        + f", {described.get('vector_instructions', 'vector instructions not recorded')}, {width}"
        + (f", {clock} GHz" if clock else "")
        + restricted * bool(described.get("ours_built_for"))
        + "; ratios differ on other processors."
    )


def words(kind: str) -> str:
    """Return a `kind` of processor for readers: ``"Zen 5, 512-bit, restricted to AVX2"``."""
    name, *more = kind.split("-")
    said = {"avx2": "restricted to AVX2", "512bit": "512-bit", "256bit": "256-bit"}
    processor = name.replace("znver", "Zen ").replace("rocketlake", "Rocket Lake")
    return ", ".join([processor, *(said.get(word, word) for word in more)])


def sentences(described: Iterable[Mapping[str, str | int]]) -> list[str]:
    """Say what kinds of processor times belong to, each once, with the range of its clock's readings."""
    kinds: dict[str, list[Mapping[str, str | int]]] = {}
    for machine_ in described:
        kinds.setdefault(sentence({**machine_, "clock_ghz": ""}), []).append(machine_)
    said = []
    for alike in kinds.values():
        clocks = sorted(
            {str(machine_["clock_ghz"]) for machine_ in alike if "clock_ghz" in machine_}, key=float
        )
        ends = dict.fromkeys((*clocks[:1], *clocks[-1:]))
        said.append(sentence({**alike[0], "clock_ghz": " to ".join(ends)}))
    return said


def restricted_to_avx2() -> dict[str, str]:
    """Return the environment in which numba compiles without AVX-512.

    Libraries with compilers of their own (heyoka, JAX) or compiled code (REBOUND, SciPy) do not
    look at it. Only a process that starts with it is restricted.

    Raises
    ------
    problems.errors.InputError
        If the processor has no AVX2.
    """
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    if not features.get("avx2"):
        raise InputError(f"this processor ({_processor()}) has no AVX2; leave --avx2 out.")
    kept = {name: on and not name.startswith(("avx512", "avx10")) for name, on in features.items()}
    # LLVM's name of the processor alone would bring AVX-512 back
    kept["avx512f"] = False
    return {FEATURES: ",".join(f"{'+' if on else '-'}{name}" for name, on in sorted(kept.items()))}


def cores() -> list[int]:
    """Return the numbers of the cores this process may use; all, where the system binds none (macOS)."""
    process = psutil.Process()
    if BINDS:
        return sorted(process.cpu_affinity() or [])
    return list(range(os.cpu_count() or 1))


def bind(numbers: Iterable[int]) -> None:
    """Keep this process on some cores, where the system does that."""
    if BINDS:
        psutil.Process().cpu_affinity(list(numbers))


@contextmanager
def leaving_a_core() -> Iterator[int | None]:
    """Keep this process off the core that is yielded, for another one to be timed there.

    Where there is only one core this process cannot leave it.
    """
    mine = cores()
    core = max(mine, default=None)
    others = set(mine) - {core}
    if others:
        bind(others)
    try:
        yield core
    finally:
        bind(mine)


@contextmanager
def staying_on_a_core() -> Iterator[None]:
    """Keep this process on one core, the last one it may use."""
    mine = cores()
    bind(mine[-1:])
    try:
        yield
    finally:
        bind(mine)


def flags() -> set[str]:
    """Return what the processor says that it can do, in the words of ``/proc/cpuinfo``."""
    return set(_cpu().get("flags", "").split())


@cache  # every record describes the machine, and of many cores the file is long
def _cpu() -> dict[str, str]:
    """Return what the system says of the first core."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return {}
    lines = (line.partition(":") for line in text.partition("\n\n")[0].splitlines())
    return {name.strip(): value.strip() for name, _, value in lines}


def _family() -> dict[str, str]:
    """Return what x86-64 calls family and model; nothing of others, or where the system does not tell."""
    vendor, family, model = (_cpu().get(name) for name in ("vendor_id", "cpu family", "model"))
    if vendor is None:
        return {}
    return {"family": f"{VENDORS.get(vendor, vendor)} family {family}, model {model}"}


def _processor() -> str:
    return _cpu().get("model name") or platform.processor() or "unknown processor"
