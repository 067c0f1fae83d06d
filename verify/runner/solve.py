"""One solve in a process of its own: ``python -m verify.runner.solve JOB.json``.

Writes how many levels there are, if it is asked, then ``solution.json``/``.vtu`` and, last,
``outcome.json``; a process that dies without an outcome has failed, and its log says how. As one of
several MPI ranks it solves its part; the first rank writes.
"""

import contextlib
import errno
import sys
import traceback
from pathlib import Path
from typing import Any

from verify.errors import InputError, UnsupportedSceneError
from verify.files import read_json, write_json, write_whole
from verify.printable import one_line, words_of
from verify.processes import die_with_parent, peak_memory
from verify.result import COMPILING, CRITICAL_STEP, Status
from verify.runner.directory import LEVELS, emptied
from verify.runner.ranks import give_up, world

_WORTH_SAYING = 0.5  # seconds of compilation
_LONGEST = 400  # characters of a reason
_SAMPLE = 3  # repetitions: fewer have no spread
_LARGE = 30_000  # unknowns from which an eigenvalue takes longer than many a motion


def main(job_file: Path) -> None:
    """Solve what `job_file` says and write down how it went."""
    die_with_parent()
    job_file = job_file.resolve()  # a solver may change the working directory
    job, folder = read_json(job_file), job_file.parent
    try:
        comm = world() if job.get("ranks", 1) > 1 else None
    except InputError as error:
        with contextlib.suppress(OSError):  # the others write the same
            failed = {"status": Status.FAILED, "reason": str(error)}
            write_json(failed, folder / "outcome.json")
        return
    first = comm is None or comm.rank == 0
    outcome = solve_job(job, folder, first)
    if comm is not None:
        outcome.setdefault("notes", {})["ranks"] = str(comm.size)
    if first:
        _without_links(folder)
        write_json({"peak_memory": peak_memory(), **outcome}, folder / "outcome.json")
    if comm is not None and outcome["status"] != Status.SOLVED:
        give_up(comm, outcome, folder / "outcome.json")


def solve_job(
    job: dict[str, Any], folder: Path, store: bool = True, timed: bool = True
) -> dict[str, Any]:
    """Solve and `store`; every way to fail is an outcome with its reason.

    Only a solve that is `timed` computes its critical step. The machine is timed beside it if
    it is repeated often enough that anybody states its speed.
    """
    try:
        return _solved(job, folder, store, timed)
    except UnsupportedSceneError as refusal:
        return {"status": Status.REFUSED, "reason": one_line(refusal, _LONGEST)}
    except InputError as error:
        return {"status": Status.FAILED, "reason": one_line(error, _LONGEST)}
    except MemoryError:
        _leave_traceback()
        return {"status": Status.MEMORY, "reason": "the solver could not allocate memory"}
    except OSError as error:
        _leave_traceback()
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            return {"status": Status.FAILED, "reason": one_line(error, _LONGEST)}
        with contextlib.suppress(OSError):  # what it left is in the way of all others
            emptied(folder, kept=("job.json", "log.txt", LEVELS))
        return {"status": Status.FAILED, "reason": "the disk is full"}
    except BaseException as error:  # a solver may raise anything
        _leave_traceback()
        return {"status": Status.FAILED, "reason": words_of(error, _LONGEST)}


def _without_links(folder: Path) -> None:
    """Remove the links that a solver has planted: what they lead to is not ours to write."""
    for planted in [path for path in folder.iterdir() if path.is_symlink()]:
        planted.unlink()


def _leave_traceback() -> None:
    """Leave the traceback in the log, if the solver has left the log open."""
    with contextlib.suppress(Exception):
        traceback.print_exc()


def _solved(job: dict[str, Any], folder: Path, store: bool, timed: bool) -> dict[str, Any]:
    from verify.provenance import calibration_note, compile_times
    from verify.scene import restore_scene
    from verify.solution import checked_solution, write_solution
    from verify.solvers import find_solver
    from verify.solvers.interface import checked_levels, refusal_of, solver_in

    scene = restore_scene(job["scene"])
    solver = find_solver(solver_in(job["solver"]))
    if refusal := refusal_of(solver, scene):
        raise UnsupportedSceneError(refusal)
    if store and job.get("tell_levels"):
        _without_links(folder)
        write_whole(folder / LEVELS, str(checked_levels(solver.levels(scene))))
    with compile_times() as compiled:
        solution = checked_solution(
            solver.solve(scene, job["level"], repetitions=job["repetitions"], **job["parameters"])
        )
    if solution.dimension != scene.dimension:
        text = f"a solution in {solution.dimension}D; expected {scene.dimension}D, as the case is"
        raise InputError(text)
    if store:
        _without_links(folder)
        write_solution(solution, folder / "solution")
    sampled = max(map(len, solution.timings.values()), default=0) >= _SAMPLE
    return {
        "status": Status.SOLVED,
        "reason": "",
        "size": solution.size,
        "unknowns": solution.unknowns,
        "conforming": _conforms(solution, scene, job["level"]),
        "timings": solution.timings,
        "iterations": solution.iterations,
        "regularisations": [vars(entry) for entry in solution.regularisations],
        "peak_memory": peak_memory(),  # of the solve: eigenvalues come after it
        "notes": {
            **solution.notes,
            **({"calibration": calibration_note()} if timed and sampled else {}),
            **(_critical_step(solver, scene, job, solution.unknowns or 0) if timed else {}),
            **({COMPILING: f"{compiled.whole:.1f} s"} if compiled.whole > _WORTH_SAYING else {}),
        },
    }


def _conforms(solution: Any, scene: Any, level: int) -> bool:
    """Whether the unknowns sit on the nodes of the answer, and its facets carry the cut.

    A cut along faces of the background mesh needs no other one. Time that nobody would pay there
    is charged to nobody.
    """
    import numpy as np

    from verify.scene.mesh_position import mesh_position
    from verify.solvers.runs import grid_of

    corners = solution.cut_facets.reshape(-1, scene.dimension)
    if not len(corners) or solution.unknowns != solution.points.size:
        return False
    if scene.geometry.kind == "file" or level >= scene.mesh.count:  # a reference goes on
        return True
    counts = grid_of(scene, level)[0]
    if counts is None or mesh_position(scene.mesh.position).way:
        return True
    lower, upper = np.asarray(scene.geometry.lower), np.asarray(scene.geometry.upper)
    layers = (corners - lower) / (upper - lower) * counts
    return bool(np.abs(layers - np.rint(layers)).max() > 1e-9)


def _critical_step(solver: Any, scene: Any, job: dict[str, Any], unknowns: int) -> dict[str, str]:
    """Note the critical explicit step of the undeformed body with all cuts open, or why not."""
    system = getattr(solver, "system", None)
    if system is None or not (scene.analysis.kind == "dynamic" or "slivers" in scene.tags):
        return {}
    if unknowns > _LARGE:
        return {CRITICAL_STEP: f"not computed for more than {_LARGE} unknowns"}
    # only now: a fresh process takes longer to import them than many a solve takes
    from verify.system import checked_system, critical_step

    try:
        own = checked_system(system(scene, job["level"], **job["parameters"]))
        return {CRITICAL_STEP: f"{critical_step(own):.4g} s"}
    except Exception as problem:  # a guest may raise anything
        return {CRITICAL_STEP: f"not known: {one_line(problem, _LONGEST)}"}


if __name__ == "__main__":
    main(Path(sys.argv[1]))
