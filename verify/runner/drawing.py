"""Drawings of judged cases for the report, made one after the other in a process beside the solves.

It is one process for all of them: what draws takes longer to import than most cases to be drawn.
"""

import time
from collections.abc import Sequence
from pathlib import Path

from verify.json_files import write_json
from verify.runner.child import Child
from verify.runner.comparing import LEAST_SECONDS
from verify.runner.directory import RunDirectory


class Drawings:
    """Cases that wait to be drawn, and the one that is being drawn.

    What could not be drawn is drawn, or said to be undrawable, by the report.

    Parameters
    ----------
    folder : Path, optional
        Where the drawings go; without it nothing is drawn.
    cases : sequence of str
        All of the run, in the order of the report.
    directory : RunDirectory
    timeout, memory : float
        Limits of one drawing, s and bytes.
    """

    def __init__(
        self,
        folder: Path | None,
        cases: Sequence[str],
        directory: RunDirectory,
        timeout: float,
        memory: float,
    ) -> None:
        self._folder, self._cases, self._directory = folder, list(cases), directory
        self._timeout, self._memory = max(timeout, LEAST_SECONDS), memory
        self.waiting: list[str] = []
        self.running: list[Path] = []  # the question that is being answered
        self._child: Child | None = None

    def prepare(self) -> None:
        """Have the process that draws load what it needs."""
        if self._folder is not None and self._child is None:
            log, limits = self._folder / "log.txt", (self._timeout, self._memory)
            self._child = Child("verify.report.rendering", self._folder, log, *limits, own=True)

    def ask(self, case: str) -> None:
        """Have a judged case drawn when there is room."""
        if self._folder is not None:
            self.waiting.append(case)

    def start(self) -> None:
        """Begin the one that waits longest."""
        self.prepare()
        assert self._folder is not None
        assert self._child is not None
        case = self.waiting.pop(0)
        folder = self._directory.case_folder(case)
        question = {
            "root": str(self._directory.root.resolve()),
            "index": self._cases.index(case),
            "folder": str(folder.relative_to(self._directory.root)),
            "target": str(self._folder / f"{folder.name}.pickle"),
        }
        self.running = [self._folder / f"{folder.name}.json"]
        self._child.timeout = time.monotonic() - self._child.start + self._timeout
        write_json(question, self.running[0])

    def poll(self) -> None:
        """Forget what is drawn, or has ended the process that draws."""
        if self._child is not None and self._child.poll() is not None:
            self._child = None
            for question in self.running:
                question.unlink(missing_ok=True)
        self.running = [question for question in self.running if question.exists()]
        if self._child is not None and not self.running:
            self._child.timeout = float("inf")  # it waits for us

    def kill(self) -> None:
        """End it."""
        if self._child is not None:
            self._child.kill()
