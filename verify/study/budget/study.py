"""The budget study of a case: what was solved, put into a chain; what was tried, into a choice."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from statistics import median
from typing import Any

import numpy as np

from verify.compare.body import AnyBody, Body, body_of
from verify.compare.displacement_error import displacement_error
from verify.compare.energy_error import energy_error
from verify.compare.hooke import Law, hooke, law_of
from verify.compare.integration import integrate_norm, rules
from verify.compare.realised import cut_deviation, field_of
from verify.errors import InputError, UnsupportedSceneError
from verify.result import CaseResult, SolveRecord, Status, Verdict
from verify.scene import Scene
from verify.solution import Solution
from verify.study.budget.budget import Answer, Budget, error_budget
from verify.study.budget.cheapest import Candidate, cheapest_adequate
from verify.study.finding import Finding
from verify.study.quantities import Measured, unit_of
from verify.study.reference import (
    ExactField,
    Reference,
    conforming_reference,
    exact_reference,
    size_of,
)

__all__ = ["BudgetStudy", "Solved", "budget_study", "is_realised_as_asked"]

REFERENCE, JUDGED, CONFORMING = "reference", "xfem", "conforming"
_SAME = 1e-9  # of the body's size


@dataclass(frozen=True)
class Solved:
    """A scene that was run: its result, and the solutions by solver and level."""

    scene: Scene
    result: CaseResult
    solutions: Mapping[str, Mapping[int, Solution]]


@dataclass(frozen=True)
class BudgetStudy:
    """What the budget study found.

    Attributes
    ----------
    case : str
    level : int
        Mesh level that is taken apart.
    tolerance : float
        Wanted relative error.
    metric : str
        Of the tolerance.
    chain : list of str
        The links, in words.
    budgets : list of Budget
    candidates : list of Candidate
    findings : list of Finding
    notes : list of str
        What was left out, and why.
    seconds : float
    """

    case: str
    level: int
    tolerance: float
    metric: str
    chain: list[str]
    budgets: list[Budget]
    candidates: list[Candidate]
    findings: list[Finding]
    notes: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def as_record(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return asdict(self)

    def rows(self) -> list[dict[str, Any]]:
        """Return a line per part, for a table."""
        return [
            {"metric": b.metric, "source": part.source, "relative": part.value,
             "uncertainty": part.uncertainty, "scale": b.scale, "unit": b.unit}
            for b in self.budgets
            for part in [*b.parts, b.total]
        ]  # fmt: skip


def is_realised_as_asked(scene: Scene, solution: Solution) -> bool:
    """Say whether the cut of `solution` is that of `scene`, tips and all, to round-off."""
    body = body_of(scene)
    assert isinstance(body, Body)
    asked = float(sum(part.piece.length * (part.end - part.start) for part in body.parts))
    edges = np.diff(solution.cut_facets, axis=1)[:, 0]
    made = float(np.linalg.norm(edges, axis=1).sum())
    near = cut_deviation(solution, body) <= _SAME * body.size
    return bool(near and abs(made - asked) <= _SAME * body.size)


def budget_study(
    scene: Scene,
    level: int,
    tolerance: float,
    metric: str,
    asked: Mapping[str, Solved],
    realised: Mapping[str, Solved] | None,
    exact: ExactField | None,
    seconds: float = 0.0,
) -> BudgetStudy:
    """Take the answer of level `level` apart, and find the cheapest adequate model.

    Parameters
    ----------
    scene : Scene
        Plane and static.
    level : int
    tolerance : float
    metric : str
        ``displacement_l2``, ``energy_norm`` or the name of a quantity.
    asked : mapping of kinematics to Solved
        The scene with its cuts as asked, by all levels of the judged solver and, unless `exact`
        judges, by the reference.
    realised : mapping of kinematics to Solved, or None
        The scene with the cuts that level `level` realised, by the reference and by the
        conforming solver on that level's mesh; None where they are those asked for, and the
        conforming solutions are in `asked`.
    exact : ExactField or None
    seconds : float
        Wall time, for the record.

    Raises
    ------
    InputError
        If something that the chain needs was not solved, or `metric` is unknown.
    """
    body = body_of(scene, None if exact is None else np.asarray(exact.singular_points))
    judged = _solution(asked[scene.analysis.kinematics], JUDGED, level)
    size = size_of(judged)
    links = _Links(scene, body, size)
    first = "linear" if exact is not None else "corotational"
    if exact is not None:
        known = exact_reference(scene, exact, body, hooke(scene.material))
        title = "the problem: exact solution"
        notes = ["the exact solution is one of linear elasticity: nothing is said of rotations"]
    else:
        known = links.reference(asked[first], first)
        title, notes = "the problem: finite rotations, cut as asked", []
    if realised is None:
        notes.append("the cut is realised as asked, to round-off: that part is zero")
    chain = [links.of_reference(title, "", known)]
    chain += links.from_problem_to_answer(first, level, asked, realised, judged)
    units = {q.name: unit_of(q, scene.dimension) for q in scene.quantities}
    budgets = error_budget(chain, body, size, hooke(scene.material), units)
    if metric not in {budget.metric for budget in budgets}:
        names = ", ".join(budget.metric for budget in budgets)
        raise InputError(f"no budget of '{metric}'; there is one of {names}", "--metric")
    candidates = _candidates(asked, known, body, metric, hooke(scene.material))
    if exact is not None:
        candidates = [c for c in candidates if c.kinematics == "linear"]
    contended = next((r.notes["timing"] for s in asked.values() for r in s.result.solves
                      if r.notes.get("timing")), "")  # fmt: skip
    _, choice = cheapest_adequate(candidates, tolerance, metric, contended)
    return BudgetStudy(
        case=scene.name,
        level=level,
        tolerance=tolerance,
        metric=metric,
        chain=[answer.name for answer in chain],
        budgets=budgets,
        candidates=candidates,
        findings=[choice, *(_finding(budget) for budget in budgets)],
        notes=notes,
        seconds=seconds,
    )


class _Links:
    """Makes the links of the chain."""

    def __init__(self, scene: Scene, body: AnyBody, size: float) -> None:
        self._scene, self._body, self._size = scene, body, size

    def from_problem_to_answer(
        self,
        first: str,
        level: int,
        asked: Mapping[str, Solved],
        realised: Mapping[str, Solved] | None,
        judged: Solution,
    ) -> list[Answer]:
        """Change the cut, the kinematics, the mesh and the method, in this order."""
        own, chain = self._scene.analysis.kinematics, []
        place, k = (asked, level) if realised is None else (realised, 0)
        if realised is not None:
            moved = self.reference(realised[first], first)
            text = "cut as asked → as realised"
            chain.append(self.of_reference("the same with the cut as realised", text, moved))
        if own != first:
            linear = self.reference(place[own], own)
            text = "finite rotations → linear"
            chain.append(self.of_reference("linear kinematics", text, linear))
        conforming = _solution(place[own], CONFORMING, k)
        text = "fine → own h, conforming P1"
        chain.append(self.of_solution("conforming P1 at the same h", text, conforming))
        chain.append(self.of_solution("XFEM", "conforming P1 → XFEM", judged))
        return chain

    def reference(self, solved: Solved, kinematics: str) -> Reference:
        levels = solved.solutions.get(REFERENCE, {})
        law = law_of(solved.scene)
        try:
            return conforming_reference(self._scene, levels, self._body, law, self._size)
        except InputError as problem:
            reasons = {r.reason for r in solved.result.solves if r.reason}
            more = f" ({'; '.join(sorted(reasons))})" if reasons else ""
            text = f"the {kinematics} reference of '{solved.scene.name}': {problem}{more}"
            raise InputError(text) from None

    def of_reference(self, name: str, change: str, known: Reference) -> Answer:
        return Answer(name, change, known.motion.at(), known.quantities, known.norms)

    def of_solution(self, name: str, change: str, solution: Solution) -> Answer:
        one = Measured(solution, self._body, law_of(self._scene), self._scene)
        quantities = {}
        for asked in self._scene.quantities:
            try:
                quantities[asked.name] = one.quantity(asked), 0.0
            except UnsupportedSceneError:
                continue
        return Answer(name, change, one.field, quantities, {})


def _solution(solved: Solved, solver: str, level: int) -> Solution:
    try:
        return solved.solutions[solver][level]
    except KeyError:
        reason = next(
            (r.reason for r in solved.result.solves if r.solver == solver and r.reason), "not run"
        )
        text = f"'{solved.scene.name}' was not solved by {solver} on level {level}: {reason}"
        raise InputError(text) from None


def _candidates(
    asked: Mapping[str, Solved], known: Reference, body: AnyBody, metric: str, law: Law
) -> list[Candidate]:
    found = []
    for kinematics, solved in asked.items():
        for record in sorted(solved.result.solves, key=lambda r: r.level):
            if record.solver != JUDGED:
                continue
            solution = solved.solutions.get(JUDGED, {}).get(record.level)
            if record.status is not Status.SOLVED or solution is None:
                none = float("nan")
                found.append(
                    Candidate(kinematics, "", record.level, none, 0, none, none, none, none, none,
                              none, record.reason or str(record.status))
                )  # fmt: skip
                continue
            error, width = _error(solved, solution, known, body, metric, law)
            low, high = max(error - width, 0.0), error + width
            found.append(_candidate(kinematics, record, solution, (error, low, high)))
    return found


def _candidate(
    kinematics: str, record: SolveRecord, solution: Solution, error: tuple[float, float, float]
) -> Candidate:
    # the background mesh is there before the cut is
    phases = [times for name, times in record.timings.items() if name != "meshing"]
    totals = [sum(times) for times in zip(*phases, strict=False)] or [float("nan")]
    return Candidate(
        kinematics, "", record.level, size_of(solution), solution.unknowns, *error,
        median(totals), min(totals), max(totals),
    )  # fmt: skip


def _error(
    solved: Solved, solution: Solution, known: Reference, body: AnyBody, metric: str, law: Law
) -> tuple[float, float]:
    """Relative error against the user's problem, and its half-width."""
    if metric not in ("displacement_l2", "energy_norm"):
        value, width = known.quantities[metric]
        asked = next(q for q in solved.scene.quantities if q.name == metric)
        one = Measured(solution, body, law_of(solved.scene), solved.scene)
        return abs(one.quantity(asked) - value) / abs(value), width / abs(value)
    truth, own = known.motion.at(), field_of(solution, body)
    measure: Callable[[Any], Any] = (
        (lambda rule: displacement_error(own, truth, rule))
        if metric == "displacement_l2"
        else (lambda rule: energy_error(own, truth, rule, law))
    )
    found = integrate_norm(measure, rules(body, size_of(solution)))
    error = found.norm.relative
    width = known.norms.get(metric, 0.0) / found.norm.scale * (1 + error)
    return error, width + found.integration_error


def _finding(budget: Budget) -> Finding:
    largest, total = budget.largest, budget.total
    parts: Sequence[str] = [
        f"{part.source} {_percent(part.value)} ± {_percent(part.uncertainty)}"
        for part in budget.parts
    ]
    known = total.uncertainty < 0.1 * abs(total.value)
    verdict = Verdict.PASS if budget.closes else Verdict.FAIL
    return Finding(
        f"budget of {budget.metric.replace('_', ' ')}",
        f"{'; '.join(parts)}; total {_percent(total.value)} ± {_percent(total.uncertainty)}. "
        f"Most of it: {largest.source}.",
        "the parts add up to the total" if budget.unit != "1"
        else "the total is at most the sum of the parts",
        verdict if known or not budget.closes else Verdict.UNDECIDED,
    )  # fmt: skip


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %".replace("-", "−")
