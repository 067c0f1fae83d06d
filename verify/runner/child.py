"""A process of our own making, watched: wall time, memory, length of its log; killed as a whole.

Memory is limited by watching the resident set instead of ``RLIMIT_AS`` or ``RLIMIT_DATA``.
Those count what a process reserves, and LLVM, OpenBLAS and MPI reserve gigabytes that they
never touch; and a solver that hits them dies in an unlucky place with an unclear message. The
watch looks fifty times a second, so that a solve may overshoot by what it can touch in 20 ms.

Its end is the end of everything that it started: of its process group, and of processes that
left the group, which are found as its descendants and by a mark in their environment.
"""

import contextlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

from verify.threads import ONE_THREAD
from verify.warm import PARENT_VARIABLE, Forked, fork

POLL_SECONDS = 0.02
_MARK_VARIABLE = "VERIFY_CHILD"
_LONGEST_LOG = 64 * 2**20  # bytes; beyond, only its beginning and what comes next are kept
_BEGINNING = 2**20
_ROUNDS = 50  # of killing: what forks meanwhile is found in the next


@dataclass(frozen=True)
class Ending:
    """How a process ended.

    `killed_for` is ``"timeout"`` or ``"memory"`` if the watch killed it; `peak` is the largest
    resident memory seen (bytes), `wall` its life time (s). `starved` says whether the system
    killed some process for want of memory meanwhile; None where it does not tell.
    """

    returncode: int
    wall: float
    peak: float
    killed_for: str = ""
    starved: bool = False


class Child:
    """A running ``python -m MODULE ARGUMENT`` with its log, watched by calling `poll`.

    With more than one of `ranks` it is mpiexec that runs it as often; the limits are for all
    ranks together. One that is `own`, and runs no code of a guest, is forked from a process that
    has imported what it needs, where there is one.
    """

    def __init__(
        self,
        module: str,
        argument: Path,
        log: Path,
        timeout: float,
        memory: float,
        ranks: int = 1,
        own: bool = False,
    ) -> None:
        environment = {**os.environ, **ONE_THREAD}
        environment[PARENT_VARIABLE] = str(os.getpid())
        self._mark = environment[_MARK_VARIABLE] = uuid4().hex
        self.log, self.timeout, self.memory = log, timeout, memory
        self.peak, self.killed_for = 0.0, ""
        argument = argument.resolve()  # a solver may change the working directory
        run = [module, str(argument)]
        if ranks > 1:
            run, own = ["verify.runner.ranks", str(ranks), *run], False
        log.unlink(missing_ok=True)
        with log.open("ab") as stream:  # appending, so that it can be cut from outside
            forked = fork(module, argument, stream.fileno(), environment) if own else None
            self._process: Forked | subprocess.Popen[bytes] = forked or subprocess.Popen(
                # -P: a stray numpy.py in the working directory is not imported
                [sys.executable, "-P", "-X", "faulthandler", "-m", *run],
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                env=environment,
                start_new_session=True,
            )
        self.start, self._starved_before = time.monotonic(), _starved()

    def poll(self) -> Ending | None:
        """Look once; kill it if it is over a limit; tell how it ended if it has."""
        returncode = self._process.poll()
        wall = time.monotonic() - self.start
        if returncode is not None:
            self._kill_all()  # compilers and the like that it left behind
            starved = _starved() > self._starved_before
            return Ending(returncode, wall, self.peak, self.killed_for, starved)
        _shorten(self.log)
        # a keeper shares all that it holds with the process that it keeps
        own = descendants(self._process.pid)[isinstance(self._process, Forked) :]
        resident = _resident_memory(own)
        self.peak = max(self.peak, resident)
        if not self.killed_for:
            if resident > self.memory:
                self.killed_for = "memory"
            elif wall > self.timeout:
                self.killed_for = "timeout"
            if self.killed_for:
                self._kill_all()
        return None

    def kill(self) -> None:
        """Kill it and everything that it started, and wait for it."""
        self._kill_all()
        self._process.wait()

    def _kill_all(self) -> None:
        """Kill its group, its descendants, and what bears its mark, until nothing is left."""
        if isinstance(self._process, Forked):
            self._process.end()
            return
        mark = f"{_MARK_VARIABLE}={self._mark}".encode()
        for _ in range(_ROUNDS):
            found = {*descendants(self._process.pid), *_marked(mark)}
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)  # it leads its own session and group
            for pid in found - {self._process.pid}:
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.kill(pid, signal.SIGKILL)
            if not found - {self._process.pid}:
                return


def descendants(pid: int) -> list[int]:
    """Return process `pid` and all that it started and that has not been orphaned."""
    found, waiting = [], [pid]
    while waiting:
        found.append(waiting.pop())
        with contextlib.suppress(OSError, ValueError):
            for task in Path("/proc", str(found[-1]), "task").iterdir():
                waiting += map(int, (task / "children").read_text().split())
    return found


def _marked(mark: bytes) -> list[int]:
    """Living processes with `mark` in the environment that they were started with."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError):  # a zombie has no environment
            if mark in (folder / "environ").read_bytes():
                found.append(int(folder.name))
    return found


def _resident_memory(pids: list[int]) -> float:
    """Resident memory in bytes of processes (0 of one that has gone)."""
    total = 0.0
    for one in pids:
        with contextlib.suppress(OSError, IndexError, ValueError):
            pages = int(Path("/proc", str(one), "statm").read_bytes().split()[1])
            total += pages * os.sysconf("SC_PAGE_SIZE")
    return total


def _starved() -> int:
    """Count how often this machine, or this container, has killed for want of memory."""
    total = 0
    for file in ("/proc/vmstat", "/sys/fs/cgroup/memory.events"):
        with contextlib.suppress(OSError, ValueError):
            for line in Path(file).read_text().splitlines():
                name, _, count = line.partition(" ")
                total += int(count) if name == "oom_kill" else 0
    return total


def _shorten(log: Path) -> None:
    with contextlib.suppress(OSError):
        if log.stat().st_size > _LONGEST_LOG:
            os.truncate(log, _BEGINNING)
            with log.open("ab") as stream:
                stream.write(b"\n... (cut here by the runner: too long) ...\n")
