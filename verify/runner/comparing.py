"""Comparison of a finished case.

It runs in a process of its own and says which solve it is at. If it dies there, that solve is taken
out, with the reason, and the others are compared again: a fault of the comparison costs one solve
its verdicts, and no other.
"""

from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.files import read_json, write_json
from verify.judge.checks import result_without_verdicts
from verify.result import COMPARISON_FAILED, CaseResult, read_result
from verify.runner.child import Child, Ending, death
from verify.runner.directory import JUDGING, load_record
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
