"""The references among a budget's links: of the user's problem, or of scenes derived from it."""

from typing import Any

from verify.assess.changed_scenes import with_kinematics
from verify.assess.reference import Reference, conforming_reference
from verify.compare.body import AnyBody
from verify.compare.hooke import law_of
from verify.errors import InputError
from verify.scene import Scene
from verify.study.budget.links import Missing
from verify.study.budget.solved import REFERENCE, Solve, Solved

OUTSIDE = "not part of the total"


class References:
    """Conforming references of a scene, and of scenes that differ from it in one thing.

    Parameters
    ----------
    scene : Scene
    body : Body or SolidBody
        On which all are measured: with the cuts as asked.
    size : float
        Element size of the judged solution, m.
    solve : Solve

    Attributes
    ----------
    finest : int or None
        Finest level of the reference of the problem, once it is made.
    steps : int
        Time steps of that level.
    """

    def __init__(self, scene: Scene, body: AnyBody, size: float, solve: Solve) -> None:
        self._scene, self._body, self._size, self._solve = scene, body, size, solve
        self.finest: int | None = None
        self.steps = 0

    def problem(self, first: str, own: str, missing: list[Missing]) -> tuple[Reference, str, str]:
        """Make the reference of the problem in kinematics `first`, or else in its `own`.

        Returns
        -------
        reference, title, kinematics
        """
        titles = {
            "corotational": "the problem: finite rotations, cut as asked",
            "linear": "the problem: linear kinematics, cut as asked",
        }
        try:
            return self._as_asked(first), titles[first], first
        except InputError as problem:
            if first == own:
                raise
            missing.append(Missing("finite rotations → linear", str(problem), OUTSIDE))
        return self._as_asked(own), titles[own], own

    def _as_asked(self, kinematics: str) -> Reference:
        scene, place = with_kinematics(self._scene, kinematics), f"reference-{kinematics}"
        (solved,) = self._solve([scene], place, (REFERENCE,))
        found = self._measured(solved)
        self.finest = max(solved.solutions[REFERENCE])
        self.steps = solved.solutions[REFERENCE][self.finest].iterations.get("steps", 0)
        return found

    def of(self, scene: Scene, place: str, **parameters: Any) -> Reference:
        """Solve a scene, with parameters of the reference; measure it as if it were the problem.

        Raises
        ------
        InputError
            If there is no reference, with the reason.
        """
        (solved,) = self._solve([scene], place, (REFERENCE,), {REFERENCE: parameters})
        return self._measured(solved)

    def _measured(self, solved: Solved) -> Reference:
        levels = solved.solutions.get(REFERENCE, {})
        law = law_of(solved.scene)
        try:
            return conforming_reference(self._scene, levels, self._body, law, self._size)
        except InputError as problem:
            reason = solved.reason(REFERENCE)
            kind = solved.scene.analysis.kinematics
            text = f"the {kind} reference of '{solved.scene.name}': {problem}"
            raise InputError(f"{text} ({reason})" if reason else text) from None
