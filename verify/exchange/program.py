"""Any program as a solver: the case is exported, the program is run, its answer is read."""

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

from verify.errors import InputError, UnsupportedSceneError
from verify.exchange.export import export_case, read_answers
from verify.json_files import write_json
from verify.result import Status
from verify.scene import Scene
from verify.solution import Solution
from verify.solvers import check_parameters

_TAIL = 300
_FRAME = re.compile(r'File "([^"]+)", line (\d+), in (.+)')


class ProgramSolver:
    """A solver that is a program; subclass it and say how the program is called.

    Attributes
    ----------
    name : str
    command : sequence of str
        The program and its arguments. ``{folder}`` becomes the exported case, ``{level}`` the
        mesh level to solve; the program writes ``level-<k>/solution.json`` and its VTU there.
    conforming : bool
        Whether it wants the conforming meshes.
    parameters : mapping
        Names of the parameters that it takes, with their defaults.
    repeats : bool
        Whether it times its repetitions itself; else it is called as often.

    Notes
    -----
    The program finds ``request.json`` in the folder: ``level``, ``repetitions`` and all
    ``parameters``.
    A program that cannot do a case answers ``{"schema": 1, "refused": "why"}``. Its own
    ``timings`` are used if it gives some; else its wall time, start-up included, is taken and
    that is said in the notes.
    """

    name: str = "program"
    command: Sequence[str] = ()
    conforming: bool = False
    parameters: Mapping[str, Any] = {}
    repeats: ClassVar[bool] = False

    def refuses(self, scene: Scene) -> str | None:
        """Refuse nothing; the program itself may, and a subclass that knows better."""
        return None

    def levels(self, scene: Scene) -> int:
        """Return the number of mesh levels of the scene."""
        return scene.mesh.count

    def solve(self, scene: Scene, level: int, repetitions: int = 1, **parameters: Any) -> Solution:
        """Export `scene`, run the program, read its answer.

        Raises
        ------
        UnsupportedSceneError
            If the program refuses the scene.
        InputError
            If the program is not there, or its answer is missing or bad.
        RuntimeError
            If the program fails; with the end of what it said.
        """
        check_parameters(self.name, self, parameters)
        with tempfile.TemporaryDirectory(prefix="verify-") as place:
            folder = Path(place)
            export_case(scene, folder, [level], self.conforming)
            asked = {"level": level, "repetitions": repetitions if self.repeats else 1}
            handed = {**self.parameters, **parameters}
            write_json({**asked, "parameters": handed}, folder / "request.json")
            calls = 1 if self.repeats else repetitions
            walls = [self._run(folder, level) for _ in range(calls)]
            answers = read_answers(scene, folder)
        if level in answers.missing:
            status, why = answers.missing[level]
            if status is Status.REFUSED:
                raise UnsupportedSceneError(why)
            raise InputError(f"'{self.name}': {why}")
        solution = answers.solutions[level]
        if not solution.timings:
            solution.timings["program"] = walls
            solution.notes["timed"] = "wall time of the program, its start-up included"
        return solution

    def environment(self) -> dict[str, str]:
        """Return the environment that the program is run in."""
        return dict(os.environ)

    def _run(self, folder: Path, level: int) -> float:
        words = [word.format(folder=folder, level=level) for word in self.command]
        if not words or shutil.which(words[0]) is None:
            raise InputError(f"'{self.name}': no program '{words[0] if words else ''}'")
        start = perf_counter()
        done = subprocess.run(
            words, stdin=subprocess.DEVNULL, capture_output=True, text=True,
            env=self.environment(), errors="replace",
        )  # fmt: skip
        wall = perf_counter() - start
        if done.returncode:
            said = done.stderr.strip() or done.stdout.strip() or "said nothing"
            text = f"'{self.name}': {words[0]} ended with {done.returncode}"
            raise RuntimeError(f"{text}: {said.splitlines()[-1][-_TAIL:]}{_raised_at(said)}")
        return wall


def _raised_at(said: str) -> str:
    """Where a program in Python raised: its last own line, not one of what it is built on."""
    frames = [frame.groups() for frame in _FRAME.finditer(said)]
    own = [frame for frame in frames if "site-packages" not in frame[0]]
    return " ({}:{} in {})".format(*(own or frames)[-1]) if frames else ""
