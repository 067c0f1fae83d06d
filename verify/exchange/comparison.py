"""Answers of another program, compared and judged like those of the own solvers.

The run directory is an ordinary one: the answers are put into it as solves of a solver of their
own, and `verify.runner` runs what they are compared with and judges all of them together.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from verify.errors import InputError
from verify.exchange.export import Answers
from verify.files import read_json
from verify.result import CaseResult, SolveRecord, Status
from verify.runner.directory import Job, RunDirectory, emptied, solution_files, store_record
from verify.runner.fingerprint import digest_of, file_digest
from verify.runner.run import run_cases
from verify.runner.selection import Options
from verify.runner.work import Progress
from verify.scene import Scene
from verify.solution import Solution, write_solution
from verify.solvers import solver_names

_NAME = re.compile(r"[A-Za-z][\w.+-]*")


def compare_answers(
    scenes: Sequence[Scene],
    answers: Mapping[str, Answers],
    name: str,
    out: Path,
    options: Options,
    progress: Progress,
    judged_as: str | None = None,
    command: str = "",
) -> list[CaseResult]:
    """Compare the `answers` of the program `name` to `scenes` and judge them.

    Parameters
    ----------
    scenes : sequence of Scene
    answers : mapping of str to Answers
        By the name of the scene.
    name : str
        What the program is called in the report.
    out : Path
        Run directory, new, or of an earlier import of the same cases: then the reference is
        reused, and other programs stay beside this one.
    options : Options
        Limits of the solves; its ``solvers`` run beside the answers, with those that the checks
        compare with and the reference.
    progress : Progress
    judged_as : str, optional
        The checks that the cases make of this solver by its name are made of `name` too.
    command : str
        The command line, for the record.

    Raises
    ------
    InputError
        If the name is taken or not a name, or a case or `out` is bad.
    RunStoppedError
        If a signal came while the solvers beside it ran.
    """
    if not _NAME.fullmatch(name) or name in solver_names():
        own = ", ".join(solver_names())
        raise InputError(f"'{name}' cannot name a program; expected a word other than {own}")
    names = tuple(dict.fromkeys([*_imported_before(out), name]))
    judged = _judged_scenes(scenes, judged_as, names)
    options = replace(options, parameters={}, imported=names)

    def put(directory: RunDirectory) -> None:
        for scene in scenes:
            _store(scene, answers[scene.name], name, directory)

    return run_cases(judged, out, options, progress, command, before=put).results


def _imported_before(out: Path) -> list[str]:
    file = out / "run.json"
    options = read_json(file).get("options", {}) if file.is_file() else {}
    return list(options.get("imported", []))


def _judged_scenes(
    scenes: Sequence[Scene], judged_as: str | None, names: Sequence[str]
) -> list[Scene]:
    """Make the checks that name the solver `judged_as` of each of `names` instead."""
    if judged_as is None:
        return list(scenes)
    made = {check.solver for scene in scenes for check in scene.acceptance} - {None}
    if judged_as not in made:
        own = ", ".join(sorted(filter(None, made))) or "none by its name"
        where = ", ".join(scene.name for scene in scenes)
        raise InputError(f"{where} makes no check of '{judged_as}'; it does of {own}")
    return [_judged(scene, judged_as, names) for scene in scenes]


def _judged(scene: Scene, judged_as: str, names: Sequence[str]) -> Scene:
    checks = [
        check.model_copy(update={"solver": name})
        for check in scene.acceptance
        for name in (names if check.solver == judged_as else [check.solver])
    ]
    changed = scene.model_copy(update={"acceptance": checks})
    known = [one for one in scene.known_findings if any(map(one.concerns, changed.checks))]
    return changed.model_copy(update={"known_findings": known})


def _store(scene: Scene, answers: Answers, name: str, directory: RunDirectory) -> None:
    """Store every answer, and every missing one, as a solve of `name`."""
    for level in sorted({*answers.solutions, *answers.missing}):
        folder = directory.solve_folder(scene.name, name, level)
        emptied(folder)
        job = Job(scene.name, name, level, 0, "", folder)
        if level in answers.missing:
            store_record(job, job.blank(*answers.missing[level]))
            continue
        solution = answers.solutions[level]
        write_solution(solution, folder / "solution")
        key = digest_of([file_digest(path) for path in solution_files(folder)])
        store_record(replace(job, key=key), _record(job, solution))


def _record(job: Job, solution: Solution) -> SolveRecord:
    return replace(
        job.blank(Status.SOLVED, ""),
        size=solution.size if solution.size > 0 else None,
        unknowns=solution.unknowns or None,
        timings=solution.timings,
        iterations=solution.iterations,
        regularisations=list(solution.regularisations),
        notes={**solution.notes, "imported": "from files; its timings are what it says itself"},
    )
