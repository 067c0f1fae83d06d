"""Solves of a study: scenes by the runner, single parts as tasks; both are kept.

Every solve and every part runs in a watched process with limits of time and memory. A study that
was stopped goes on where it was when it is asked for again.
"""

import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.files import plain
from verify.result import CaseResult, SolveRecord, Status
from verify.runner import Options, Progress, run_cases
from verify.runner.directory import RunDirectory
from verify.runner.fingerprint import cache_folder, digest_of
from verify.runner.tasks import Limits, Task, all_made, made
from verify.scene import Scene
from verify.solution import Solution, read_solution


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
        Told what is under way, and what has ended.
    processes : int
        Parts side by side; what is timed runs alone.
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
            Whether a part that failed is a `Failure` among the others.

        Raises
        ------
        ChildProcessError
            If a part fails that may not; what the others found is kept.
        """
        make = made if may_fail else all_made
        folder = self.out / f"{study}-parts"
        return make(tasks, folder, self.announce, Limits(self.processes))

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
            Run directory, below that of the study.
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
        """Return the run directory of a question of a study; those of other ones are removed."""
        name = f"{study}-{digest_of(plain(question))[:8]}"
        for other in self.out.glob(f"{study}-????????"):
            if other.name != name and (other / "run.json").is_file():
                shutil.rmtree(other)
        return name
