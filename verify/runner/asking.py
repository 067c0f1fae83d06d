"""A solver being asked what it refuses, in processes of its own, however it behaves.

The time limit of a solve is that of each question too. A solver that hangs or dies at one case
fails on that case; about the others it is asked again.
"""

import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json, write_json
from verify.result import Status
from verify.runner.child import Child, Ending
from verify.runner.log import telling_line
from verify.runner.survey import ANSWER, ASKING
from verify.scene import Scene, scene_content
from verify.solvers.interface import is_built_in

_LOADING_SECONDS = (60.0, 300.0)  # for importing a solver: at least, at most


class Asking:
    """Questions about `scenes` to the solver `name`, under way; `poll` gives the answers.

    Parameters
    ----------
    name : str
    scenes : sequence of Scene
    parameters : mapping of str
        Parameters that it is to have, with their values.
    folder : Path
        Where to work; made here.
    timeout : float
        Wall seconds for each question; importing the solver has 60 at least.
    memory : float or None
        Bytes of resident memory.
    """

    def __init__(
        self,
        name: str,
        scenes: Sequence[Scene],
        parameters: Mapping[str, Any],
        folder: Path,
        timeout: float,
        memory: float | None,
    ) -> None:
        self.name, self._left, self._parameters = name, list(scenes), dict(parameters)
        self._folder, self._timeout = folder, timeout
        self._memory = memory or 0.8 * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        self._failures: dict[str, dict[str, Any]] = {}
        self._place, self._at = folder, -1
        self._child = self._asked()

    def poll(self) -> dict[str, Any] | None:
        """Look once; return what `verify.runner.survey.survey` does when all is answered."""
        number = self._number()
        if number is not None and number != self._at:
            self._at = number
            self._child.timeout = time.monotonic() - self._child.start + self._timeout
        ending = self._child.poll()
        if ending is None:
            return None
        try:
            answer = read_json(self._place / ANSWER)
        except InputError:
            return self._without_answer(self._number(), ending)
        return {**answer, "cases": {**answer.get("cases", {}), **self._failures}}

    def kill(self) -> None:
        """End it."""
        self._child.kill()

    def _asked(self) -> Child:
        self._place, self._at = self._folder / str(len(self._left)), -1
        self._place.mkdir(parents=True)
        question = self._place / "question.json"
        contents = [scene_content(scene) for scene in self._left]
        asked = {"solver": self.name, "scenes": contents, "parameters": self._parameters}
        write_json(asked, question)
        least, most = _LOADING_SECONDS
        limit = min(most, max(least, self._timeout))
        log, own = self._place / "log.txt", is_built_in(self.name)
        return Child("verify.runner.survey", question, log, limit, self._memory, own=own)

    def _number(self) -> int | None:
        try:
            return int((self._place / ASKING).read_text())
        except (OSError, ValueError):
            return None

    def _without_answer(self, number: int | None, ending: Ending) -> dict[str, Any] | None:
        if number is None:
            said = telling_line(self._child.log)
            return {"error": f"could not be loaded: {said}"}
        status, how = Status.FAILED, f"died when asked about the case: {self._said(ending)}"
        if ending.killed_for == "timeout":
            how = f"killed after {self._timeout:g} s without saying whether it takes the case"
            status = Status.TIMEOUT
        elif ending.killed_for:
            status, how = Status.MEMORY, "killed for its memory when asked about the case"
        scene = self._left.pop(number)
        self._failures[scene.name] = {"failure": how, "status": status, "levels": 0}
        if not self._left:
            return {"error": None, "source": "", "cases": self._failures}
        self._child = self._asked()
        return None

    def _said(self, ending: Ending) -> str:
        code = ending.returncode
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        return f"{telling_line(self._child.log)} ({how})"
