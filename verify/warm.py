"""Processes forked from one that has imported what they need: `verify.runner.warm_parent`.

``multiprocessing`` has a server like it. That one imports the caller's main module into whatever it
forks, looks for modules in the working directory, and loses sight of what a process leaves behind.
"""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from verify.threads import ONE_THREAD

DRAWING = "verify.report.drawing"
PARENT_VARIABLE = "VERIFY_RUNNER_PID"
LONGEST_REQUEST = 1 << 17  # bytes, most of them the environment
# until a process to fork from answers: where nothing runs yet, and where others wait to be watched
_LOADING_SECONDS, _WATCHED_SECONDS, _ENDING_SECONDS = 120.0, 10.0, 0.2


class Forked:
    """A forked process, known by its keeper: an ancestor of all that it starts.

    Parameters
    ----------
    pid : int
        Of the keeper, which ends when nothing of the process is left.
    status : int
        File descriptor from which the exit code is read then.
    """

    def __init__(self, pid: int, status: int) -> None:
        self.pid, self._status = pid, status
        self._returncode: int | None = None
        os.set_blocking(status, False)

    def poll(self) -> int | None:
        """Return the exit code, or minus the signal, if it has ended."""
        if self._returncode is None:
            try:
                said = os.read(self._status, 64)
            except BlockingIOError:
                return None
            os.close(self._status)
            self._returncode = int(said) if said else -signal.SIGKILL  # the keeper was killed
        return self._returncode

    def wait(self) -> int:
        """Wait until it has ended."""
        while (returncode := self.poll()) is None:
            time.sleep(0.001)
        return returncode

    def end(self) -> None:
        """Have its keeper kill it, and all that it has started."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGTERM)


class _Parent:
    """A process to fork from, which begins to import at once what the work of its kind needs."""

    def __init__(self, kind: str) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.has_forked = False
        module = ["verify.runner.warm_parent", str(theirs.fileno()), kind]
        with theirs:
            self._process = subprocess.Popen(
                # -P: a stray numpy.py in the working directory is not imported
                [sys.executable, "-P", "-X", "faulthandler", "-m", *module],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, **ONE_THREAD, PARENT_VARIABLE: str(os.getpid())},
                pass_fds=(theirs.fileno(),),
                start_new_session=True,
            )

    def fork(self, request: bytes, log: int, seconds: float) -> Forked:
        """Have a process forked, with its output in `log`; `OSError` if none answers in time."""
        self._socket.settimeout(seconds)
        status, theirs = os.pipe()
        try:
            socket.send_fds(self._socket, [request], [log, theirs])
            self.has_forked = True
            if not (said := self._socket.recv(64)):
                raise BrokenPipeError("the warm parent has gone")
        except OSError:
            os.close(status)
            raise
        finally:
            os.close(theirs)
        return Forked(int(said), status)

    def close(self) -> None:
        """End it, and what it has forked with it."""
        self._socket.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_ENDING_SECONDS if self.has_forked else 0.0)
        self._process.kill()
        self._process.wait()


_own = threading.local()  # a parent dies with the thread that started it


@contextlib.contextmanager
def warm_parent() -> Iterator[None]:
    """Keep processes for the time of the block from which this thread can `fork`.

    They are those of the block around this one, if there is one.
    """
    if not sys.platform.startswith("linux") or getattr(_own, "parents", None) is not None:
        yield
        return
    _own.parents = {}
    prepare_fork()
    try:
        yield
    finally:
        parents, _own.parents = _own.parents, None
        for parent in filter(None, parents.values()):
            parent.close()


def prepare_fork(module: str = "") -> None:
    """Begin to load, inside a block of `warm_parent`, the process that `module` is forked from.

    What draws has one of its own: a solve shall not hold the memory of its libraries.
    """
    parents: dict[str, _Parent | None] | None = getattr(_own, "parents", None)
    if parents is not None and (kind := _kind(module)) not in parents:
        parents[kind] = None
        with contextlib.suppress(OSError):  # no process to fork from: each job starts its own
            parents[kind] = _Parent(kind)


def _kind(module: str) -> str:
    return "drawing" if module == DRAWING else "solving"


def fork(module: str, argument: Path, log: int, environment: Mapping[str, str]) -> Forked | None:
    """Have ``python -m MODULE ARGUMENT`` run by a process that begins with all imports done.

    Parameters
    ----------
    module : str
    argument : Path
    log : int
        File descriptor of its output.
    environment : mapping
        Its environment.

    Returns
    -------
    Forked or None
        None outside a block of `warm_parent`, and where it could not be loaded.
    """
    prepare_fork(module)
    parents: dict[str, _Parent | None] = getattr(_own, "parents", None) or {}
    parent = parents.get(_kind(module))
    said = {"module": module, "argument": str(argument), "folder": os.getcwd()}
    request = json.dumps({**said, "environment": dict(environment)}).encode()
    if parent is None or len(request) > LONGEST_REQUEST:
        return None
    others = any(one.has_forked for one in parents.values() if one is not None)
    try:
        return parent.fork(request, log, _WATCHED_SECONDS if others else _LOADING_SECONDS)
    except (OSError, ValueError):
        parents[_kind(module)] = None
        parent.close()
        return None
