"""A process from which others are forked: ``python -m verify.runner.warm_parent SOCKET KIND``.

A fresh Python takes longer to import what solving and judging need than many a solve takes. What is
forked here begins as a fresh one would, with an environment, a working directory and a log of its
own. Nothing that starts threads or MPI is imported before the fork: FEniCSx is not, only the Python
packages that it builds on. While nothing is asked, it loads the compiled kernels; it compiles none.

Between both there is a keeper. The kernel makes it the parent of whatever that process starts and
leaves behind, so that all of it is found and ended with it.
"""

import atexit
import contextlib
import ctypes
import gc
import itertools
import json
import os
import random
import select
import signal
import socket
import sys
from collections.abc import Iterable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from verify.runner.child import descendants
from verify.runner.childhood import die_with_parent
from verify.warm import DRAWING, LONGEST_REQUEST, PARENT_VARIABLE

# by what is asked for, in the order in which a run asks; each needs the modules before it too
_NEEDED = {
    "verify.runner.survey": ("verify.runner.survey", "verify.solvers.xfem"),
    "verify.runner.solve": (
        "numpy.random", "verify.calibration", "verify.runner.solve", "meshio", "reference.exact",
    ),
    "verify.runner.assess": ("verify.runner.assess",),
}  # fmt: skip
_LATER = ("verify.solvers.methods_adapter",)
_DRAWING = (DRAWING, "meshio")
_IF_THERE = ("ufl", "basix.ufl", "ffcx.main", "reference.elasticity")
_PR_SET_CHILD_SUBREAPER = 36


def main(descriptor: int, kind: str) -> None:
    """Fork a process for every request until the runner hangs up; returns in the forked ones."""
    die_with_parent()
    gc.disable()  # imports make objects that live on
    signal.signal(signal.SIGCHLD, lambda *_: _reap())  # waited for, their times are counted
    preparations = _loading(_DRAWING) if kind == "drawing" else _preparations()
    with socket.socket(fileno=descriptor) as runner:
        while True:
            while not select.select([runner], [], [], 0.0)[0] and next(preparations, False):
                pass
            said, files, _, _ = socket.recv_fds(runner, LONGEST_REQUEST, 2)
            if not said:
                os._exit(0)
            _import_for(json.loads(said)["module"], kind)
            if len(os.listdir("/proc/self/task")) > 1:
                os._exit(1)  # a fork would lack that thread, and keep the locks that it holds
            gc.freeze()  # what all share is not touched by their collections
            if (keeper := os.fork()) == 0:
                runner.close()
                break
            for file in files:
                os.close(file)
            runner.send(str(keeper).encode())
    gc.enable()
    request = json.loads(said)
    _keep(request, *files)
    _work(request)
    _leave()


def _import_for(module: str, kind: str) -> None:
    """Import what those need that run `module`: all, if it is none of those that are known."""
    if kind == "drawing":
        import_module(module)
        return
    for asked, names in _NEEDED.items():
        for name in names:
            import_module(name)
        if asked == module:
            return


def _loading(names: Iterable[str]) -> Iterator[bool]:
    """Import one module after another, as far as they are there."""
    for name in names:
        with contextlib.suppress(ImportError):
            import_module(name)
        yield True


def _preparations() -> Iterator[bool]:
    """Import and load one thing after another, in the order in which they may be needed."""
    yield from _loading([name for names in _NEEDED.values() for name in names])
    kernels = _kernels()
    yield from itertools.islice(kernels, 2)
    yield from _loading((*_LATER, *_IF_THERE))
    yield from kernels


def _kernels() -> Iterator[bool]:
    """Call the kernels of one kind of scene after another, as far as they have been compiled."""
    from numba.core import event

    from verify.first_use import STAGES

    class Refusing(event.Listener):
        def on_start(self, event_: Any) -> None:
            raise _NotCompiledError

        def on_end(self, event_: Any) -> None:
            pass

    asked_first = sorted(STAGES, key=lambda name: name != "plane: statics")
    for stage in (STAGES[name] for name in asked_first if "scalpel" not in name):
        with (
            contextlib.suppress(_NotCompiledError),
            event.install_listener("numba:compile", Refusing()),
        ):
            stage()
        yield True


class _NotCompiledError(Exception):
    """A kernel is not in the cache; who needs it compiles it."""


def _reap() -> None:
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG) != (0, 0):
            pass


def _keep(request: dict[str, Any], log: int, status: int) -> None:
    """Become the keeper, and return in the process that it keeps."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.setsid()
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    parent, keeper = os.getppid(), os.getpid()
    worker = os.fork()
    if worker == 0:
        os.close(status)
        os.setsid()  # what it says to its group is not for the keeper
        os.dup2(log, 1)
        os.dup2(log, 2)
        os.close(log)
        os.environ.clear()
        os.environ.update({**request["environment"], PARENT_VARIABLE: str(keeper)})
        os.chdir(request["folder"])
        return
    os.close(log)
    signal.signal(signal.SIGTERM, lambda *_: _kill_descendants())
    os.environ[PARENT_VARIABLE] = str(parent)
    die_with_parent(signal.SIGTERM)
    try:
        while (ended := os.wait())[0] != worker:
            pass
        with contextlib.suppress(ChildProcessError):  # when nothing is left
            while True:
                _kill_descendants()
                os.wait()
        os.write(status, str(os.waitstatus_to_exitcode(ended[1])).encode())
    finally:
        os._exit(0)


def _kill_descendants() -> None:
    for pid in descendants(os.getpid())[1:]:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def _work(request: dict[str, Any]) -> None:
    """Do what ``python -m MODULE ARGUMENT`` does."""
    import numpy as np

    np.random.seed()  # noqa: NPY002 - that of the parent would be everyone's
    random.seed()
    sys.argv = [request["module"], request["argument"]]
    import_module(request["module"]).main(Path(request["argument"]))


def _leave() -> NoReturn:
    """End in order, but without taking apart what all have imported, which takes its time."""
    atexit._run_exitfuncs()
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None and mpi.Is_initialized() and not mpi.Is_finalized():
        mpi.Finalize()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(Exception):  # the work may have closed it
            stream.flush()
    ctypes.CDLL(None).fflush(None)
    os._exit(0)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
