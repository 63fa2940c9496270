"""How wide the processor's arithmetic is and how fast its clock runs, measured by two small loops.

AVX-512 says how many numbers an instruction takes, not how many the processor works on
at once: AMD's Zen 4 takes 512 bits in two halves, Zen 5's servers take them whole. The
throughput of fused multiply-adds of 512 bits against those of 256 bits tells. No table of
processors does: archspec 0.2.7 lists instructions, not how they are executed, and on a virtual
machine that hides some of them it says "zen2" of a Zen 3, which LLVM calls znver3.
"""

import ctypes
from functools import lru_cache
from time import perf_counter
from typing import Any

import llvmlite.binding as llvm

from integrators.kernel.native import machine

CHAINS = 12  # independent sums: more than latency times throughput, fewer than there are registers
LINKS = 32  # dependent operations in one turn of the chain's loop
TURNS = 20_000
ROUNDS = 9
WHOLE = 1.5  # a wide instruction that takes less than so many narrow ones is taken whole


@lru_cache(maxsize=1)
def measured() -> dict[str, str | int]:
    """Return what was measured: ``vector_bits``, the width of the arithmetic, and ``clock_ghz``, as text.

    The fastest of some interleaved rounds, since what else the machine does only adds to a
    time; it takes some 20 ms.
    """
    widest = _widest()
    wide, narrow, chain = (_compiled(text) for text in (_sums(widest // 64), _sums(widest // 128), _chain()))
    rounds = [[_time(function) for function in (wide, narrow, chain)] for _ in range(ROUNDS)]
    of_wide, of_narrow, of_chain = (min(each) for each in zip(*rounds, strict=True))
    return {
        "vector_bits": widest if of_wide < WHOLE * of_narrow else widest // 2,
        "clock_ghz": f"{LINKS * TURNS / of_chain * 1e-9:.1f}",
    }


def _widest() -> int:
    has = llvm.get_host_cpu_features()
    return 512 if has.get("avx512f") else 256 if has.get("fma") else 128


def _time(function: Any) -> float:
    room = (ctypes.c_double * 16)()
    start = perf_counter()
    function(TURNS, ctypes.addressof(room))
    return perf_counter() - start


def _compiled(text: str) -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2, jit=True
    )
    address = machine.load(target.emit_object(llvm.parse_assembly(text)))
    return ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64)(address)


def _loop(kind: str, start: str, body: str, lasts: list[str]) -> str:
    """Return a function that carries values through a loop and stores the last of each."""
    phis = "\n".join(
        f"  %x{i} = phi {kind} [ {start}, %entry ], [ {last}, %loop ]" for i, last in enumerate(lasts)
    )
    stores = "\n".join(f"  store {kind} {last}, ptr %out, align 8" for last in lasts)
    return f"""
define void @{machine.ENTRY}(i64 %turns, ptr %out) {{
entry:
  %a = load volatile {kind}, ptr %out, align 8
  %b = load volatile {kind}, ptr %out, align 8
  br label %loop
loop:
  %i = phi i64 [ 0, %entry ], [ %next, %loop ]
{phis}
{body}
  %next = add i64 %i, 1
  %more = icmp slt i64 %next, %turns
  br i1 %more, label %loop, label %done
done:
{stores.replace("store", "store volatile")}
  ret void
}}"""


def _sums(lanes: int) -> str:
    kind = f"<{lanes} x double>"
    fma = f"@llvm.fma.v{lanes}f64"
    lines = [f"  %y{i} = call {kind} {fma}({kind} %x{i}, {kind} %a, {kind} %b)" for i in range(CHAINS)]
    lasts = [f"%y{i}" for i in range(CHAINS)]
    return f"declare {kind} {fma}({kind}, {kind}, {kind})" + _loop(
        kind, "zeroinitializer", "\n".join(lines), lasts
    )


def _chain() -> str:
    """Return a chain of additions and exclusive ors, each a clock's tick after the one before."""
    lines, last = [], "%x0"
    for i in range(0, LINKS, 2):
        lines += [f"  %y{i} = add i64 {last}, %a", f"  %y{i + 1} = xor i64 %y{i}, %b"]
        last = f"%y{i + 1}"
    return _loop("i64", "0", "\n".join(lines), [last])
