"""Compiled functions around a system's field: lowered once for each form of theirs, linked with each field.

To lower one takes numba a quarter of a second. What comes out of it calls the field by an address; its text
is kept, and is made machine code together with a field. The address is a constant then, and the field is
compiled into the function.
"""

from functools import partial
from importlib import import_module
from typing import Any

import llvmlite

from integrators.kernel.native import binary, lowered, machine, stages, store
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
        Names of the integers that it takes besides the field.
    """

    def __init__(self, module: str, maker: str, arguments: str):
        self._module, self._maker, self._arguments = f"{KERNEL}.{module}", maker, arguments.split()

    def code(
        self, system: System, quantity: targets.Quantity, lanes: int, form: tuple[Any, ...]
    ) -> binary.Native:
        """Return the machine code of ``void(arguments)`` with one of a system's functions in it.

        Parameters
        ----------
        system, quantity, lanes
            As for `integrators.kernel.native.field.compile_field`.
        form : tuple
            Arguments of the maker.

        Raises
        ------
        numba.NumbaError
            If the function cannot be compiled on lanes.
        """
        source = targets.source(system, quantity, "numba")
        name = store.key("around", source.text, str(lanes), self.key(form), binary.sources(BUILT_BY))

        def make() -> tuple[str, bytes]:
            function, arguments = stages.on_lanes(targets.numba(system, quantity).py_func, lanes)
            linked = partial(self._linked, [kind for _, kind in arguments], self.text(form))
            return ON_LANES, binary.build(function, arguments, around=linked)

        return binary.obtain(name, make)

    def _linked(self, kinds: list[str], text: str, inner: str) -> str:
        """Return LLVM's text of an `ENTRY` that calls the function of ``text`` with the field ``inner``."""
        arguments = ", ".join(f"i64 %a{i}" for i in range(len(self._arguments)))
        return f"""{text.replace(f"@{machine.ENTRY}(", "@around(")}
{machine.entry(inner, kinds, "void", "field")}
define void @{machine.ENTRY}({arguments}) alignstack(64) "stackrealign" {{
  call void @around(i64 ptrtoint (ptr @field to i64), {arguments})
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
        text = lowered.get(key) or self.lower(form)
        store.put(name, text.encode("ascii"))
        return text

    def lower(self, form: tuple[Any, ...]) -> str:
        """Return the same, lowered by numba."""
        from numba import types

        function = getattr(import_module(self._module), self._maker)(*form)
        return binary.lower(function, [(types.int64, "i64")] * (1 + len(self._arguments)))
