"""The links of a budget, made one after the other: each differs from the last in one thing.

They are scenes that were run, and references of them. What cannot be made is left out with its
reason. Its change is then part of the next link that can be made, which says so, and the parts
still add up to the total.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from verify.compare.body import AnyBody, Body, body_of
from verify.compare.errors import Rules
from verify.compare.hooke import hooke, law_of
from verify.compare.realised import cut_deviation
from verify.compare.sides import distance_to_cut
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.models import (
    on_one_level,
    on_realised_cut,
    with_kinematics,
    with_time_step,
)
from verify.judge.quantities import Measured
from verify.judge.reference import (
    ExactField,
    Reference,
    conforming_reference,
    exact_reference,
    size_of,
)
from verify.result import REFERENCE
from verify.scene import Scene, ToolPathCut
from verify.solution import Solution
from verify.study.budget_parts import Answer
from verify.study.study import Solved

JUDGED, CONFORMING = "xfem", "conforming"


# Of scenes, a place, solvers, their parameters and whether they are timed: solves all levels by
# these solvers and no others. The place names the run directory; timed runs are repeated.
type Solve = Callable[..., list[Solved]]

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
    """Whether `solution` has the cut of `scene`, tips included, to round-off."""
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
        titles = {"corotational": "the problem: finite rotations, cut as asked",
                  "linear": "the problem: linear kinematics, cut as asked"}  # fmt: skip
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
        law, rules = law_of(solved.scene), Rules(self._body, self._size)
        try:
            return conforming_reference(self._scene, levels, self._body, law, rules)
        except InputError as problem:
            reason = solved.reason(REFERENCE)
            kind = solved.scene.analysis.kinematics
            text = f"the {kind} reference of '{solved.scene.name}': {problem}"
            raise InputError(f"{text} ({reason})" if reason else text) from None


_FINER = 4  # an exact solution has no time step: the own one over this


def make_chain(
    scene: Scene, level: int, exact: ExactField | None, solve: Solve, quick: bool = False
) -> Chain:
    """Solve and measure all links from the user's problem to the answer of level `level`.

    Parameters
    ----------
    scene : Scene
    level : int
    exact : ExactField or None
        What judges the scene, if an exact solution does.
    solve : Solve
    quick : bool
        Leave out the reference at finite rotation of a motion whose scene is linear.

    Raises
    ------
    InputError
        If the judged solver did not solve the level, or nothing can judge it.
    """
    return _Maker(scene, level, exact, solve, quick).chain


class _Maker:
    def __init__(
        self, scene: Scene, level: int, exact: ExactField | None, solve: Solve, quick: bool
    ) -> None:
        self._scene, self._level, self._solve = scene, level, solve
        self._own = scene.analysis.kinematics
        self._waiting: list[str] = []  # changes that the next link takes over
        missing = []
        kinds = ["corotational", "linear"]
        if exact is not None:
            kinds = ["linear"]
        elif quick and self._own == "linear" and scene.analysis.kind == "dynamic":
            missing.append(Missing("finite rotations → linear", "left out by --quick", OUTSIDE))
            kinds = ["linear"]
        scenes = [with_kinematics(scene, kind) for kind in kinds]
        asked = dict(zip(kinds, solve(scenes, "asked", (JUDGED,), timed=True), strict=True))
        self._judged = asked[self._own].solution(JUDGED, level)
        singular = None if exact is None else np.asarray(exact.singular_points)
        body, size = body_of(scene, singular), size_of(self._judged)
        self._first = kinds[0]
        self._references = References(scene, body, size, solve)
        if exact is not None:
            known = exact_reference(scene, exact, body, hooke(scene.material))
            title = "the problem: exact solution"
        else:
            known, title, self._first = self._references.problem(kinds[0], self._own, missing)
        self.chain = Chain(scene, known, body, size, asked, missing=missing)
        if exact is not None:
            text = "the exact solution is one of linear elasticity: nothing is said of rotations"
            self.chain.notes.append(text)
        self._take(title, "", known)
        self._place = self._realise()
        if self._own != self._first:
            self._reference_link("linear kinematics", "finite rotations → linear", self._place)
        if scene.analysis.kind == "dynamic":
            self._move()
        else:
            self._rest()

    # -- one change after the other

    def _realise(self) -> list[Scene]:
        """Change the cut; give the scene on the level of the answer in both kinematics."""
        kinds = list(dict.fromkeys([self._first, self._own]))
        as_asked = [with_kinematics(self._scene, kind) for kind in kinds]
        own_level = [on_one_level(scene, self._level) for scene in as_asked]
        text = "cut as asked → as realised"
        if is_realised_as_asked(self._scene, self._judged):
            self.chain.notes.append("the cut is realised as asked, to round-off: that part is zero")
            return own_level
        try:
            facets = self._judged.cut_facets
            realised = [on_realised_cut(self._scene, facets, self._level, k) for k in kinds]
            known = self._references.of(realised[0], f"realised-{self._level}")
        except (InputError, UnsupportedSceneError) as problem:
            self._cut = text
            where = "in the part of the method: the links before it have the cut as asked"
            self.chain.missing.append(Missing(text, str(problem), where))
            return own_level
        self._take("the same with the cut as realised", text, known)
        return realised

    _cut = ""

    def _reference_link(self, name: str, change: str, place: list[Scene]) -> None:
        """Change the kinematics of a reference."""
        own = place[-1]
        asked = "level-" in own.name  # not realised: the scene of all levels has the reference
        scene = with_kinematics(self._scene, self._own) if asked else own
        where = f"reference-{self._own}" if asked else f"realised-{self._level}-{self._own}"
        self._try(name, change, lambda: self._references.of(scene, where))

    def _rest(self) -> None:
        """Change the mesh and the method."""
        self._try(
            "conforming P1 at the same h",
            "fine → own h, conforming P1",
            lambda: self._one(self._place[-1], "mesh", CONFORMING),
        )
        self._method("XFEM", self._judged)

    def _move(self) -> None:
        """Open late, change mesh and method at the fine time step, then mass, step and scheme."""
        self._open_late()
        scheme = "newmark" if self._own == "linear" else "energy_momentum"
        step = self._fine_step()
        own = on_one_level(with_kinematics(self._scene, self._own), self._level)
        fine = with_time_step(own, step)
        self._try(
            "conforming P1 at the same h, the same time step",
            "fine → own h, conforming P1",
            lambda: self._one(
                with_time_step(self._place[-1], step), "mesh", CONFORMING, scheme=scheme
            ),
        )
        consistent = "fine-consistent"
        self._method(
            "XFEM with consistent mass, the same time step",
            lambda: self._one(fine, consistent, JUDGED, scheme=scheme, mass="consistent"),
        )
        scenes = [fine] if scheme == "newmark" else [fine, own]
        lumped = self._solve(scenes, "fine-lumped", (JUDGED,), {JUDGED: {"scheme": scheme}})
        words = scheme.replace("_", "–")
        self.chain.fine.append((f"{words}, step {step:.3g} s", lumped[0]))
        self._try(
            "XFEM with side-wise lumped mass",
            "consistent → lumped mass",
            lambda: lumped[0].solution(JUDGED, 0),
        )
        if scheme != "newmark":
            self._try(
                "the same at the scene's time step",
                "fine → own time step",
                lambda: lumped[1].solution(JUDGED, 0),
            )
            self._take("XFEM, trapezoidal rule", f"{words} → trapezoidal", self._judged)
        else:
            self._take("XFEM at the scene's time step", "fine → own time step", self._judged)

    def _open_late(self) -> None:
        """Let the reference wait for the blade as long as the judged elements do."""
        wait = mean_wait(self._scene, self.chain.body, self._judged)
        if wait is None:
            return
        change = "crossing delay"
        self.chain.notes.append(
            f"{change}: a place of the cut waits {wait:.3g} s on average until the blade leaves "
            "its element; so late opens the reference of that part"
        )
        if self._references.finest is None:
            text = "an exact solution does not open late"
            self._waiting.append(change)
            self.chain.missing.append(Missing(change, text, "in the next part"))
            return
        own = with_kinematics(self._scene, self._own)
        self._try(
            f"the same, opened {wait:.3g} s late",
            change,
            lambda: self._references.of(own, f"late-{self._own}", delay=wait),
        )

    def _method(self, name: str, answer: "Solution | Callable[[], Solution]") -> None:
        """Change to the judged method, and with it to its cut if that was not taken before."""
        if self._cut:
            self._waiting.append(self._cut)
        self._try(name, "conforming P1 → XFEM", answer if callable(answer) else lambda: answer)

    def _fine_step(self) -> float:
        """Time step of the finest reference, s: changing the mesh does not change it."""
        analysis = self._scene.analysis
        assert analysis.duration is not None
        finest, steps = self._references.finest, self._references.steps
        if analysis.time_step is not None:
            finer = _FINER if finest is None else 2**finest
            return analysis.duration / (analysis.steps(analysis.time_step) * finer)
        if finest is not None and steps:
            return analysis.duration / steps
        own = self._judged.iterations.get("steps", 0)
        return analysis.duration / (_FINER * max(own, 1))

    def _one(self, scene: Scene, place: str, solver: str, **parameters: Any) -> Solution:
        (solved,) = self._solve([scene], place, (solver,), {solver: parameters})
        return solved.solution(solver, 0)

    def _try(
        self, name: str, change: str, make: "Callable[[], Solution] | Callable[[], Reference]"
    ) -> None:
        try:
            self._take(name, change, make())
        except InputError as problem:
            self._waiting.append(change)
            self.chain.missing.append(Missing(change, str(problem), "in the next part"))

    def _take(self, name: str, change: str, what: "Solution | Reference") -> None:
        """Append a link, with the changes that waited for it."""
        change = "; ".join([*self._waiting, change])
        self._waiting.clear()
        self.chain.answers.append(link(self.chain, name, change, what))


# A blade opens elements as a whole, behind it. The tip of the cut lags by something between nothing
# and an element; its mean is the delay that costs as much in a solution that opens everywhere in
# time. An advance of the tip by s changes the displacement by s ∂u/∂a, which is square integrable
# at the tip (1/√r): the delay is an error of order 1 in h in the mean square, and at fixed places.
def mean_wait(scene: Scene, body: AnyBody, solution: Solution) -> float | None:
    """Mean over the realised cut of the time from the blade's passing to the opening, s.

    Parameters
    ----------
    scene : Scene
    body : AnyBody
        With the cuts as asked.
    solution : Solution
        Whose facets of the cut belong to its elements.

    Returns
    -------
    float or None
        None if no blade opens anything, or what it opens is not late.
    """
    blades = {cut.name: cut for cut in scene.cuts if isinstance(cut, ToolPathCut)}
    facets = solution.cut_facets
    if not blades or not len(facets) or scene.analysis.opening != "late":
        return None
    count, corners, space = facets.shape
    middles = facets.mean(axis=1)
    away = np.stack([
        distance_to_cut(pieces, facets.reshape(-1, space))[0].reshape(count, corners).max(axis=1)
        + distance_to_cut(pieces, middles)[0]
        for pieces in body.cuts.values()
    ])  # fmt: skip
    waits = np.zeros(count)
    for k, name in enumerate(body.cuts):
        mine = np.flatnonzero(away.argmin(axis=0) == k)
        if name in blades and len(mine):
            passed = blades[name].passed_at(facets[mine].reshape(-1, space))
            waits[mine] = passed.reshape(len(mine), corners).max(axis=1)
            waits[mine] -= blades[name].passed_at(middles[mine])
    edges = facets[:, 1:] - facets[:, :1]
    measures = np.sqrt(np.linalg.det(edges @ edges.swapaxes(1, 2)).clip(0.0))
    return float(np.average(waits, weights=measures))
