"""The kernel's functions compiled by private parts of numba: lowered one by one, linked and optimized once.

numba makes each function ready to be called: it links everything that the function calls
into it, optimizes that, and makes machine code of it; for a hundred functions that call
each other this takes half a minute. Here a target of its own (numba's target extension)
keeps of each function nothing but what it was lowered to, and `module` links those
that an entry needs; `integrators.kernel.native.binary` does the rest once.

No other file imports what numba does not promise to keep. Where a name below is gone, or does something else,
`integrators.kernel.native.public` takes over for all of them.
"""

from collections.abc import Iterable
from functools import cache, cached_property
from typing import Any, cast

import llvmlite.binding as llvm
from numba.core import (
    codegen,  # the library of a function, which here is neither optimized nor linked
    cpu,  # how types and operations are lowered for a processor
    registry,  # the target of processors and its decorator, to derive ours from
    typed_passes,  # passes of the compiler, of which ours has the few that plain functions need
    untyped_passes,
)
from numba.core.compiler import Compiler, CompilerBase  # numba's list of passes, and what a list derives from
from numba.core.compiler_machinery import PassManager  # such a list
from numba.core.target_extension import (  # what tells numba of a target: its name, decorators, processor
    CPU,
    dispatcher_registry,
    jit_registry,
    target_override,
    target_registry,
)
from numba.core.typing import mathdecl  # types of the functions of `math`
from numba.core.typing.context import Context  # types of all else, without NumPy's
from numba.core.typing.templates import AttributeTemplate  # types of attributes, asked for by name
from numba.extending import infer_getattr, lower_getattr_generic

NAME = "hbvm kernel"
OPTIONS = {
    "nopython": True,
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "boundscheck": False,
    "_nrt": False,  # no reference counts: machine code that needs nothing of numba once it is compiled
}


class _Library(codegen.JITCodeLibrary):
    """What one function was lowered to."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0  # nothing is called in this process


class _Codegen(codegen.JITCPUCodegen):
    _library_class = _Library

    def set_env(self, env_name: str, env: Any) -> None:
        """Environments are for functions that raise."""


class _Processor(CPU):
    """The processor, once more."""


class _Types(Context):
    """What numba knows of types, without NumPy's: each `+` would be looked up among the ufuncs too."""

    def load_additional_registries(self) -> None:
        self.install_registry(mathdecl.registry)


class _Target(registry.CPUTarget):
    _context: Any = None

    @property
    def target_context(self) -> Any:
        if self._context is None:
            self._context = cpu.CPUContext(self.typing_context, self._target_name)
            self._context._internal_codegen = _Codegen(NAME)
        return self._context

    @cached_property
    def _types(self) -> _Types:
        return _Types()

    @property
    def typing_context(self) -> Any:
        return self._types


class _Passes(CompilerBase):
    """What of numba's passes plain functions need: no closures, no array expressions, no object mode."""

    def define_pipelines(self) -> list[PassManager]:
        passes = PassManager(NAME)
        for pass_ in (
            untyped_passes.TranslateByteCode,
            untyped_passes.FixupArgs,
            untyped_passes.IRProcessing,
            untyped_passes.ReconstructSSA,
            typed_passes.NopythonTypeInference,
            typed_passes.PreLowerStripPhis,
            typed_passes.NativeLowering,
            typed_passes.NoPythonBackend,
        ):
            passes.add_pass(pass_, pass_.__name__)
        passes.finalize()
        return [passes]


class _Function(registry.CPUDispatcher):
    """A function that is compiled when another one or an entry needs it."""

    targetdescr = cast(Any, _Target(NAME))

    def compile(self, sig: Any) -> Any:
        with target_override(NAME):
            return super().compile(sig)


def compiled(function: Any, passes: type[CompilerBase] = _Passes) -> Any:
    """Decorate a function of the kernel: numba code that allocates nothing and raises nothing."""
    return _Function(function, locals={}, targetoptions=OPTIONS, pipeline_class=passes)


def _jit(*functions: Any, **options: Any) -> Any:
    """Compile numba's own helpers for this target too."""
    return compiled(functions[0], Compiler) if functions else _jit


target_registry[NAME] = _Processor
dispatcher_registry[_Processor] = _Function
jit_registry[_Processor] = _jit


@cache
def _attributes(kind: Any, kind_of: Any, read: Any) -> None:
    class Attributes(AttributeTemplate):
        key = kind

        def generic_resolve(self, value: Any, name: str) -> Any:
            return kind_of(value, name)

    infer_getattr(Attributes)
    lower_getattr_generic(kind)(read)


def attributes(kind: Any, names: Iterable[str], kind_of: Any, read: Any) -> None:
    """Give values attributes in compiled code; see `integrators.kernel.native.jit`."""
    _attributes(kind, kind_of, read)  # numba asks for any name


def module(function: Any, kinds: tuple[Any, ...]) -> tuple[Any, str]:
    """Compile a `compiled` function; return a module of it and all that it calls, and its name there.

    Raises
    ------
    numba.NumbaError
        If it cannot be compiled for these types.
    """
    function.compile(kinds)
    overload = function.overloads[kinds]
    libraries = [overload.library]
    for library in libraries:
        libraries += [library_ for library_ in library._linking_libraries if library_ not in libraries]
    first, *rest = [library._final_module.clone() for library in libraries]
    for other in rest:
        for value in other.functions:
            if not value.is_declaration and value.linkage == llvm.Linkage.external:
                value.linkage = "linkonce_odr"  # several may bring the same helper
        first.link_in(other)
    return first, overload.fndesc.llvm_func_name
