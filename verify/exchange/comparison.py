"""Answers of another program, compared and judged like those of the own solvers.

The run directory is an ordinary one: the solvers that the answers are compared with, and the
reference, are run by `verify.runner`; then the answers are put beside them as solves of a solver
of their own, and the comparison of the runner judges all of them together.
"""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.exchange.export import Answers
from verify.files import read_json, write_json
from verify.provenance import provenance
from verify.result import CaseResult, SolveRecord, Status
from verify.runner import Options, Progress, run_cases
from verify.runner.checking import check_scene
from verify.runner.child import watch
from verify.runner.comparing import Comparison
from verify.runner.directory import (
    Job,
    RunDirectory,
    claimed,
    emptied,
    solution_files,
    store_record,
    write_run,
)
from verify.runner.fingerprint import digest_of, file_digest
from verify.scene import Scene, scene_content
from verify.solution import Solution, write_solution
from verify.solvers import solver_names

_NAME = re.compile(r"[A-Za-z][\w.+-]*")


def compare_answers(
    scene: Scene,
    answers: Answers,
    name: str,
    out: Path,
    options: Options,
    progress: Progress,
    judged_as: str | None = None,
    command: str = "",
) -> CaseResult:
    """Compare the `answers` of the program `name` to `scene` and judge them.

    Parameters
    ----------
    scene : Scene
    answers : Answers
    name : str
        What the program is called in the report.
    out : Path
        Run directory, new, or of an earlier import of the same case: then the reference is
        reused, and other programs stay beside this one.
    options : Options
        Limits of the solves; its ``solvers`` run beside the answers, with those that the checks
        compare with and the reference.
    progress : Progress
    judged_as : str, optional
        The checks that the case makes of this solver by its name are made of `name` too.
    command : str
        The command line, for the record.

    Raises
    ------
    InputError
        If the name is taken or not a name, or the case or `out` is bad.
    RunStoppedError
        If a signal came while the solvers beside it ran.
    """
    if not _NAME.fullmatch(name) or name in solver_names():
        own = ", ".join(solver_names())
        raise InputError(f"'{name}' cannot name a program; expected a word other than {own}")
    check_scene(scene)
    names = list(dict.fromkeys([*_imported_before(out), name]))
    judged = _judged_scene(scene, judged_as, names)
    options = replace(options, solvers=_beside(judged, options, names), parameters={})
    if options.solvers:
        run_cases([_with_acceptance(scene, [])], out, options, _Solving(progress), command)
    identity = {"cases": [scene.name], "options_of_result": options.of_result()}
    with claimed(out, identity) as directory:
        origin = provenance()
        record = {
            **identity,
            "command": command,
            "started": origin["date"],
            "finished": None,
            "options": options.record(),
            "provenance": origin,
            "imported": names,
        }
        write_run(directory, record)
        _store(scene, answers, name, directory)
        result = _assess(judged, directory, options, origin)
        progress.judged(result)
        write_run(directory, {**record, "finished": provenance()["date"]})
    return result


class _Solving:
    """Progress of the solves alone: the case is judged later, with the answers."""

    def __init__(self, progress: Progress) -> None:
        self.planned, self.started, self.solved = (
            progress.planned,
            progress.started,
            progress.solved,
        )

    def judged(self, result: CaseResult) -> None: ...


def _imported_before(out: Path) -> list[str]:
    file = out / "run.json"
    return list(read_json(file).get("imported", [])) if file.is_file() else []


def _judged_scene(scene: Scene, judged_as: str | None, names: list[str]) -> Scene:
    """Make the checks that name the solver `judged_as` of each of `names` instead."""
    if judged_as is None:
        return scene
    made = {check.solver for check in scene.acceptance if check.solver is not None}
    if judged_as not in made:
        own = ", ".join(sorted(made)) or "none by its name"
        raise InputError(f"{scene.name} makes no check of '{judged_as}'; it does of {own}")
    checks = [
        one
        for check in scene.acceptance
        for one in (
            [check.model_copy(update={"solver": name}) for name in names]
            if check.solver == judged_as
            else [check]
        )
    ]
    return _with_acceptance(scene, checks)


def _with_acceptance(scene: Scene, checks: list[Any]) -> Scene:
    changed = scene.model_copy(update={"acceptance": checks})
    known = [one for one in scene.known_findings if any(map(one.concerns, changed.checks))]
    changed = changed.model_copy(update={"known_findings": known})
    changed._name, changed._file, changed._row = scene.name, scene.file, scene.row
    return changed


def _beside(judged: Scene, options: Options, names: list[str]) -> tuple[str, ...]:
    """Names of the solvers that have to run beside the answers."""
    compared = [check.compared for check in judged.acceptance if check.compared]
    reference = [] if judged.judged_by_exact else ["reference"]
    wanted = [*options.solvers, *compared, *reference]
    return tuple(dict.fromkeys(solver for solver in wanted if solver not in names))


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


def _assess(
    scene: Scene,
    directory: RunDirectory,
    options: Options,
    origin: dict[str, Any],
) -> CaseResult:
    """Have the comparison of the runner judge every solve that lies in the case's folder."""
    folder = directory.case_folder(scene.name)
    write_json(scene_content(scene), folder / "scene.json")
    solves = sorted(path.parent for path in folder.glob("*/record.json"))
    (folder / "result.json").unlink(missing_ok=True)
    key = digest_of([scene_content(scene), [file_digest(s / "record.json") for s in solves]])
    memory = options.memory or 0.8 * origin["memory"]
    comparison = Comparison(
        scene, key, (), solves, {}, folder, directory.root, origin, options.timeout, memory
    )
    return watch(comparison)
