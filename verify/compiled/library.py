"""What numba compiles into: parts that are translated only, and kernels that are optimised once.

numba runs LLVM's optimiser over a function, again over all that it calls, and so on up to what
Python calls, and makes machine code at each level. Only the last of these is ever run. Here a
`Part` stays as it was translated; the `Kernel` it is linked into goes through LLVM once, after the
same passes in the same order as numba's own (values out of memory, loops rotated, references
counted less, then all of the full level).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm
from numba.core import codegen
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.targetconfig import ConfigStack

from verify.compiled.typing_memory import remembered_types

__all__ = [
    "Kernel",
    "KernelCompiler",
    "Part",
    "PartCompiler",
    "StagedKernelCompiler",
    "StagedPart",
    "StagedPartCompiler",
]


def _plain_builder(generator: Any) -> Any:
    return generator._pass_builder(opt=0, loop_vectorize=False, slp_vectorize=False)


class _Unoptimised(JITCodeLibrary):
    def _optimize_functions(self, ll_module: Any) -> None:
        """Leave functions as they are: all are optimised when the kernel is complete."""
        ll_module.data_layout = self._codegen._data_layout


class Kernel(_Unoptimised):
    """Machine code of a function that Python calls, with all that it calls."""

    def _optimize_final_module(self) -> None:
        passes = llvm.create_new_module_pass_manager()
        passes.add_sroa_pass()
        passes.add_simplify_cfg_pass()
        passes.add_loop_rotate_pass()
        passes.add_instruction_combine_pass()
        passes.add_jump_threading_pass()
        passes.add_refprune_pass(codegen._parse_refprune_flags())
        passes.run(self._final_module, _plain_builder(self._codegen))
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


class _WithoutEnvironment:
    """The code generator, for what has no machine code in which an address could be set."""

    def __init__(self, generator: Any) -> None:
        self._generator = generator

    def __getattr__(self, name: str) -> Any:
        return getattr(self._generator, name)

    def set_env(self, env_name: str, env: Any) -> None:
        """Set nothing."""


class Part(_Unoptimised):
    """A translated function, to be linked into kernels; it has no address."""

    @property
    def codegen(self) -> Any:
        """The code generator."""
        return _WithoutEnvironment(self._codegen)

    def _optimize_final_module(self) -> None:
        passes = llvm.create_new_module_pass_manager()
        passes.add_sroa_pass()
        passes.add_simplify_cfg_pass()
        passes.add_dead_code_elimination_pass()
        passes.add_global_dead_code_eliminate_pass()
        passes.run(self._final_module, _plain_builder(self._codegen))

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: no such symbol."""
        return 0

    def serialize_using_object_code(self) -> Any:
        """Return what `CPUCodeLibrary._unserialize` understands."""
        return self.serialize_using_bitcode()


class StagedPart(Part):
    """A part that is optimised before it is linked, as numba does it."""

    _optimize_functions = JITCodeLibrary._optimize_functions
    _optimize_final_module = JITCodeLibrary._optimize_final_module


@contextmanager
def _parts_below(generator: Any) -> Iterator[None]:
    """Let numba's own functions (np.empty, slices), and parts found on disk, be parts too."""
    if "create_library" in vars(generator):  # an outer compilation does it
        yield
        return
    create, restore = generator.create_library, generator.unserialize_library

    def create_library(name: str, **options: Any) -> Any:
        flags = ConfigStack.top_or_none()
        if flags is not None and flags.no_cpython_wrapper:
            return Part(generator, name, **options)
        return create(name, **options)

    def unserialize_library(state: Any) -> Any:
        name, kind, content = state
        if kind != "bitcode":
            return restore(state)
        part = Part(generator, name)
        part._final_module = llvm.parse_bitcode(content)
        part._finalize_final_module()
        return part

    generator.create_library, generator.unserialize_library = create_library, unserialize_library
    try:
        yield
    finally:
        del generator.create_library, generator.unserialize_library


class KernelCompiler(Compiler):
    """numba's compiler, into a `Kernel`.

    It runs under numba's lock, so that what it sets for its time no other compilation sees.
    """

    library: type[JITCodeLibrary] = Kernel

    def _compile_core(self) -> Any:
        state = self.state
        generator = state.targetctx.codegen()
        state.library = self.library(generator, state.func_id.func_qualname)
        state.library.enable_object_caching()
        with _parts_below(generator), remembered_types(state.typingctx):
            return super()._compile_core()


class PartCompiler(KernelCompiler):
    """numba's compiler, into a `Part`."""

    library = Part


class StagedKernelCompiler(KernelCompiler):
    """numba's compiler, with its own order of optimisation."""

    library = JITCodeLibrary


class StagedPartCompiler(KernelCompiler):
    """numba's compiler, into a `StagedPart`."""

    library = StagedPart
