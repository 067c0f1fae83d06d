"""The error budget: a chain of answers, each of which differs from the one before in one thing.

From the user's problem to the answer of the judged solver: the cut as asked, then as realised;
finite rotations, then linear kinematics (if the answer is linear); a fine mesh, then the solver's
own element size on a conforming mesh; then the solver; in motion its mass, its time step and its
scheme. What a quantity of interest changes by along the chain adds up to its total error exactly;
norms of the differences, and their means over time, bound the norm of the total (triangle
inequality).

Links are scenes that were run, and references of them. What cannot be made is left out with its
reason. Its change is then part of the next link that can be made, which says so, and the parts
still add up to the total.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody, Body, body_of
from verify.compare.body_rule import rules
from verify.compare.errors import ErrorNorm, Rules, displacement_error, energy_error, mean_over
from verify.compare.hooke import Hooke, Law, hooke, law_of
from verify.compare.locate import Field
from verify.compare.motion import Motion
from verify.compare.realised import cut_deviation
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.intervals import quotient_half_width
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
from verify.scene import Scene
from verify.solution import Solution
from verify.study.study import Solved

Array = NDArray[np.float64]
Times = Sequence[float | None]

_MEASURES: dict[str, Callable[[Field, Field, Any, Law], ErrorNorm]] = {
    "displacement_l2": lambda one, other, rule, _law: displacement_error(one, other, rule),
    "energy_norm": energy_error,
}


def norm_names(times: Times) -> list[str]:
    """Norms that are split: at rest two; of motions at the end, and the means over time."""
    if len(times) == 1:
        return list(_MEASURES)
    return ["displacement_l2", *(f"{name}_mean" for name in _MEASURES)]


@dataclass(frozen=True)
class Distances:
    """Norms of differences.

    Attributes
    ----------
    times : sequence of float or None
    absolute : dict of str to (pairs, times, rules) array
    scale : dict of str to (times, rules) array
        Norms of the first field.
    """

    times: Times
    absolute: dict[str, Array]
    scale: dict[str, Array]

    def of(self, name: str) -> tuple[Array, float]:
        """Return a norm of each pair by each rule (pairs, rules), and the first field's norm.

        Over time all is held against the largest norm of the first field at any time: a
        vibration passes through zero.
        """
        base = name.removesuffix("_mean")
        absolute, scale = self.absolute[base], float(self.scale[base][:, 0].max())
        if base == name:
            return absolute[:, -1], scale
        over = np.moveaxis(absolute, 1, 0)
        return mean_over([time or 0.0 for time in self.times], over), scale


def distances(
    motions: Sequence[Motion],
    pairs: Sequence[tuple[int, int]],
    times: Times,
    family: Sequence[Any],
    law: Law,
) -> Distances:
    """Measure how far the motions of some pairs are apart.

    Parameters
    ----------
    motions : sequence of Motion
    pairs : sequence of (int, int)
        Numbers of two motions, the one that is held against the other second.
    times : sequence of float or None
        [None] for fields at rest.
    family : sequence of Rule
        The finest first.
    law : Law
    """
    shape = (len(times), len(family))
    absolute = {name: np.zeros((len(pairs), *shape)) for name in _MEASURES}
    scale = {name: np.zeros(shape) for name in _MEASURES}
    for t, time in enumerate(times):
        fields = [motion.at(time) for motion in motions]  # found at the points once for all pairs
        for r, rule in enumerate(family):
            for name, measure in _MEASURES.items():
                scale[name][t, r] = measure(fields[-1], fields[0], rule, law).scale
                for p, (one, other) in enumerate(pairs):
                    found = measure(fields[one], fields[other], rule, law)
                    absolute[name][p, t, r] = found.absolute
    return Distances(times, absolute, scale)


_ROUND_OFF = 1e-10  # relative: a thousand steps leave some 1e-13


@dataclass(frozen=True)
class Answer:
    """A link of the chain.

    Parameters
    ----------
    name : str
        What it is, in words.
    change : str
        What changed against the link before; empty for the first.
    motion : Motion
        Its field, over time.
    quantities : dict of str to (float, float)
        Value and half-width per quantity of interest; those it does not have are missing.
    norms : dict of str to float
        Bound of the absolute norm of its own error, per norm; 0 if it is no reference.
    """

    name: str
    change: str
    motion: Motion
    quantities: Mapping[str, tuple[float, float]]
    norms: Mapping[str, float]


@dataclass(frozen=True)
class Part:
    """The share of one source.

    Parameters
    ----------
    source : str
        What was changed.
    value : float
        Signed change of a quantity of interest, or norm of the change of the field; relative.
    uncertainty : float
        Half-width, relative, from the references on both sides and the integration.
    round_off : bool
        Whether it is certain to be no more than that.
    """

    source: str
    value: float
    uncertainty: float
    round_off: bool = False


@dataclass(frozen=True)
class Budget:
    """The budget of one metric.

    Parameters
    ----------
    metric : str
    unit : str
        ``"1"`` for norms; the relative values of a quantity refer to `scale` in this unit.
    scale : float
        What all parts are divided by: the quantity, or the norm of the field, of the first link.
    parts : list of Part
    total : Part
        Last link against the first, measured by itself.
    closes : bool
        For a quantity: the parts add up to the total, to round-off. For a norm: the total does
        not exceed the sum of the parts by more than the uncertainties.
    notes : list of str
    """

    metric: str
    unit: str
    scale: float
    parts: list[Part]
    total: Part
    closes: bool
    notes: list[str] = field(default_factory=list)

    @property
    def largest(self) -> Part:
        """The part that weighs most."""
        return max(self.parts, key=lambda part: abs(part.value))

    @property
    def is_round_off(self) -> bool:
        """Whether there is nothing to take apart."""
        return all(part.round_off for part in (*self.parts, self.total))


def error_budget(
    chain: Sequence[Answer], body: AnyBody, size: float, law: Hooke, units: Mapping[str, str],
    times: Times = (None,),
) -> list[Budget]:  # fmt: skip
    """Split the difference between the first and the last link of `chain`.

    Parameters
    ----------
    chain : sequence of Answer
        At least two.
    body : Body or SolidBody
        With the cuts as asked.
    size : float
        Element size of the last link, m, which decides the quadrature.
    law : Hooke
        Linear elasticity: the energy norm of a difference of fields.
    units : mapping of str to str
        Unit per quantity of interest that is wanted.
    times : sequence of float or None
        Output times of motions, s; [None] at rest.

    Returns
    -------
    list of Budget
        The norms of `norm_names`, then the quantities that every link has.
    """
    last = len(chain) - 1
    pairs = [*((i + 1, i) for i in range(last)), (last, 0)]
    family = rules(body, size, 3 if len(times) == 1 else 2)
    found = distances([answer.motion for answer in chain], pairs, times, family, law)
    budgets = [_of_norm(name, chain, found) for name in norm_names(times)]
    budgets = [budget for budget in budgets if budget.scale > 0.0]
    for name, unit in units.items():
        if all(name in answer.quantities for answer in chain):
            budgets.append(_of_quantity(name, unit, chain))
    return budgets


def _of_norm(name: str, chain: Sequence[Answer], found: Distances) -> Budget:
    values, scale = found.of(name)
    spread = np.abs(values - values[:, :1]).max(axis=1)
    unit = scale or 1.0

    def part(source: str, row: int, i: int, j: int) -> Part:
        known = chain[i].norms.get(name, 0.0) + chain[j].norms.get(name, 0.0)
        return _part(source, float(values[row, 0]) / unit, float(known + spread[row]) / unit)

    parts = [part(answer.change, i, i, i + 1) for i, answer in enumerate(chain[1:])]
    total = part("total", -1, 0, len(chain) - 1)
    room = total.uncertainty + sum(p.uncertainty for p in parts)
    closes = bool(total.value <= sum(p.value for p in parts) + room)
    return Budget(name, "1", scale, parts, total, closes)


def _of_quantity(name: str, unit: str, chain: Sequence[Answer]) -> Budget:
    values = [answer.quantities[name] for answer in chain]
    whole, half = values[0]
    scale = abs(whole) if abs(whole) > half else 0.0

    def part(source: str, a: tuple[float, float], b: tuple[float, float]) -> Part:
        if not scale:  # absolute values: how small they are is not known
            return Part(source, b[0] - a[0], a[1] + b[1])
        apart = b[0] - a[0]
        width = quotient_half_width(apart, a[1] + b[1], whole, half)
        return _part(source, apart / scale, width)

    parts = [
        part(answer.change, a, b)
        for answer, a, b in zip(chain[1:], values[:-1], values[1:], strict=True)
    ]
    total = part("total", values[0], values[-1])
    left = sum(p.value for p in parts) - total.value
    closes = bool(abs(left) <= 1e-12 * max(1.0, abs(total.value)))
    notes = [] if scale else ["the quantity may be zero in the user's problem: absolute values"]
    return Budget(name, unit, scale or 1.0, parts, total, closes, notes)


def _part(source: str, value: float, uncertainty: float) -> Part:
    return Part(source, value, uncertainty, abs(value) + uncertainty < _ROUND_OFF)


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


_OUTSIDE = "not part of the total"
_FINER = 4  # an exact solution has no time step: the own one over this
_TITLES = {"corotational": "the problem: finite rotations, cut as asked",
           "linear": "the problem: linear kinematics, cut as asked"}  # fmt: skip
_CUT, _TURN = "cut as asked → as realised", "finite rotations → linear"
_MESH, _METHOD = "fine → own h, conforming P1", "conforming P1 → XFEM"


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
        # finest level of the reference of the problem, and its time steps
        self._finest: int | None = None
        self._steps = 0
        missing, kinds = [], ["corotational", "linear"]
        if exact is not None:
            kinds = ["linear"]
        elif quick and self._own == "linear" and scene.analysis.kind == "dynamic":
            missing.append(Missing(_TURN, "left out by --quick", _OUTSIDE))
            kinds = ["linear"]
        scenes = [with_kinematics(scene, kind) for kind in kinds]
        asked = dict(zip(kinds, solve(scenes, "asked", (JUDGED,), timed=True), strict=True))
        self._judged = asked[self._own].solution(JUDGED, level)
        self._body = body_of(scene, None if exact is None else np.asarray(exact.singular_points))
        self._size, first, notes = size_of(self._judged), kinds[0], []
        if exact is not None:
            known = exact_reference(scene, exact, self._body, hooke(scene.material))
            title = "the problem: exact solution"
            text = "the exact solution is one of linear elasticity: nothing is said of rotations"
            notes.append(text)
        else:
            try:
                known = self._problem(first)
            except InputError as problem:
                if first == self._own:
                    raise
                missing.append(Missing(_TURN, str(problem), _OUTSIDE))
                first = self._own
                known = self._problem(first)
            title = _TITLES[first]
        self.chain = Chain(scene, known, self._body, self._size, asked, [], missing, notes)
        self._take(title, "", known)
        place = self._realise(list(dict.fromkeys([first, self._own])))[-1]
        if self._own != first:
            asked_for = "level-" in place.name  # not realised: the scene of all levels has it
            same = with_kinematics(scene, self._own) if asked_for else place
            where = f"reference-{self._own}" if asked_for else f"realised-{level}-{self._own}"
            self._try("linear kinematics", _TURN, lambda: self._reference(same, where))
        if scene.analysis.kind == "dynamic":
            self._move(place)
        else:
            self._try("conforming P1 at the same h", _MESH,
                      lambda: self._one(place, "mesh", CONFORMING))  # fmt: skip
            self._method("XFEM", lambda: self._judged)

    # -- references, measured on the body with the cuts as asked

    def _problem(self, kinematics: str) -> Reference:
        place = f"reference-{kinematics}"
        (solved,) = self._solve([with_kinematics(self._scene, kinematics)], place, (REFERENCE,))
        found, levels = self._measured(solved), solved.solutions[REFERENCE]
        self._finest = max(levels)
        self._steps = levels[self._finest].iterations.get("steps", 0)
        return found

    def _reference(self, scene: Scene, place: str) -> Reference:
        (solved,) = self._solve([scene], place, (REFERENCE,))
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

    # -- one change after the other

    def _realise(self, kinds: list[str]) -> list[Scene]:
        """Change the cut; give the scene on the level of the answer in some kinematics."""
        as_asked = [with_kinematics(self._scene, kind) for kind in kinds]
        own_level = [on_one_level(scene, self._level) for scene in as_asked]
        if is_realised_as_asked(self._scene, self._judged):
            self.chain.notes.append("the cut is realised as asked, to round-off: that part is zero")
            return own_level
        try:
            facets = self._judged.cut_facets
            realised = [on_realised_cut(self._scene, facets, self._level, k) for k in kinds]
            known = self._reference(realised[0], f"realised-{self._level}")
        except (InputError, UnsupportedSceneError) as problem:
            self._cut = _CUT
            where = "in the part of the method: the links before it have the cut as asked"
            self.chain.missing.append(Missing(_CUT, str(problem), where))
            return own_level
        self._take("the same with the cut as realised", _CUT, known)
        return realised

    _cut = ""

    def _move(self, place: Scene) -> None:
        """Change mesh and method at the fine time step, then step and scheme."""
        scheme = "newmark" if self._own == "linear" else "energy_momentum"
        step, own_step = self._fine_step(), "fine → own time step"
        own = on_one_level(with_kinematics(self._scene, self._own), self._level)
        fine = with_time_step(own, step)
        self._try("conforming P1 at the same h, the same time step", _MESH,
                  lambda: self._one(with_time_step(place, step), "mesh", CONFORMING,
                                    scheme=scheme))  # fmt: skip
        scenes = [fine] if scheme == "newmark" else [fine, own]
        found = self._solve(scenes, "fine", (JUDGED,), {JUDGED: {"scheme": scheme}})
        words = scheme.replace("_", "–")
        self.chain.fine.append((f"{words}, step {step:.3g} s", found[0]))
        self._method("XFEM, the same time step", lambda: found[0].solution(JUDGED, 0))
        if scheme == "newmark":
            self._take("XFEM at the scene's time step", own_step, self._judged)
        else:
            self._try("the same at the scene's time step", own_step,
                      lambda: found[1].solution(JUDGED, 0))  # fmt: skip
            self._take("XFEM, trapezoidal rule", f"{words} → trapezoidal", self._judged)

    def _method(self, name: str, make: Callable[[], Solution]) -> None:
        """Change to the judged method, and with it to its cut if that was not taken before."""
        if self._cut:
            self._waiting.append(self._cut)
        self._try(name, _METHOD, make)

    def _fine_step(self) -> float:
        """Time step of the finest reference, s: changing the mesh does not change it."""
        analysis = self._scene.analysis
        assert analysis.duration is not None
        if analysis.time_step is not None:
            finer = _FINER if self._finest is None else 2**self._finest
            return analysis.duration / (analysis.steps(analysis.time_step) * finer)
        if self._finest is not None and self._steps:
            return analysis.duration / self._steps
        own = self._judged.iterations.get("steps", 0)
        return analysis.duration / (_FINER * max(own, 1))

    def _one(self, scene: Scene, place: str, solver: str, **parameters: Any) -> Solution:
        (solved,) = self._solve([scene], place, (solver,), {solver: parameters})
        return solved.solution(solver, 0)

    def _try(self, name: str, change: str, make: Callable[[], Solution | Reference]) -> None:
        try:
            self._take(name, change, make())
        except InputError as problem:
            self._waiting.append(change)
            self.chain.missing.append(Missing(change, str(problem), "in the next part"))

    def _take(self, name: str, change: str, what: Solution | Reference) -> None:
        """Append a link, with the changes that waited for it."""
        change = "; ".join([*self._waiting, change])
        self._waiting.clear()
        self.chain.answers.append(link(self.chain, name, change, what))
