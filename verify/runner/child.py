"""A process of our own making, watched: wall time, memory, length of its log; killed as a whole.

Memory is limited by watching the resident set instead of ``RLIMIT_AS`` or ``RLIMIT_DATA``.
Those count what a process reserves, and LLVM, OpenBLAS and MPI reserve gigabytes that they
never touch; and a solver that hits them dies in an unlucky place with an unclear message. The
watch looks fifty times a second, so that a solve may overshoot by what it can touch in 20 ms.

Everything that it started ends with it: its process group, its descendants as the watch has seen
them, and processes with its mark in their environment. Its death is explained by the limit that it
exceeded, or by its log.
"""

import atexit
import contextlib
import ctypes
import faulthandler
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import ModuleType
from typing import Protocol
from uuid import uuid4

import numpy as np
import psutil

from verify.printable import memory_text, one_line
from verify.processes import FORKED, ONE_THREAD, PARENT_VARIABLE, die_with_parent, start_server
from verify.result import Status

POLL_SECONDS = 0.02
_SEARCH_SECONDS = 0.2  # between two looks at all processes of the machine for its children
_MARK_VARIABLE = "VERIFY_CHILD"
_LONGEST_LOG = 64 * 2**20  # bytes; beyond, only its beginning and what comes next are kept
_BEGINNING = 2**20
_ROUNDS = 50  # of killing: what forks meanwhile is found in the next
_FATAL = re.compile(r"^Fatal Python error: (.+)")  # faulthandler's headline of a crash
_TELLING = re.compile(r"error|exception|abort|killed|fail|cannot|not found", re.IGNORECASE)
_LONGEST_LINE = 300
_READ = 2**18


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
    ranks together. One that is `own`, and runs no code of a guest, is forked from a server that
    has imported what it needs; its module has a function ``main`` that is given the argument.
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
        environment = {**os.environ, **ONE_THREAD, PARENT_VARIABLE: str(os.getpid())}
        self._mark = environment[_MARK_VARIABLE] = uuid4().hex
        self.log, self.timeout, self.memory = log, timeout, memory
        self.peak, self.killed_for = 0.0, ""
        argument = argument.resolve()  # a solver may change the working directory
        log.unlink(missing_ok=True)
        log.touch()
        run = [module, str(argument)]
        if ranks > 1:
            run, own = ["verify.runner.ranks", str(ranks), *run], False
        forked = _forked(module, argument, log.resolve(), environment) if own else None
        self._process: BaseProcess | subprocess.Popen[bytes] = forked or _fresh(
            run, log, environment
        )
        self.start, self._starved_before = time.monotonic(), _starved()
        self._searched, self._seen = 0.0, set[psutil.Process]()
        self._pid = self._process.pid or 0
        with contextlib.suppress(psutil.Error):  # it may have ended
            self._seen.add(psutil.Process(self._pid))
        self._root = frozenset(self._seen)

    def poll(self) -> Ending | None:
        """Look once; kill it if it is over a limit; tell how it ended if it has."""
        returncode = self._returncode()
        wall = time.monotonic() - self.start
        if returncode is not None:
            self._kill_all()  # compilers and the like that it left behind
            starved = _starved() > self._starved_before
            return Ending(returncode, wall, self.peak, self.killed_for, starved)
        _shorten(self.log)
        if time.monotonic() - self._searched > _SEARCH_SECONDS:
            self._search()
        resident = _resident_memory(self._seen)
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
        if isinstance(self._process, BaseProcess):
            self._process.join()
        else:
            self._process.wait()

    def _returncode(self) -> int | None:
        if isinstance(self._process, BaseProcess):
            return self._process.exitcode
        return self._process.poll()

    def _search(self) -> None:
        """Find its descendants; those that have lost their parents since stay known."""
        self._searched = time.monotonic()
        for root in self._root:
            with contextlib.suppress(psutil.Error):
                self._seen |= set(root.children(recursive=True))
        self._seen = set(filter(_is_alive, self._seen))

    def _kill_all(self) -> None:
        """Kill its group, what it started, and what bears its mark, until nothing is left."""
        for _ in range(_ROUNDS):
            self._search()
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._pid, signal.SIGKILL)  # it leads its own session and group
            found = self._seen | _marked(self._mark)
            for process in found:
                with contextlib.suppress(psutil.Error):
                    process.kill()
            if found <= self._root:
                return


class Watched[Found](Protocol):
    """A running process, or an object that waits for one."""

    def poll(self) -> Found | None:
        """Look once; return how it ended, or what it found."""

    def kill(self) -> None:
        """End it."""


def watch_all[Found](
    starts: Sequence[Callable[[], Watched[Found]]],
    ended: Callable[[int, Found], None],
    jobs: int = 1,
    look: Callable[[], None] = lambda: None,
) -> None:
    """Start what waits, some at the same time, and look until all has ended.

    Parameters
    ----------
    starts : sequence of callable
    ended : callable
        Told the place in `starts` and what was found of each.
    jobs : int
    look : callable
        Called again and again. What it raises ends all that is under way, as a signal does.
    """
    running, waiting = dict[int, Watched[Found]](), list(enumerate(starts))
    try:
        while waiting or running:
            look()
            while waiting and len(running) < jobs:
                number, start = waiting.pop(0)
                running[number] = start()
            for number, one in list(running.items()):
                if (found := one.poll()) is not None:
                    del running[number]
                    ended(number, found)
            if running:
                time.sleep(POLL_SECONDS)
    finally:
        for one in running.values():
            one.kill()


def watch[Found](one: Watched[Found], look: Callable[[], None] = lambda: None) -> Found:
    """Look at one until it has ended; return what was found."""
    found: list[Found] = []
    watch_all([lambda: one], lambda _, ending: found.append(ending), look=look)
    return found[0]


def _fresh(run: list[str], log: Path, environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    """Start a Python that knows nothing of this one."""
    with log.open("ab") as stream:  # appending, so that it can be cut from outside
        return subprocess.Popen(
            # -P: a stray numpy.py in the working directory is not imported
            [sys.executable, "-P", "-X", "faulthandler", "-m", *run],
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=stream,
            env=environment,
            start_new_session=True,
        )


def _forked(
    module: str, argument: Path, log: Path, environment: Mapping[str, str]
) -> BaseProcess | None:
    """Fork a process from the server; None if there is none that answers."""
    work = (module, argument, log, os.getcwd(), environment)
    process = FORKED.Process(target=_work, args=work, daemon=True)
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")  # or it would be run once more, over there
    try:
        start_server()
        process.start()
    except (OSError, EOFError):
        return None
    finally:
        sys.modules["__main__"] = main
    return process


def _work(
    module: str, argument: Path, log: Path, folder: str, environment: Mapping[str, str]
) -> None:
    """Do in a forked process what ``python -m MODULE ARGUMENT`` does in a fresh one."""
    os.setsid()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    output = os.open(log, os.O_WRONLY | os.O_APPEND)
    for descriptor in (1, 2):
        os.dup2(output, descriptor)
    os.close(output)
    faulthandler.enable()
    os.environ.clear()
    os.environ.update({**environment, PARENT_VARIABLE: str(os.getppid())})
    die_with_parent()
    os.chdir(folder)
    sys.argv = [module, str(argument)]
    np.random.seed()  # noqa: NPY002 - else all have the seed of the server
    random.seed()
    try:
        import_module(module).main(argument)
    finally:  # multiprocessing leaves at once
        atexit._run_exitfuncs()
        mpi = sys.modules.get("mpi4py.MPI")
        if mpi is not None and mpi.Is_initialized() and not mpi.Is_finalized():
            mpi.Finalize()
        ctypes.CDLL(None).fflush(None)


def _marked(mark: str) -> set[psutil.Process]:
    """Living processes with `mark` in the environment that they were started with."""
    found = set()
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            if process.environ().get(_MARK_VARIABLE) == mark:
                found.add(process)
    return found


def _is_alive(process: psutil.Process) -> bool:
    with contextlib.suppress(psutil.Error):
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    return False


def _resident_memory(processes: set[psutil.Process]) -> float:
    """Resident memory in bytes of processes (0 of one that has gone)."""
    total = 0.0
    for process in processes:
        with contextlib.suppress(psutil.Error):
            total += process.memory_info().rss
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


def death(log: Path, ending: Ending, timeout: float, memory: float) -> tuple[Status, str]:
    """Explain the end of a process that left no outcome.

    Parameters
    ----------
    log : Path
    ending : Ending
    timeout, memory : float
        The limits that it had, s and bytes.
    """
    if ending.killed_for == "timeout":
        return Status.TIMEOUT, f"killed after {timeout:g} s"
    if ending.killed_for == "memory":
        return Status.MEMORY, f"killed above {memory_text(memory)}"
    if ending.returncode == -9:
        if ending.starved:
            return Status.MEMORY, "killed by the system, which was out of memory"
        return Status.FAILED, "killed from outside (signal 9), not for memory"
    code = ending.returncode
    how = f"signal {-code}" if code < 0 else f"exit code {code}"
    return Status.FAILED, f"{telling_line(log)} ({how}{'' if code else ', without an answer'})"


def telling_line(log: Path) -> str:
    """Return the line of `log` that says most about a death: a crash, an error, the last one."""
    try:
        text = _ends(log)
    except OSError:
        return "left no log"
    if not (lines := [line.strip() for line in text.splitlines() if line.strip()]):
        return "said nothing"
    for line in lines:
        if match := _FATAL.match(line):
            return one_line(match.group(1)[:_LONGEST_LINE])
    tail = lines[-30:]
    line = next((line for line in reversed(tail) if _TELLING.search(line)), lines[-1])
    return one_line(line[:_LONGEST_LINE])


def _ends(log: Path) -> str:
    """Return the beginning and the end of a log that may be very long."""
    with log.open("rb") as stream:
        head = stream.read(_READ)
        size = stream.seek(0, 2)
        stream.seek(max(_READ, size - _READ))
        return (head + b"\n" + stream.read()).decode("utf-8", errors="replace")
