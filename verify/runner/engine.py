"""Engines that run solves: child processes here, or the workers of a cluster."""

from pathlib import Path
from typing import Any, Protocol

from verify.runner.child import Child, Ending
from verify.solvers.interface import is_built_in


class Running(Protocol):
    """A solve that was started; it writes its files into the folder of its job."""

    log: Path

    def poll(self) -> Ending | None:
        """Look once; tell how it ended if it has."""
        ...

    def kill(self) -> None:
        """End it; nothing of it may go on."""
        ...


class Engine(Protocol):
    """Starts solves."""

    @property
    def width(self) -> int:
        """How many solves run side by side at most."""
        ...

    def start(self, job: dict[str, Any], folder: Path) -> Running:
        """Start the solve that ``job.json`` in `folder` describes, whose content is `job`."""
        ...

    def close(self) -> None:
        """Leave the engine; what runs has ended or was killed."""
        ...


class LocalEngine:
    """Child processes of this one.

    Parameters
    ----------
    width : int
        Processes at the same time.
    timeout : float
        Wall seconds of each.
    memory : float
        Bytes of resident memory of each.
    """

    def __init__(self, width: int, timeout: float, memory: float) -> None:
        self.width, self._timeout, self._memory = width, timeout, memory

    def start(self, job: dict[str, Any], folder: Path) -> Child:
        """Start a process."""
        return solving(job, folder, self._timeout, self._memory)

    def close(self) -> None:
        """There is nothing to leave."""


def solving(
    job: dict[str, Any], folder: Path, timeout: float, memory: float, forked: bool = True
) -> Child:
    """Start the process that solves what ``job.json`` in `folder` says; `forked` if it may be."""
    own = forked and is_built_in(job["solver"])
    files, ranks = (folder / "job.json", folder / "log.txt"), job.get("ranks", 1)
    return Child("verify.runner.solve", *files, timeout, memory, ranks, own=own)
