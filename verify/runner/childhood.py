"""First and last acts of every process that the runner starts."""

import ctypes
import os
import signal
import sys
from pathlib import Path

from verify.warm import PARENT_VARIABLE

__all__ = ["ANSWER", "ASKING", "JUDGING", "die_with_parent", "peak_memory", "under_a_launcher"]

# files by which a process says where it is, for the case that it dies there
ANSWER, ASKING, JUDGING = "answer.json", "asking", "judging"

_PR_SET_PDEATHSIG = 1
_LAUNCHER = "launcher"  # instead of a number: started by something that the runner started


def die_with_parent(by: signal.Signals = signal.SIGKILL) -> None:
    """Have the kernel kill this process when the runner dies, however it dies."""
    parent = os.environ.get(PARENT_VARIABLE)
    if parent is None or not sys.platform.startswith("linux"):
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, by, 0, 0, 0)
    if parent != _LAUNCHER and os.getppid() != int(parent):  # it died before we asked
        os.kill(os.getpid(), by)


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
