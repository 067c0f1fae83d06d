"""Trials of a solver: scenes solved in processes of their own, so that a crash is a finding.

``python -m verify.conformance.trials BATCH.json`` solves a batch in one process. It writes
``BATCH.ready`` once the solver is loaded, and an ``outcome.json`` after each trial; a trial that
kills the process is the first without one.
"""

import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.files import read_json, write_json
from verify.processes import die_with_parent
from verify.result import Status
from verify.runner.child import Child, death, telling_line, watch
from verify.runner.solve import solve_job
from verify.scene import Scene, scene_content
from verify.solution import Solution, read_solution
from verify.solvers import check_parameters, find_solver
from verify.solvers.interface import is_built_in, solver_in

_START_SECONDS = 120.0  # importing a solver may start MPI or compile


@dataclass(frozen=True)
class Trial:
    """Solve `scene` on mesh `level`; `name` tells trials of the same scene apart."""

    name: str
    scene: Scene
    level: int = 0


@dataclass(frozen=True)
class Outcome:
    """How a trial ended.

    `crashed` tells a process that died or was killed from an exception that was raised.
    """

    status: Status
    reason: str = ""
    solution: Solution | None = None
    crashed: bool = False


def solve_trials(
    solver: str,
    parameters: Mapping[str, Any],
    trials: Sequence[Trial],
    folder: Path,
    timeout: float,
    label: str = "batch",
) -> dict[str, Outcome]:
    """Solve `trials` one after the other in one process; begin a new one after a death.

    Parameters
    ----------
    solver : str
        Name, or ``module:Class``.
    parameters : mapping
        Parameters of its `solve`.
    trials : sequence of Trial
        With distinct names.
    folder : Path
        Where to work; a folder per trial is made in it.
    timeout : float
        Wall seconds for each trial.
    label : str
        Tells the batches in `folder` apart.

    Returns
    -------
    dict of str to Outcome
        By the name of the trial.

    Raises
    ------
    InputError
        If there is no such solver, it cannot be loaded, or has no such parameter.
    """
    for trial in trials:
        (folder / trial.name).mkdir()
        job = {
            "scene": scene_content(trial.scene),
            "solver": solver,
            "level": trial.level,
            "repetitions": 1,
            "parameters": dict(parameters),
        }
        write_json(job, folder / trial.name / "job.json")
    waiting = [trial.name for trial in trials]
    outcomes: dict[str, Outcome] = {}
    while waiting:
        child = _start(solver, parameters, waiting, folder / f"{label}-{len(waiting)}")
        how, why = _watch(child, [folder / name for name in waiting], timeout)
        while waiting and (folder / waiting[0] / "outcome.json").is_file():
            name = waiting.pop(0)
            outcomes[name] = _outcome(folder / name)
        if waiting:  # the first without an outcome killed the process
            outcomes[waiting.pop(0)] = Outcome(how, why, crashed=True)
    return outcomes


def _start(solver: str, parameters: Mapping[str, Any], names: list[str], stem: Path) -> Child:
    batch, log = stem.with_suffix(".json"), stem.with_suffix(".txt")
    write_json({"solver": solver, "parameters": dict(parameters), "trials": names}, batch)
    own = is_built_in(solver)  # forked from a warm process, if the caller keeps one
    return Child("verify.conformance.trials", batch, log, _START_SECONDS, float("inf"), own=own)


def _watch(child: Child, folders: list[Path], timeout: float) -> tuple[Status, str]:
    """Wait for the end of a batch, and explain it as if it had been a death."""
    ready, done = child.log.with_suffix(".ready"), -1

    def look() -> None:
        nonlocal done
        if ready.exists() and (count := _answered(folders)) > done:
            done, child.timeout = count, time.monotonic() - child.start + timeout

    ending = watch(child, look)
    if (refused := child.log.with_suffix(".refused")).exists():
        raise InputError(read_json(refused)["error"])
    if not ready.exists():
        raise InputError(f"the solver could not be loaded: {telling_line(child.log)}")
    if ending.killed_for == "timeout":
        return Status.TIMEOUT, f"no answer after {timeout:g} s"
    return death(child.log, ending, timeout, float("inf"))


def _answered(folders: list[Path]) -> int:
    return sum((folder / "outcome.json").is_file() for folder in folders)


def _outcome(folder: Path) -> Outcome:
    content = read_json(folder / "outcome.json")
    status, reason = Status(content["status"]), str(content["reason"])
    if status is not Status.SOLVED:
        return Outcome(status, reason)
    try:
        return Outcome(status, solution=read_solution(folder / "solution"))
    except InputError as error:
        return Outcome(Status.FAILED, f"its solution cannot be read back ({error.what})")
    finally:
        for file in folder.glob("solution*"):
            os.unlink(file)


def main(batch_file: Path) -> None:
    """Solve the trials of a batch, in order."""
    die_with_parent()
    batch = read_json(batch_file)
    try:
        name = solver_in(batch["solver"])
        check_parameters(name, find_solver(name), batch["parameters"])
    except InputError as error:
        write_json({"error": str(error)}, batch_file.with_suffix(".refused"))
        return
    batch_file.with_suffix(".ready").touch()
    for name in batch["trials"]:
        folder = batch_file.parent / name
        outcome = solve_job(read_json(folder / "job.json"), folder, timed=False)
        write_json(outcome, folder / "outcome.json")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
