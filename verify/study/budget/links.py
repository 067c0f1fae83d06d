"""Scenes that were run, references of them, and the links of a budget that are made of these."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from verify.compare.body import AnyBody, Body, body_of
from verify.compare.hooke import law_of
from verify.compare.realised import cut_deviation
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.changed_scenes import with_kinematics
from verify.judge.quantities import Measured
from verify.judge.reference import Reference, conforming_reference
from verify.scene import Scene
from verify.solution import Solution
from verify.study.budget.budget import Answer
from verify.study.solving import Solved

REFERENCE, JUDGED, CONFORMING = "reference", "xfem", "conforming"


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


_SAME = 1e-9  # of the body's size


@dataclass(frozen=True)
class Missing:
    """A link that could not be made.

    Parameters
    ----------
    source : str
        What would have been changed.
    reason : str
    where : str
        Which part it is in instead.
    """

    source: str
    reason: str
    where: str


@dataclass
class Chain:
    """The links, and what they were made of.

    Attributes
    ----------
    scene : Scene
    answers : list of Answer
    missing : list of Missing
    notes : list of str
    known : Reference
        Of the user's problem.
    body : Body or SolidBody
    size : float
        Element size of the judged solution, m.
    asked : dict of str to Solved
        The scene as asked by the judged solver on all levels, by kinematics.
    fine : list of (str, Solved)
        Motions of one level at the fine time step, with what they are in words.
    """

    scene: Scene
    known: Reference
    body: AnyBody
    size: float
    asked: dict[str, Solved]
    answers: list[Answer] = field(default_factory=list)
    missing: list[Missing] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    fine: list[tuple[str, Solved]] = field(default_factory=list)


def is_realised_as_asked(scene: Scene, solution: Solution) -> bool:
    """Say whether the cut of `solution` is that of `scene`, tips and all, to round-off."""
    body = body_of(scene)
    if cut_deviation(solution, body) > _SAME * body.size:
        return False
    if not isinstance(body, Body):  # where a front ends inside elements, it is moved
        return not len(body.front)
    asked = float(sum(part.piece.length * (part.end - part.start) for part in body.parts))
    edges = np.diff(solution.cut_facets, axis=1)[:, 0]
    made = float(np.linalg.norm(edges, axis=1).sum())
    return bool(abs(made - asked) <= _SAME * body.size)


def link(chain: Chain, name: str, change: str, what: Solution | Reference) -> Answer:
    """Make a link of a reference, or of a solution with what it has of the scene's quantities."""
    if isinstance(what, Reference):
        return Answer(name, change, what.motion, what.quantities, what.norms)
    scene = chain.scene
    one = Measured(what, chain.body, law_of(scene), scene)
    quantities = {}
    for asked in scene.quantities:
        try:
            quantities[asked.name] = one.quantity(asked), 0.0
        except UnsupportedSceneError:
            continue
    return Answer(name, change, one.motion, quantities, {})


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
