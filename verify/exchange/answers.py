"""Answers of another program: a stored solution per mesh level, or why there is none."""

from dataclasses import dataclass, field
from pathlib import Path

from verify.errors import InputError
from verify.exchange.export import level_folder
from verify.json_files import read_json
from verify.printable import one_line
from verify.result import Status
from verify.runner.fingerprint import physics_digest
from verify.scene import Scene
from verify.solution import Solution, read_solution


@dataclass(frozen=True)
class Answers:
    """Solutions by level; for the other levels, how they ended and why.

    Attributes
    ----------
    solutions : dict of int to Solution
    missing : dict of int to (Status, str)
    """

    solutions: dict[int, Solution] = field(default_factory=dict)
    missing: dict[int, tuple[Status, str]] = field(default_factory=dict)


def read_answers(scene: Scene, folder: Path) -> Answers:
    """Read ``level-<k>/solution.json`` and its VTU files below `folder`.

    A program that cannot do a level answers ``{"schema": 1, "refused": "why"}``. A level whose
    answer is missing, damaged or of the wrong dimension has failed; the others count.

    Parameters
    ----------
    scene : Scene
    folder : Path
        Of the layout that `export_case` makes; it may be the exported directory itself.

    Raises
    ------
    InputError
        If there is no answer at all, or the folder was exported from another version of the case.
    """
    if not folder.is_dir():
        text = "no such directory; expected answers in level-<k>/solution.json"
        raise InputError(text, str(folder))
    _check_same_case(scene, folder)
    paths = [level_folder(folder, k) / "solution.json" for k in range(scene.mesh.count)]
    if not any(path.is_file() for path in paths):
        text = f"holds no answer; expected level-0/solution.json … for {len(paths)} levels"
        raise InputError(text, str(folder))
    answers = Answers()
    for level, path in enumerate(paths):
        if not path.is_file():
            reason = f"no answer for level {level} (no file {path.parent.name}/{path.name})"
            answers.missing[level] = Status.FAILED, reason
            continue
        try:
            if refusal := read_json(path).get("refused"):
                answers.missing[level] = Status.REFUSED, one_line(refusal)
                continue
            solution = read_solution(path.with_suffix(""))
            if solution.dimension != scene.dimension:
                text = f"a {solution.dimension}D solution; the case has {scene.dimension}"
                raise InputError(text, str(path))
        except InputError as error:
            answers.missing[level] = Status.FAILED, str(error)
        else:
            answers.solutions[level] = solution
    return answers


def _check_same_case(scene: Scene, folder: Path) -> None:
    """Refuse answers to another version of the case, where the export says which it was."""
    file = folder / "case.json"
    if not file.is_file():
        return
    exported = read_json(file)
    if exported.get("physics") != physics_digest(scene):
        raise InputError(
            f"was exported from '{exported.get('case')}', which is another case than "
            f"'{scene.name}' is now: export it again and solve that",
            str(file),
        )
