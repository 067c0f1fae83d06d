"""`kernel` compiles what Python calls, `inner` what only kernels call.

numba makes of every function machine code, a wrapper for callers in Python and one in C, and
optimises it again in each kernel that calls it. An `inner` function is translated only; the kernel
that it is linked into optimises it once and makes its machine code. See docs/install.md for what
that saves.
"""

from collections.abc import Callable
from typing import Any

import numba
from numba.core.registry import CPUDispatcher

__all__ = ["inner", "kernel"]

# The classes that `verify.compiled.library` derives from are numba's own affair (0.61 has not all
# of them): of other versions the plain decorator is taken, which gives the same numbers later.
_TRIED = numba.version_info[:2] == (0, 68)
if _TRIED:
    from verify.compiled.library import (
        KernelCompiler,
        PartCompiler,
        StagedKernelCompiler,
        StagedPartCompiler,
    )


class _Inner(CPUDispatcher):
    """A compiled function without a door for Python, which gets the source."""

    def __call__(self, *arguments: Any) -> Any:
        return self.py_func(*arguments)


def kernel(
    function: Callable[..., Any] | None = None, *, staged: bool = False, **options: Any
) -> Any:
    """Compile a function that Python calls, at its first call, and keep it on disk.

    Parameters
    ----------
    function : callable, optional
        Left out where options are given: ``@kernel(error_model="numpy")``.
    staged : bool
        Optimise what is called before it is linked, and the whole again, as numba does: loops over
        lanes run a quarter faster, and take twice as long to compile.
    **options
        As of `numba.njit`.
    """
    if function is None:
        return lambda wrapped: kernel(wrapped, staged=staged, **options)
    if not _TRIED:
        return numba.njit(cache=True, **options)(function)
    compiler = StagedKernelCompiler if staged else KernelCompiler
    options = {"cache": True, "no_cfunc_wrapper": True, "pipeline_class": compiler, **options}
    return numba.njit(**options)(function)


def inner(
    function: Callable[..., Any] | None = None, *, staged: bool = False, **options: Any
) -> Any:
    """Compile a function that only kernels call; from Python it runs uncompiled.

    Parameters
    ----------
    function : callable, optional
        Left out where options are given.
    staged : bool
        As for `kernel`.
    **options
        As of `numba.njit`.
    """
    if function is None:
        return lambda wrapped: inner(wrapped, staged=staged, **options)
    if not _TRIED:
        return numba.njit(cache=True, **options)(function)
    options = {
        "nopython": True,
        "boundscheck": None,
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
        **options,
    }
    compiler = StagedPartCompiler if staged else PartCompiler
    dispatcher = _Inner(function, targetoptions=options, pipeline_class=compiler)
    dispatcher.enable_caching()
    return dispatcher
