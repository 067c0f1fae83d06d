"""Comparison and drawings of a finished case.

A comparison runs in a process of its own and says which solve it is at. If it dies there, that
solve is taken out, with the reason, and the others are compared again: a fault of the comparison
costs one solve its verdicts, and no other. One process draws all judged cases, one after the other:
what draws takes longer to import than most cases to be drawn.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.files import read_json, write_json
from verify.judge.checks import result_without_verdicts
from verify.result import COMPARISON_FAILED, CaseResult, read_result
from verify.runner.child import Child, Ending, death
from verify.runner.directory import JUDGING, RunDirectory, load_record
from verify.scene import Scene

LEAST_SECONDS = 60.0


class Comparison:
    """The comparison of solves with the truth.

    Parameters
    ----------
    scene : Scene
    folder : Path
        Of the case.
    question : dict
        What `verify.runner.judging` is asked: the ``key`` that identifies the comparison, the
        solvers that are judged (``judge_only``; none: all), the run directory (``root``), folders
        in it of the solves, also by other ``models``, and the ``provenance`` of the run.
    timeout, memory : float
        Limits, s and bytes.
    """

    def __init__(
        self, scene: Scene, folder: Path, question: dict[str, Any], timeout: float, memory: float
    ) -> None:
        self._scene, self._folder = scene, folder
        self._limits = max(timeout, LEAST_SECONDS), memory
        self._unfit: dict[str, str] = {}
        self._question = {**question, "unfit": self._unfit}
        self._child = self._started()

    def poll(self) -> CaseResult | None:
        """Look once; return the result when it is there."""
        if (ending := self._child.poll()) is None:
            return None
        result = stored_result(self._folder, self._question["key"])
        return self._without_result(ending) if result is None else result

    def kill(self) -> None:
        """End it."""
        self._child.kill()

    def _started(self) -> Child:
        for stale in ("judged.json", JUDGING):
            (self._folder / stale).unlink(missing_ok=True)
        question = self._folder / "judge.json"
        write_json(self._question, question)
        log = self._folder / "judge-log.txt"
        return Child("verify.runner.judging", question, log, *self._limits, own=True)

    def _without_result(self, ending: Ending) -> CaseResult | None:
        _, why = death(self._child.log, ending, *self._limits)
        try:
            at = (self._folder / JUDGING).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            at = ""
        if at in self._question["folders"] and at not in self._unfit:
            self._unfit[at] = why
            self._child = self._started()
            return None
        reason, origin = f"{COMPARISON_FAILED}: {why}", self._question["provenance"]
        judged = self._question["judge_only"]
        root = Path(self._question["root"])
        solves = [load_record(root / folder) for folder in self._question["folders"]]
        result = result_without_verdicts(self._scene, solves, reason, origin, judged)
        write_json(result.content(), self._folder / "result.json")
        return result


def stored_result(folder: Path, key: str) -> CaseResult | None:
    """Return the result that a comparison with this `key` left in the `folder` of a case."""
    try:
        if read_json(folder / "judged.json").get("key") == key:
            return read_result(folder / "result.json")
    except InputError:
        pass
    return None


def comparison_label(case: str) -> str:
    """Return what `Progress` is told of the comparison of a case."""
    return f"{case} · comparison"


class Drawings:
    """Cases that wait to be drawn, and the one that is being drawn.

    The report draws cases that failed here, or says why they cannot be drawn.

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
        self, folder: Path | None, cases: Sequence[str], directory: RunDirectory, *limits: float
    ) -> None:
        self._folder, self._cases, self._directory = folder, list(cases), directory
        self._timeout, self._memory = max(limits[0], LEAST_SECONDS), limits[1]
        self.waiting: list[str] = []
        self.running: list[Path] = []  # the question that is being answered
        self._child: Child | None = None

    def prepare(self) -> None:
        """Have the process that draws load what it needs."""
        if self._folder is not None and self._child is None:
            places = self._folder, self._folder / "log.txt", self._timeout, self._memory
            self._child = Child("verify.report.rendering", *places, own=True)

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
        """Forget a case that is drawn, or that has ended the process that draws."""
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
