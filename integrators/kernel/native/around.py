"""Compiled functions around a system's field: lowered once for each form of theirs, linked with each field.

To lower one takes numba a quarter of a second. What comes out of it calls the field by an address; its text
is kept, and is made machine code together with a field. The address is a constant then, and the field is
compiled into the function.
"""

import re
from collections.abc import Sequence
from functools import partial
from importlib import import_module
from typing import Any

import llvmlite

from integrators.kernel.native import binary, machine, shipped, stages, store
from integrators.kernel.native.engine import KERNEL
from integrators.kernel.native.field import BUILT_BY
from integrators.kernel.native.stages import ON_LANES
from problems import targets
from problems.systems.base import System


class Around:
    """A compiled function whose first argument is the address of a field, ``void(t, stages, par, values)``.

    Parameters
    ----------
    module : str
        Of the kernel, where it is made.
    maker : str
        Name of what returns it, given a form.
    arguments : str
        Names of the integers that it takes besides the field. Where the first one is ``constants``, it is the
        address of numbers that are known when it is linked.
    """

    def __init__(self, module: str, maker: str, arguments: str):
        self._module, self._maker, self._arguments = f"{KERNEL}.{module}", maker, arguments.split()

    def code(
        self, system: System, quantity: targets.Quantity, lanes: int, form: tuple[Any, ...],
        *, constants: Sequence[int] = (), par: bool = False, unrolled: bool = False,
    ) -> binary.Native:  # fmt: skip
        """Return the machine code of ``void(arguments)`` with one of a system's functions in it.

        Parameters
        ----------
        system, quantity, lanes
            As for `integrators.kernel.native.field.compile_field`.
        form : tuple
            Arguments of the maker.
        constants : sequence of int
            What lies at the address of that name.
        par : bool
            Whether parameters differ from lane to lane.
        unrolled : bool
            Whether the function's loops over numbers, all of constant length, are unrolled with the field.

        Raises
        ------
        numba.NumbaError
            If the function cannot be compiled on lanes.
        """
        source = targets.source(system, quantity, "numba")
        name = store.key(
            "around", source.text, str(lanes), self.key(form), str(list(constants)), binary.sources(BUILT_BY)
        )

        def make() -> tuple[str, bytes]:
            function, arguments = stages.on_lanes(targets.numba(system, quantity).py_func, lanes, par=par)
            text = self.text(form)
            linked = partial(
                self._linked,
                [kind for _, kind in arguments],
                unrolling(text) if unrolled else text,
                constants,
            )
            return ON_LANES, binary.build(function, arguments, around=linked)

        return binary.obtain(name, make)

    def _linked(self, kinds: list[str], text: str, constants: Sequence[int], inner: str) -> str:
        """Return LLVM's text of an `ENTRY` that calls the function of ``text`` with the field ``inner``."""
        given = self._arguments[1:] if constants else self._arguments
        arguments = ", ".join(f"i64 %{name}" for name in given)
        known = ["field", "constants"] if constants else ["field"]
        addresses = ", ".join(f"i64 ptrtoint (ptr @{name} to i64)" for name in known)
        numbers = ", ".join(f"i64 {number}" for number in constants)
        # Within the function whose stack is aligned, however long it is
        inlined = re.sub(r"(?m)^(define .*\) (?:local_)?unnamed_addr)", r"\1 alwaysinline", text)
        return f"""{inlined.replace(f"@{machine.ENTRY}(", "@around(")}
@constants = private constant [{len(constants)} x i64] [{numbers}]
{machine.entry(inner, kinds, "void", "field")}
define void @{machine.ENTRY}({arguments}) alignstack(64) "stackrealign" {{
  call void @around({addresses}, {arguments})
  ret void
}}
"""

    def key(self, form: tuple[Any, ...]) -> str:
        """Return the name of a form's text, from all that it depends on."""
        sources = binary.sources(self._module)
        return store.key("lowered around", self._module, self._maker, repr(form), sources)

    def text(self, form: tuple[Any, ...]) -> str:
        """Return LLVM's text of a form: from the store, from what lies beside the package, or lowered now."""
        key = self.key(form)
        name = store.key(key, llvmlite.__version__)
        if (kept := store.get(name)) is not None:
            return kept.decode("ascii")
        text = shipped.text(key) or self.lower(form)
        store.put(name, text.encode("ascii"))
        return text

    def lower(self, form: tuple[Any, ...]) -> str:
        """Return the same, lowered by numba."""
        from numba import types

        function = getattr(import_module(self._module), self._maker)(*form)
        return binary.lower(function, [(types.int64, "i64")] * (1 + len(self._arguments)))


def unrolling(text: str) -> str:
    """Return LLVM's text with its loops marked to be unrolled, but for those that end by a test of lanes.

    A loop over numbers ends by a comparison of integers, or by what LLVM makes of it where it is run twice.
    """
    ends = set(re.findall(r"(?m)^  (%\S+) = (?:icmp [a-z ]+ i64 |phi i1 )", text))
    first = 1 + max(int(number) for number in re.findall(r"(?m)^!(\d+) =", text))
    marks: list[str] = []

    def marked(branch: re.Match[str]) -> str:
        if branch[1] not in ends:
            return branch[0]
        marks.append(f"!{first + 1 + len(marks)}")
        return f"{branch[0]}, !llvm.loop {marks[-1]}"

    text = re.sub(r"(?m)^  br i1 (%\S+), .*$", marked, text)
    nodes = "".join(f"{mark} = distinct !{{{mark}, !{first}}}\n" for mark in marks)
    return f'{text}\n!{first} = !{{!"llvm.loop.unroll.full"}}\n{nodes}'
