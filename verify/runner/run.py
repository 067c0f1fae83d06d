"""The run: solves in parallel processes, then the comparison of each finished case.

Signals (Ctrl-C) are handled between two steps, so that nothing is left half written. A failed
verdict (exit code 1) outranks a failed solve (3), so that retries on code 3 do not hide it: FAIL is
given only if the whole interval violates the limit, which missing solves cannot change. A FAIL that
its case lists as a known finding does not count.
"""

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Any

from verify.errors import InputError, RunStoppedError
from verify.processes import start_server
from verify.provenance import provenance
from verify.result import COMPARISON_FAILED, CaseResult, Status, Verdict
from verify.runner.checking import check_scene
from verify.runner.directory import RunDirectory, claimed, folder_name, write_run
from verify.runner.engines import ClusterEngine
from verify.runner.fingerprint import code_of_solver
from verify.runner.loading import load_solvers
from verify.runner.plan import check_judged, plan_case, solvers_of, stored_beside
from verify.runner.ranks import mpiexec
from verify.runner.references import REFERENCE, ReferenceBundle
from verify.runner.selection import Options
from verify.runner.work import Progress, Work
from verify.scene import Scene

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
ALL_PASS = 0
VERDICT_FAILED = 1
SOLVER_FAILED = 3
NOTHING_RAN = 4
ONLY_WARNINGS = 5
_BROKEN = (Status.FAILED, Status.TIMEOUT, Status.MEMORY)


class StopRequest:
    """Remembers the first signal that asked the run to stop."""

    signum: int | None = None

    def check(self) -> None:
        """Raise `RunStoppedError` if a signal came."""
        if self.signum is not None:
            raise RunStoppedError(self.signum)


@contextmanager
def listening() -> Iterator[StopRequest]:
    """Turn SIGINT, SIGTERM and SIGHUP into a `StopRequest` for the time of the block."""
    request = StopRequest()

    def note(signum: int, _frame: FrameType | None) -> None:
        request.signum = request.signum or signum

    before = {s: signal.getsignal(s) for s in _SIGNALS}
    for s in _SIGNALS:
        if before[s] != signal.SIG_IGN:  # nohup stays nohup
            signal.signal(s, note)
    try:
        yield request
    finally:
        for s, handler in before.items():
            signal.signal(s, handler)


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
    before: Callable[[RunDirectory], None] | None = None,
) -> RunSummary:
    """Solve, compare and judge `scenes` into the directory `out`; resume a run that is there.

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
    before : callable, optional
        Puts answers of ``options.imported`` into the run directory.

    Raises
    ------
    InputError
        If a case or `out` is bad, or there is no mpiexec for several ranks; then nothing was
        written.
    RunStoppedError
        If SIGINT, SIGTERM or SIGHUP came; finished solves stay and are reused next time.
    OSError
        If the directory cannot be written (disk full).
    """
    for scene in scenes:
        check_scene(scene)
    identity = {"cases": [scene.name for scene in scenes], "options_of_result": options.of_result()}
    check_judged(scenes, options)
    if options.ranks > 1 and not options.cluster:
        mpiexec()  # or say now that there is none
    bundle = ReferenceBundle(options.references) if options.references else None
    limits = options.timeout, options.memory
    cluster = ClusterEngine(options.cluster, *limits) if options.cluster else None
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
        solved = bundle is None and any(
            REFERENCE in solvers_of(scene, options) and stored_beside(scene, options) is None
            for scene in scenes
        )
        needed = [name for name in names if solved or name != REFERENCE]
        loaded = load_solvers(needed, options, stop.check)
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
            if before is not None:
                before(directory)
            plans = [plan_case(scene, options, loaded, directory, bundle) for scene in scenes]
            work = Work(plans, directory, options, origin, progress, bundle, cluster)
            results = work.until_done(stop.check)
            write_run(directory, {**record, "finished": _now()})
    return RunSummary(out, results, work.reused)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def exit_code(results: Sequence[CaseResult], strict: bool = False) -> int:
    """Return the exit code of a run that ended with `results`.

    Parameters
    ----------
    results : sequence of CaseResult
    strict : bool
        Whether an undecided verdict, a refusal, a warning, or a case without any verdict counts.
    """
    judged = [record for result in results for record in result.verdicts]
    verdicts = [record.verdict for record in judged]
    statuses = [solve.status for result in results for solve in result.solves]
    if any(record.counts_as_failed for record in judged):
        return VERDICT_FAILED
    uncompared = [solve.not_compared for result in results for solve in result.solves]
    if (
        Verdict.ERROR in verdicts
        or any(status in _BROKEN for status in statuses)
        or any(why.startswith(COMPARISON_FAILED) for why in uncompared)
    ):
        return SOLVER_FAILED
    if Status.SOLVED not in statuses:
        return NOTHING_RAN
    doubtful = Verdict.UNDECIDED in verdicts or Status.REFUSED in statuses
    doubtful |= any(not result.verdicts or result.warnings for result in results)
    return ONLY_WARNINGS if strict and doubtful else ALL_PASS
