"""The run: solves in parallel processes, then the comparison of each finished case."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.processes import start_server
from verify.provenance import provenance
from verify.result import CaseResult
from verify.runner.checking import check_scene
from verify.runner.cluster import ClusterEngine
from verify.runner.directory import claimed, folder_name, write_run
from verify.runner.fingerprint import code_of_solver
from verify.runner.interruption import listening
from verify.runner.loading import load_solvers
from verify.runner.options import Options
from verify.runner.plan import check_judged, plan_case, solvers_of
from verify.runner.ranks import mpiexec
from verify.runner.reference_bundle import ReferenceBundle
from verify.runner.reference_cache import REFERENCE
from verify.runner.work import Progress, Work
from verify.scene import Scene


@dataclass(frozen=True)
class RunSummary:
    """What a finished run left: results by case, and how many solves were reused."""

    directory: Path
    results: list[CaseResult]
    reused: int


def run_cases(
    scenes: Sequence[Scene],
    out: Path,
    options: Options,
    progress: Progress,
    command: str = "",
    drawings: Path | None = None,
) -> RunSummary:
    """Solve, compare and judge `scenes` into the directory `out`; resume what is there.

    Parameters
    ----------
    scenes : sequence of Scene
    out : Path
        A directory that does not exist, is empty, or holds an unfinished or finished run of
        the same cases and options.
    options : Options
    progress : Progress
    command : str
        The command line, for the record.
    drawings : Path, optional
        Folder into which each case is drawn for the report as soon as it is judged.

    Raises
    ------
    InputError
        If a case or `out` is bad, or there is no mpiexec for several ranks; then nothing was
        written.
    RunStoppedError
        If SIGINT, SIGTERM or SIGHUP came; what is finished stays and is reused next time.
    OSError
        If the directory cannot be written (disk full).
    """
    for scene in scenes:
        check_scene(scene)
    identity = {
        "cases": [scene.name for scene in scenes],
        "options_of_result": options.of_result(),
    }
    check_judged(scenes, options)
    if options.ranks > 1 and not options.cluster:
        mpiexec()  # or say now that there is none
    bundle = ReferenceBundle(options.references) if options.references else None
    cluster = (
        ClusterEngine(options.cluster, options.timeout, options.memory) if options.cluster else None
    )
    names = list(dict.fromkeys(n for scene in scenes for n in solvers_of(scene, options)))
    if len(set(map(folder_name, names))) < len(names):
        said = f"{', '.join(sorted(names))}: two would have the same folder"
        raise InputError(f"{said}; expected other parameters", "--solver")
    with listening() as stop:
        origin = provenance()
        start_server()
        for name in names:  # asked below; the server is still loading
            code_of_solver(name)
        if bundle is not None:
            for scene in scenes:
                if REFERENCE in solvers_of(scene, options):
                    bundle.levels(scene)  # or say now that there are none
        needed = [name for name in names if bundle is None or name != REFERENCE]
        loaded = load_solvers(needed, options, stop)
        with claimed(out, identity) as directory:
            record: dict[str, Any] = {
                **identity,
                "command": command,
                "started": _now(),
                "finished": None,
                "options": options.record(),
                "solvers": names,
                "provenance": origin,
            }
            write_run(directory, record)
            plans = [plan_case(scene, options, loaded, directory, bundle) for scene in scenes]
            work = Work(plans, directory, options, origin, progress, bundle, cluster, drawings)
            results = work.until_done(stop)
            write_run(directory, {**record, "finished": _now()})
    return RunSummary(out, results, work.reused)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
