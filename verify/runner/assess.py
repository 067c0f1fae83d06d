"""The comparison of a finished case: ``python -m verify.runner.assess judge.json``.

Reads the stored solves of a case, has `verify.study` compare and judge them, and writes
``result.json``, the error fields for the pictures and, last, ``judged.json`` with the key of what
was compared.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from verify.compare.body import body_of
from verify.compare.locate import Field
from verify.compare.motion import ExactMotion
from verify.compare.realised import cut_deviation, field_of
from verify.errors import InputError
from verify.json_files import read_json, write_json
from verify.result import CaseResult, SolveRecord, Status, error_picture, write_result
from verify.runner.childhood import die_with_parent
from verify.runner.directory import folder_name
from verify.runner.error_field import write_error_field
from verify.runner.job import load_record
from verify.scene import Scene, restore_scene
from verify.solution import Solution, read_solution
from verify.study.accuracy import assess_accuracy
from verify.study.closing import with_openings

__all__ = ["main"]

REFERENCE = "reference"


def main(question_file: Path) -> None:
    """Compare and judge what `question_file` says."""
    die_with_parent()
    question, folder = read_json(question_file), question_file.parent
    root = Path(question["root"])
    scene = restore_scene(read_json(folder / "scene.json"))
    records, solutions = _stored(root, question["folders"])
    exact = _exact(scene)
    result: CaseResult = assess_accuracy(scene, records, solutions, exact, question["judge_only"])
    result = with_openings(result, scene, solutions, exact)
    result = replace(result, provenance=question["provenance"])
    drawn = _error_pictures(scene, solutions, exact, folder)
    pictures = {name: str(path.relative_to(root)) for name, path in drawn.items()}
    result = replace(result, pictures={**result.pictures, **pictures})
    write_result(result, folder / "result.json")
    write_json({"key": question["key"]}, folder / "judged.json")


def _stored(
    root: Path, folders: Sequence[str]
) -> tuple[list[SolveRecord], dict[str, dict[int, Solution]]]:
    """Read records and solutions; a solution that cannot be read is a failed solve."""
    records: list[SolveRecord] = []
    solutions: dict[str, dict[int, Solution]] = {}
    for name in folders:
        record = load_record(root / name)
        if record.status is Status.SOLVED:
            try:
                solution = read_solution(root / name / "solution")
            except InputError as error:
                record = replace(record, status=Status.FAILED, reason=str(error))
            else:
                record = replace(record, solution=f"{name}/solution")
                solutions.setdefault(record.solver, {})[record.level] = solution
        records.append(record)
    return records, solutions


def _exact(scene: Scene) -> Any:
    if scene.exact is None:
        return None
    from reference.exact import exact_solution

    return exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)


def _error_pictures(
    scene: Scene, solutions: dict[str, dict[int, Solution]], exact: Any, folder: Path
) -> dict[str, Path]:
    """Write the error field of the finest solution of each solver, if there is a reference."""
    references = solutions.get(REFERENCE, {})
    truth: Field | None = None
    body = body_of(scene)
    if scene.judged_by_exact:
        truth = ExactMotion(exact).at(scene.analysis.duration)
    elif references:
        judged = (own for solver, own in solutions.items() if solver != REFERENCE)
        deviation = max((cut_deviation(own[max(own)], body) for own in judged), default=0.0)
        truth = field_of(references[max(references)], body, deviation=deviation)
    pictures: dict[str, Path] = {}
    for solver, own in solutions.items():
        if solver == REFERENCE or truth is None:
            continue
        path = folder / f"error_field_{folder_name(solver)}.vtu"
        write_error_field(own[max(own)], truth, path, body)
        pictures[error_picture(solver)] = path
    return pictures


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
