"""Outcome of a process in words: as it left it, or by its death."""

from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json
from verify.printable import memory_text
from verify.result import SolveRecord, Status
from verify.result_files import checked
from verify.runner.child import Ending
from verify.runner.directory import LEVELS
from verify.runner.job import Job
from verify.runner.log import telling_line
from verify.solvers.interface import MOST_LEVELS


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
