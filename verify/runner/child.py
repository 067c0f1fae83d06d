"""A process of our own making, watched: wall time, resident memory, and its whole group killed.

Memory is limited by watching the resident set instead of ``RLIMIT_AS`` or ``RLIMIT_DATA``.
Those count what a process reserves, and LLVM, OpenBLAS and MPI reserve gigabytes that they
never touch; and a solver that hits them dies in an unlucky place with an unclear message. The
watch looks fifty times a second, so that a solve may overshoot by what it can touch in 20 ms.
"""

import contextlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from verify.threads import ONE_THREAD

__all__ = ["PARENT_VARIABLE", "POLL_SECONDS", "Child", "Ending"]

POLL_SECONDS = 0.02
PARENT_VARIABLE = "VERIFY_RUNNER_PID"


@dataclass(frozen=True)
class Ending:
    """How a process ended.

    `killed_for` is ``"timeout"`` or ``"memory"`` if the watch killed it; `peak` is the largest
    resident memory seen (bytes), `wall` its life time (s).
    """

    returncode: int
    wall: float
    peak: float
    killed_for: str = ""


class Child:
    """A running ``python -m MODULE ARGUMENT`` with its log, watched by calling `poll`.

    With more than one of `ranks` it is mpiexec that runs it as often; the limits are for all
    ranks together.
    """

    def __init__(
        self,
        module: str,
        argument: Path,
        log: Path,
        timeout: float,
        memory: float,
        ranks: int = 1,
    ) -> None:
        environment = {**os.environ, **ONE_THREAD}
        environment[PARENT_VARIABLE] = str(os.getpid())
        self.log, self.timeout, self.memory = log, timeout, memory
        self.peak, self.killed_for = 0.0, ""
        self.start = time.monotonic()
        run = [module, str(argument)]
        if ranks > 1:
            run = ["verify.runner.ranks", str(ranks), *run]
        with log.open("wb") as stream:
            self._process = subprocess.Popen(
                # -P: a stray numpy.py in the working directory is not imported
                [sys.executable, "-P", "-X", "faulthandler", "-m", *run],
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                env=environment,
                start_new_session=True,
            )

    def poll(self) -> Ending | None:
        """Look once; kill it if it is over a limit; tell how it ended if it has."""
        returncode = self._process.poll()
        wall = time.monotonic() - self.start
        if returncode is not None:
            self._kill_group()  # compilers and the like that it left behind
            return Ending(returncode, wall, self.peak, self.killed_for)
        resident = _resident_memory(self._process.pid)
        self.peak = max(self.peak, resident)
        if not self.killed_for:
            if resident > self.memory:
                self.killed_for = "memory"
            elif wall > self.timeout:
                self.killed_for = "timeout"
            if self.killed_for:
                self._kill_group()
        return None

    def kill(self) -> None:
        """Kill it and everything that it started, and wait for it."""
        self._kill_group()
        self._process.wait()

    def _kill_group(self) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)  # it leads its own session and group


def _resident_memory(pid: int) -> float:
    """Resident memory in bytes of a process and its descendants (0 if it has gone)."""
    total = 0.0
    waiting = [str(pid)]
    while waiting:
        folder = Path("/proc", waiting.pop())
        try:
            pages = int((folder / "statm").read_bytes().split()[1])
            for task in (folder / "task").iterdir():
                waiting += (task / "children").read_text().split()
        except (OSError, IndexError, ValueError):
            continue
        total += pages * os.sysconf("SC_PAGE_SIZE")
    return total
