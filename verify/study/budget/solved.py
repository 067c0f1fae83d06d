"""Scenes that were run, and what is asked of whoever runs them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from verify.errors import InputError
from verify.result import CaseResult
from verify.scene import Scene
from verify.solution import Solution

REFERENCE, JUDGED, CONFORMING = "reference", "xfem", "conforming"


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


class Solve(Protocol):
    """Runs scenes."""

    def __call__(
        self,
        scenes: Sequence[Scene],
        place: str,
        solvers: tuple[str, ...],
        parameters: Mapping[str, Mapping[str, Any]] | None = None,
        timed: bool = False,
    ) -> list[Solved]:
        """Solve all levels of `scenes` by `solvers` with `parameters`, and by no others.

        `place` names what is kept of it for later; `timed` runs are repeated.
        """
        ...
