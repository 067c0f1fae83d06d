"""Outcome of a process in words: as it left it, or by its death."""

import re
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json
from verify.printable import memory_text, one_line
from verify.result import SolveRecord, Status
from verify.result_files import checked
from verify.runner.child import Ending
from verify.runner.directory import LEVELS
from verify.runner.job import Job
from verify.solvers.interface import MOST_LEVELS

_FATAL = re.compile(r"^Fatal Python error: (.+)")  # faulthandler's headline of a crash
_TELLING = re.compile(r"error|exception|abort|killed|fail|cannot|not found", re.IGNORECASE)
_LONGEST = 300
_READ = 2**18


def outcome_in(folder: Path) -> dict[str, Any] | None:
    """Return what a solve left in `folder` as fields of a record, with ``peak_memory``.

    None if it left nothing, or something else.
    """
    try:
        outcome = read_json(folder / "outcome.json")
        blank = {"case": "", "solver": "", "level": 0}
        record = checked(SolveRecord, {**blank, **outcome}, "outcome", str(folder))
    except InputError:
        return None
    return {name: getattr(record, name) for name in outcome}


def levels_told(job: Job) -> int:
    """Return how many levels a solver has that was asked for level 0; 0 if it has not said."""
    try:
        return min(int((job.folder / LEVELS).read_text()), MOST_LEVELS)
    except (OSError, ValueError):
        return 0


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
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if not lines:
        return "said nothing"
    for line in lines:
        if match := _FATAL.match(line):
            return one_line(match.group(1)[:_LONGEST])
    tail = lines[-30:]
    line = next((line for line in reversed(tail) if _TELLING.search(line)), lines[-1])
    return one_line(line[:_LONGEST])


def _ends(log: Path) -> str:
    """Return the beginning and the end of a log that may be very long."""
    with log.open("rb") as stream:
        head = stream.read(_READ)
        size = stream.seek(0, 2)
        stream.seek(max(_READ, size - _READ))
        return (head + b"\n" + stream.read()).decode("utf-8", errors="replace")
