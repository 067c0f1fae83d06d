"""The links of a budget, made one after the other: each differs from the last in one thing.

What cannot be made is left out with its reason. Its change is then part of the next link that
can be made, which says so, and the parts still add up to the total.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from verify.compare.body import AnyBody, body_of
from verify.compare.hooke import hooke
from verify.compare.sides import distance_to_cut
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.changed_scenes import (
    on_one_level,
    on_realised_cut,
    with_kinematics,
    with_time_step,
)
from verify.judge.reference import (
    ExactField,
    Reference,
    exact_reference,
    size_of,
)
from verify.scene import Scene, ToolPathCut
from verify.solution import Solution
from verify.study.budget.links import (
    CONFORMING,
    JUDGED,
    OUTSIDE,
    Chain,
    Missing,
    References,
    Solve,
    is_realised_as_asked,
    link,
)

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
        Whose facets of the cut are those of its elements.

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
