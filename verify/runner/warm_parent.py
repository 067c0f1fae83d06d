"""The process from which others are forked: ``python -m verify.runner.warm_parent SOCKET``.

A fresh Python takes longer to import what solving and judging need than many a solve takes. What is
forked here begins as a fresh one would, with an environment, a working directory and a log of its
own. Nothing that starts threads or MPI is imported before the fork: FEniCSx is not, only the Python
packages that it builds on.

Between both there is a keeper. The kernel makes it the parent of whatever that process starts and
leaves behind, so that all of it is found and ended with it.
"""

import contextlib
import ctypes
import gc
import json
import os
import random
import signal
import socket
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from verify.runner.child import descendants
from verify.runner.childhood import die_with_parent
from verify.runner.warm import LONGEST_REQUEST, PARENT_VARIABLE

__all__ = ["main"]

_NEEDED = (
    "numpy.random",
    "verify.calibration",
    "verify.runner.assess",
    "verify.runner.solve",
    "verify.runner.survey",
    "verify.solvers.methods_adapter",
    "verify.solvers.xfem",
    "meshio",
    "reference.exact",
)
_IF_THERE = ("ufl", "basix.ufl", "ffcx.main", "reference.elasticity")
_PR_SET_CHILD_SUBREAPER = 36


def main(descriptor: int) -> None:
    """Fork a process for every request until the runner hangs up; returns in the forked ones."""
    die_with_parent()
    for name in _NEEDED:
        import_module(name)
    for name in _IF_THERE:
        with contextlib.suppress(ImportError):
            import_module(name)
    _call_a_kernel()
    if len(os.listdir("/proc/self/task")) > 1:
        return  # a thread would be missing in what is forked, with the locks that it holds
    gc.collect()
    gc.freeze()  # what all share is not touched by their collections
    signal.signal(signal.SIGCHLD, lambda *_: _reap())  # waited for, their times are counted
    with socket.socket(fileno=descriptor) as runner:
        while True:
            said, files, _, _ = socket.recv_fds(runner, LONGEST_REQUEST, 2)
            if not said:
                os._exit(0)
            if (keeper := os.fork()) == 0:
                runner.close()
                break
            for file in files:
                os.close(file)
            runner.send(str(keeper).encode())
    request = json.loads(said)
    _keep(request, *files)
    _work(request)


def _call_a_kernel() -> None:
    """Have numba set itself up, which it does at the first call."""
    import numpy as np

    from verify.xfem.arrays.short_sort import sort_short

    sort_short(np.zeros(1, dtype=np.int32))


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


if __name__ == "__main__":
    main(int(sys.argv[1]))
