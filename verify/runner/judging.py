"""The comparison of a finished case: ``python -m verify.runner.judging judge.json``.

Reads the stored solves of a case and has `verify.judge` compare and judge them. Writes
``result.json``, the error fields for the pictures and, last, ``judged.json`` with the key of the
solves that were compared.
"""

import sys
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from verify.compare.body import body_of
from verify.compare.errors import truth_of, write_error_field
from verify.errors import InputError
from verify.files import plain, read_json, write_json, write_plain, write_whole
from verify.judge.accuracy import assess_accuracy, not_compared
from verify.judge.models import adequacy_notice
from verify.judge.openings import with_openings
from verify.judge.verdict import with_verdicts
from verify.printable import words_of
from verify.processes import die_with_parent, keep_memory
from verify.result import (
    REFERENCE,
    CaseResult,
    Notice,
    NoticeKind,
    SolveRecord,
    Status,
    checked,
    error_picture,
    write_result,
)
from verify.runner.directory import (
    JUDGING,
    MEASURED,
    check_files,
    folder_name,
    load_record,
)  # fmt: skip
from verify.runner.fingerprint import digest_of
from verify.runner.mesh_faults import mesh_notices
from verify.scene import Scene, restore_scene
from verify.solution import Solution, read_solution
from verify.solvers.interface import is_built_in

_Solutions = dict[str, dict[int, Solution]]  # by solver and level
_WILD = 1e3  # sizes of its body: a solution that moves farther has no openings to look at


def main(question_file: Path) -> None:
    """Compare and judge what `question_file` says."""
    from reference.exact import exact_of

    die_with_parent()
    keep_memory()
    question, folder = read_json(question_file), question_file.parent
    root = Path(question["root"])
    scene = restore_scene(read_json(folder / "scene.json"))

    def announce(record: SolveRecord) -> None:
        write_whole(folder / JUDGING, at.get((record.solver, record.level), ""))

    unfit, where = question["unfit"], folder / JUDGING
    records, solutions, at = _stored(root, question["folders"], unfit, where)
    records = [
        not_compared(scene, record, unfit[name]) if name in unfit else record
        for record, name in zip(records, question["folders"], strict=True)
    ]
    exact = exact_of(scene)
    kept = _Measurements(folder, digest_of([question["key"], sorted(unfit)]))
    measured = assess_accuracy(scene, records, solutions, exact, announce, kept)
    solutions = _comparable(measured, solutions)
    measured = _with_openings(measured, scene, solutions, exact, announce)
    (folder / JUDGING).unlink(missing_ok=True)
    result: CaseResult = with_verdicts(scene, measured, question["judge_only"])
    notices = _adequacy(root, question["models"], scene, result)
    result = replace(result, notices=[*result.notices, *notices, *mesh_notices(scene)])
    result = replace(result, provenance=question["provenance"])
    try:
        drawn = _error_pictures(result, scene, solutions, exact, folder)
    except Exception:  # pictures cost nobody a verdict
        traceback.print_exc()
        drawn = {}
    pictures = {name: str(path.relative_to(root)) for name, path in drawn.items()}
    result = replace(result, pictures={**result.pictures, **pictures})
    write_result(result, folder / "result.json")
    write_json({"key": question["key"]}, folder / "judged.json")
    rmtree(folder / MEASURED, ignore_errors=True)


class _Measurements:
    """Solves measured by a comparison, kept in the folder of its case until that has ended.

    A comparison that was killed so goes on at the solve that it was at. What it kept holds for the
    same `key` only: the same solves, demands and code, and the same solves left out.
    """

    def __init__(self, folder: Path, key: str) -> None:
        self._folder, self._key = folder / MEASURED, key

    def measured(self, record: SolveRecord) -> SolveRecord | None:
        """Return a solve as it was measured before, or None."""
        where = self._file(record)
        try:
            content = read_json(where)
            record = checked(SolveRecord, content["record"], "record", str(where))
            return record if content["key"] == self._key else None
        except (InputError, KeyError, TypeError):
            return None

    def keep(self, record: SolveRecord) -> None:
        """Keep a solve that was measured."""
        self._folder.mkdir(exist_ok=True)
        kept = plain({"key": self._key, "record": asdict(record)})
        write_plain(kept, self._file(record))

    def _file(self, record: SolveRecord) -> Path:
        return self._folder / f"{folder_name(record.solver)}-{record.level}.json"


def _stored(
    root: Path, folders: Sequence[str], unfit: Mapping[str, str], at: Path
) -> tuple[list[SolveRecord], _Solutions, dict[tuple[str, int], str]]:
    """Read records and solutions; a solution that cannot be read is a failed solve.

    Each folder is written into the file `at` before its solution is read. The third that is
    returned is the folder by solver and level.
    """
    records: list[SolveRecord] = []
    solutions: _Solutions = {}
    for name in folders:
        write_whole(at, name)
        record = load_record(root / name)
        if record.status is Status.SOLVED and name not in unfit:
            try:
                check_files(root / name)
                solution = read_solution(root / name / "solution")
            except InputError as error:
                record = replace(record, status=Status.FAILED, reason=str(error))
            else:
                record = replace(record, solution=f"{name}/solution")
                solutions.setdefault(record.solver, {})[record.level] = solution
        records.append(record)
    at.unlink()
    where = {(r.solver, r.level): name for r, name in zip(records, folders, strict=True)}
    return records, solutions, where


def _adequacy(
    root: Path, models: Mapping[str, Sequence[str]], scene: Scene, result: CaseResult
) -> list[Notice]:
    """State what the model of the case costs beside others that were solved."""
    found = []
    for model, folders in models.items():
        solutions: dict[int, Solution] = {}
        for name in folders:
            record = load_record(root / name)
            if record.status is Status.SOLVED:
                solutions[record.level] = read_solution(root / name / "solution")
        try:
            found.append(adequacy_notice(scene, model, solutions, result))
        except Exception as error:  # it costs nobody a verdict
            traceback.print_exc()
            text = f"was not measured: {words_of(error)}"
            found.append(Notice(NoticeKind.ADEQUACY, model, None, text))
    return found


def _with_openings(
    result: CaseResult, scene: Scene, solutions: _Solutions, *rest: Any
) -> CaseResult:
    """Add openings and overlaps; if a guest's fail, of built-in solvers alone."""
    own = {name: one for name, one in solutions.items() if is_built_in(name)}
    for given in (solutions, own):
        try:
            return with_openings(result, scene, given, *rest)
        except Exception as error:
            traceback.print_exc()
            text = f"cannot be had: {words_of(error)}"
            about = Notice(NoticeKind.UNAVAILABLE, "openings and overlaps", None, text)
            result = replace(result, notices=[*result.notices, about])
    return result


def _comparable(result: CaseResult, solutions: _Solutions) -> _Solutions:
    """Leave out the solutions that could not be compared, or move out of all proportion."""
    fit = {
        (s.solver, s.level)
        for s in result.solves
        if s.status is Status.SOLVED and not s.not_compared
    }
    kept = {
        name: {k: s for k, s in own.items() if (name, k) in fit and not _is_wild(s)}
        for name, own in solutions.items()
    }
    return {name: own for name, own in kept.items() if own}


def _is_wild(solution: Solution) -> bool:
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))
    return bool(np.abs(solution.displacement).max() > _WILD * size)


def _error_pictures(
    result: CaseResult, scene: Scene, solutions: _Solutions, exact: Any, folder: Path
) -> dict[str, Path]:
    """Write the error field of the finest solution of each solver, if there is a reference."""
    body = body_of(scene)
    judged = [own[max(own)] for solver, own in solutions.items() if solver != REFERENCE]
    truth = truth_of(scene, solutions.get(REFERENCE, {}), judged, exact)
    cuts = {(solve.solver, solve.level): solve.cut for solve in result.solves}
    pictures: dict[str, Path] = {}
    for solver, own in solutions.items():
        if solver == REFERENCE or truth is None:
            continue
        path = folder / f"error_field_{folder_name(solver)}.vtu"
        try:
            finest = own[max(own)]
            cut = cuts[solver, max(own)]
            write_error_field(finest, truth(float(finest.times[-1])), path, body, cut)
        except Exception:  # a solution that cannot be drawn costs nobody else a picture
            traceback.print_exc()
            continue
        pictures[error_picture(solver)] = path
    return pictures


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
