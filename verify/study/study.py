"""The shape of every study: what it solves, its rows, its findings, and the files of both.

A study asks `Making` for its solves: scenes by the runner, single parts as tasks. Every solve and
every part runs in a watched process with limits of time and memory, and is kept: the same command
resumes a study that was stopped. Its result is a `Study` with rows (a table) and findings
(sentences with verdicts). It is written as versioned JSON and CSV, and one renderer makes a page.
"""

import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from verify.errors import InputError
from verify.files import plain, write_json, write_whole
from verify.printable import csv_text
from verify.provenance import provenance
from verify.result import CaseResult, SolveRecord, Status, Verdict
from verify.runner.directory import RunDirectory
from verify.runner.fingerprint import cache_folder, digest_of
from verify.runner.run import run_cases
from verify.runner.selection import Options
from verify.runner.tasks import Limits, Task, made
from verify.runner.work import Progress
from verify.scene import Scene
from verify.solution import Solution, read_solution


@dataclass(frozen=True)
class Finding:
    """What a study has to say.

    Attributes
    ----------
    topic : str
    sentence : str
        With the numbers.
    expected : str
        The stated limit or the known result against which it is held.
    verdict : Verdict or None
        PASS if it came out as expected, FAIL if not, UNDECIDED if the numbers do not tell or there
        are none; None for a finding without a limit.
    whose : str
        Whose claim `expected` is, if it is not simply the limit of the study.
    """

    topic: str
    sentence: str
    expected: str
    verdict: Verdict | None
    whose: str = ""


def held(kept: bool | None) -> Verdict:
    """Return the verdict on a limit that is kept, broken, or neither for certain (None)."""
    return Verdict.UNDECIDED if kept is None else Verdict.PASS if kept else Verdict.FAIL


SCHEMA = 1


@dataclass(frozen=True, kw_only=True)
class Study:
    """What a study found.

    Attributes
    ----------
    findings : list of Finding
    seconds : float
        Wall time.
    """

    findings: list[Finding]
    seconds: float = 0.0

    def as_record(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return asdict(self)

    def rows(self) -> list[dict[str, Any]]:
        """Return the lines of its table, all with the same keys."""
        raise NotImplementedError

    def tables(self) -> dict[str, list[dict[str, Any]]]:
        """Return further tables by their names, for files of their own."""
        return {}


def write_study(directory: Path, kind: str, study: Study, command: str) -> Path:
    """Write ``<kind>.json``, ``<kind>.csv`` and further tables; each file is replaced in one step.

    Parameters
    ----------
    directory : Path
        Made if it is not there.
    kind : str
        Name of the study, ``slivers`` or ``energy``.
    study : Study
        Numbers that are not finite, for which JSON has no word, become null.
    command : str
        What was typed.

    Returns
    -------
    Path
        Of the JSON record.

    Raises
    ------
    InputError
        If the directory cannot be made because a file is in its place.
    """
    make_directory(directory)
    document = {
        "schema": SCHEMA,
        "kind": f"{kind} study",
        "command": command,
        "provenance": provenance(),
        **study.as_record(),
    }
    target = directory / f"{kind}.json"
    write_json(document, target)
    for name, listed in {kind: study.rows(), **study.tables()}.items():
        table = csv_text(list(listed[0]) if listed else [], listed)
        write_whole(directory / f"{name}.csv", table)
    return target


def make_directory(directory: Path) -> None:
    """Make the directory, if it is not there, and see whether files can be made in it.

    Raises
    ------
    InputError
        If a file is in its place, or it may not be made or written.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=directory):
            pass
    except (FileExistsError, NotADirectoryError):
        raise InputError("is a file; expected a directory to write into", str(directory)) from None
    except PermissionError:
        raise InputError("may not be written", str(directory)) from None


@dataclass(frozen=True)
class Solved:
    """A scene that was run: its result, and the solutions by solver and level."""

    scene: Scene
    result: CaseResult
    solutions: Mapping[str, Mapping[int, Solution]]

    def solution(self, solver: str, level: int) -> Solution:
        """Return one solution.

        Raises
        ------
        InputError
            If there is none, with the reason.
        """
        try:
            return self.solutions[solver][level]
        except KeyError:
            reason = self.reason(solver) or "not run"
            text = f"'{self.scene.name}' was not solved by {solver} on level {level}: {reason}"
            raise InputError(text) from None

    def reason(self, solver: str) -> str:
        """Why a solver has not solved all that it was to solve; empty if it has."""
        reasons = {r.reason for r in self.result.solves if r.solver == solver and r.reason}
        return "; ".join(sorted(reasons))


class _Unseen:
    """Progress that nobody is shown."""

    def planned(self, solves: int, cases: int) -> None: ...
    def started(self, label: str) -> None: ...
    def solved(self, label: str, record: SolveRecord, reused: bool) -> None: ...
    def judged(self, result: CaseResult) -> None: ...


def _unseen() -> AbstractContextManager[Progress]:
    return nullcontext(_Unseen())


@dataclass(frozen=True)
class Making:
    """Where a study keeps what it makes, and who is told.

    Attributes
    ----------
    out : Path
        Directory of the study.
    announce : callable
        Told which parts begin and end.
    processes : int
        Parts side by side; timed solves run alone.
    progress : callable
        Gives the progress of a run of scenes.
    """

    out: Path
    announce: Callable[[str], None] = lambda text: None
    processes: int = 1
    progress: Callable[[], AbstractContextManager[Progress]] = _unseen

    def parts(self, study: str, tasks: Sequence[Task], may_fail: bool = False) -> list[Any]:
        """Make the parts of a study, side by side; what it no longer asks for is removed.

        Parameters
        ----------
        study : str
            Its name; parts are kept in ``NAME-parts``.
        tasks : sequence of Task
        may_fail : bool
            Whether a part that failed has a `Failure` as its result.

        Raises
        ------
        ChildProcessError
            If a part fails that may not; the results of the others are kept.
        """
        folder, limits = self.out / f"{study}-parts", Limits(self.processes)
        return made(tasks, folder, self.announce, limits, may_fail=may_fail)

    def run(
        self,
        scenes: Sequence[Scene],
        place: str,
        solvers: Sequence[str],
        repetitions: int = 1,
        parameters: Mapping[str, Mapping[str, Any]] | None = None,
        judged: bool = True,
    ) -> list[CaseResult]:
        """Solve scenes by some solvers and, to be judged, by references; one after the other.

        Parameters
        ----------
        scenes : sequence of Scene
        place : str
            Run directory, below the study's own.
        solvers : sequence of str
        repetitions : int
        parameters : mapping, optional
            By solver.
        judged : bool
            Whether references run beside the solvers.
        """
        options = Options(
            solvers=tuple(solvers),
            repetitions=repetitions,
            parameters={name: dict(own) for name, own in (parameters or {}).items() if own},
            cache=cache_folder(),
            judged=judged,
        )
        with self.progress() as progress:
            return run_cases(scenes, self.out / place, options, progress).results

    def solved(
        self,
        scenes: Sequence[Scene],
        place: str,
        solvers: Sequence[str],
        repetitions: int = 1,
        parameters: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> list[Solved]:
        """Run scenes by some solvers and no reference beside them, and read the solutions."""
        results = self.run(scenes, place, solvers, repetitions, parameters, judged=False)
        directory, found = RunDirectory(self.out / place), []
        for scene, result in zip(scenes, results, strict=True):
            solutions: dict[str, dict[int, Solution]] = {}
            for record in result.solves:
                if record.status is Status.SOLVED:
                    folder = directory.solve_folder(scene.name, record.solver, record.level)
                    own = solutions.setdefault(record.solver, {})
                    own[record.level] = read_solution(folder / "solution")
            found.append(Solved(scene, result, solutions))
        return found

    def place_of(self, study: str, question: Any) -> str:
        """Return the run directory of a question of a study; remove those for other questions."""
        name = f"{study}-{digest_of(plain(question))[:8]}"
        for other in self.out.glob(f"{study}-????????"):
            if other.name != name and (other / "run.json").is_file():
                shutil.rmtree(other)
        return name
