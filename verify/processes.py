"""Processes that solve: one thread each, their first and last acts, the server that forks them.

Parallel runs are processes, timings are one thread's. BLAS with a thread per core also costs:
threads wait for each other over small matrices. The quick sliver study took 82 s of two cores with
it, and 35 s of one without.
"""

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
from multiprocessing import forkserver
from pathlib import Path

PARENT_VARIABLE = "VERIFY_RUNNER_PID"
FORKED = multiprocessing.get_context("forkserver")
_LAUNCHER = "launcher"  # instead of a number: started by something that the runner started
_PR_SET_PDEATHSIG = 1
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3


def start_server() -> None:
    """Begin to load the process that solves and comparisons are forked from, if there is none.

    It has one thread, and imports nothing from the folder that the runner was started in. It dies
    with the thread that calls this.
    """
    FORKED.set_forkserver_preload(["verify.runner.preloaded"])
    before = dict(os.environ)
    here = {PARENT_VARIABLE: str(os.getpid()), "PYTHONSAFEPATH": "1"}
    os.environ.update({**ONE_THREAD, **here})
    try:
        with contextlib.suppress(OSError):  # without it each process is a fresh one
            forkserver.ensure_running()
    finally:
        for name in (*ONE_THREAD, *here):
            del os.environ[name]
        os.environ.update(before)


def die_with_parent(by: signal.Signals = signal.SIGKILL) -> None:
    """Have the kernel kill this process when the runner dies, however it dies."""
    parent = os.environ.get(PARENT_VARIABLE)
    if parent is None or not sys.platform.startswith("linux"):
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, by, 0, 0, 0)
    if parent != _LAUNCHER and os.getppid() != int(parent):  # it died before we asked
        os.kill(os.getpid(), by)


def keep_memory() -> None:
    """Have the allocator of glibc keep what is freed for the arrays that come next.

    Arrays of megabytes come and go. To give their pages back and take them anew is some 5 % of the
    time of a comparison.
    """
    with contextlib.suppress(AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)
        mallopt(_M_MMAP_THRESHOLD, 2**25)


def under_a_launcher() -> None:
    """Have what this process starts die with its own parent, which is not the runner."""
    if PARENT_VARIABLE in os.environ:
        os.environ[PARENT_VARIABLE] = _LAUNCHER


def peak_memory() -> float:
    """Largest resident memory of this process so far, bytes.

    From ``VmHWM``; ``getrusage`` would count what the parent held when it started us.
    """
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) * 1024.0
    return float("nan")


def memory_limit(given: float | None, sharers: int = 1) -> float:
    """Limit of memory of one of some processes, bytes; default 80 % of the machine's, shared."""
    return given or 0.8 * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / sharers


# what the libraries read when they are loaded
ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "NUMBA_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
    ),
    "1",
)


def pin_to_one_thread() -> None:
    """Pin this process, and those it starts, before numpy or numba is loaded.

    Whatever the environment says: records of every run and study are of one thread.
    """
    os.environ.update(ONE_THREAD)
