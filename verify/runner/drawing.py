"""Drawings of judged cases for the report, made in processes beside the solves."""

from collections.abc import Sequence
from pathlib import Path

from verify.json_files import write_json
from verify.runner.child import Child
from verify.runner.comparing import LEAST_SECONDS
from verify.runner.directory import RunDirectory
from verify.warm import DRAWING, prepare_fork


class Drawings:
    """Cases that wait to be drawn, and those that are being drawn.

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
        self.running: list[Child] = []

    def prepare(self) -> None:
        """Load what draws into the process from which drawings are forked."""
        if self._folder is not None:
            prepare_fork(DRAWING)

    def ask(self, case: str) -> None:
        """Have a judged case drawn when there is room."""
        if self._folder is not None:
            self.waiting.append(case)

    def start(self) -> None:
        """Begin the one that waits longest."""
        assert self._folder is not None
        case = self.waiting.pop(0)
        folder = self._directory.case_folder(case)
        question = {
            "root": str(self._directory.root.resolve()),
            "index": self._cases.index(case),
            "folder": str(folder.relative_to(self._directory.root)),
            "target": str(self._folder / f"{folder.name}.pickle"),
        }
        file = self._folder / f"{folder.name}.json"
        write_json(question, file)
        log = file.with_suffix(".txt")
        self.running.append(Child(DRAWING, file, log, self._timeout, self._memory, own=True))

    def poll(self) -> None:
        """Forget those that ended."""
        self.running = [drawing for drawing in self.running if drawing.poll() is None]

    def kill(self) -> None:
        """End all."""
        for drawing in self.running:
            drawing.kill()
