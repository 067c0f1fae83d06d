"""Imports of the server that solves and comparisons are forked from.

A fresh Python takes longer to import what solving and judging need than many a solve takes. Nothing
that starts threads or MPI is imported: FEniCSx is not, only the Python packages that it builds on.
Compiled kernels are loaded, and none is compiled.

The server ends all processes below it when the runner dies: the kernel gives it those that have
lost their parent. Where another process imports this module, it only imports.
"""

import contextlib
import ctypes
import gc
import os
import signal
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import psutil

from verify.processes import PARENT_VARIABLE, die_with_parent

_NEEDED = (
    "numpy.random", "verify.provenance", "verify.runner.solve", "meshio", "reference.exact",
    "verify.runner.judging",
)  # fmt: skip
_IF_THERE = (
    "verify.solvers.xfem", "verify.solvers.methods_adapter", "ufl", "basix.ufl", "ffcx.main",
    "reference.elasticity",
)  # fmt: skip
_PR_SET_CHILD_SUBREAPER = 36


def _serve() -> None:
    """Make this process one that ends with the runner, and all below it with it."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2):
        os.dup2(nowhere, descriptor)
    os.setsid()  # Ctrl-C is for the runner
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    signal.signal(signal.SIGTERM, lambda *_: _end())
    die_with_parent(signal.SIGTERM)


def _end() -> None:
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            process.kill()
    os._exit(0)


def _load() -> None:
    gc.disable()  # imports make objects that live on
    for name in _NEEDED:
        import_module(name)
    for name in _IF_THERE:
        with contextlib.suppress(ImportError):
            import_module(name)
    from verify.result import SolveRecord, adapter_of

    adapter_of(SolveRecord)
    if find_spec("numba") is not None:
        _load_kernels()
    gc.freeze()  # what all share is not touched by their collections
    gc.enable()


class _NotCompiledError(Exception):
    """A kernel is not in the cache; who needs it compiles it."""


def _load_kernels() -> None:
    from numba.core import event

    from verify.first_use import STAGES

    class CompilingNothing(event.Listener):
        def on_start(self, event_: Any) -> None:
            raise _NotCompiledError

        def on_end(self, event_: Any) -> None:
            pass

    with event.install_listener("numba:compile", CompilingNothing()):
        for stage in (call for name, call in STAGES.items() if "scalpel" not in name):
            with contextlib.suppress(_NotCompiledError):
                stage()


if os.environ.get(PARENT_VARIABLE) == str(os.getppid()):
    _serve()
_load()
