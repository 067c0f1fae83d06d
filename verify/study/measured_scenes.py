"""Scenes solved by a variant of a solver in this process, and read by the comparison.

The energy study is such measurements alone: what any solver keeps of energy, momenta and mass.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from verify.errors import InputError, UnsupportedSceneError
from verify.judge.accuracy import assess_accuracy
from verify.judge.intervals import NotMeasuredError, error_interval
from verify.printable import one_line
from verify.result import SolveRecord, Status, Verdict
from verify.runner.tasks import Failure, Task
from verify.scene import Scene, ValueCheck, restore_scene, scene_content
from verify.solution import Solution, checked_solution
from verify.solvers import Solver, check_parameters, find_solver
from verify.solvers.interface import one_name, parameters_in, refusal_of, solver_in
from verify.study.study import Finding, Making, Study, held

AT_MOST = "energy_drift at most"  # with its half-width, from a mass that is not declared


@dataclass(frozen=True)
class Variant:
    """A solver with parameters; `label` is how it was asked for."""

    label: str
    solver: str
    parameters: dict[str, Any] = field(default_factory=dict)

    def found(self) -> Solver:
        """Find the solver; InputError if there is none."""
        return find_solver(self.solver)


def variant_of(text: str) -> Variant:
    """Read ``"xfem slivers=merge mass=consistent"``.

    Raises
    ------
    InputError
        If the solver, one of its parameters or the form is unknown.
    """
    label = one_name(text)
    variant = Variant(label, solver_in(label), parameters_in(label))
    check_parameters(variant.solver, variant.found(), variant.parameters)
    return variant


# quantity, unit, value, reason and, if the case states one, limit
Row = tuple[str, str, float | None, str] | tuple[str, str, float | None, str, float]
Further = Callable[[Solver, Variant, Scene, int], Iterator[Row]]


@dataclass(frozen=True)
class Measurement:
    """One number of one solver on one scene, or the reason why there is none.

    Attributes
    ----------
    family : str
        Case.
    size : float or None
        Value of the case's parameter in the row.
    solver : str
        As it was asked for, with its parameters.
    quantity : str
        Error (relative), or name.
    unit : str
    value : float or None
    reason : str
        Why there is no value; or a note on it.
    limit : float, optional
        What the case allows of it.
    """

    family: str
    size: float | None
    solver: str
    quantity: str
    unit: str
    value: float | None
    reason: str = ""
    limit: float | None = None


@dataclass(frozen=True, kw_only=True)
class MeasuredStudy(Study):
    """What a study of measured scenes found; `quick` for the record."""

    quick: bool
    measurements: list[Measurement]

    def rows(self) -> list[dict[str, Any]]:
        """Return the lines of its table."""
        return [asdict(one) for one in self.measurements]


def measured_scene(variant: str, content: dict[str, Any]) -> list[Measurement]:
    """Solve a scene on its finest level and measure what the comparison measures of it.

    Parameters
    ----------
    variant : str
        As `variant_of` reads it.
    content : dict
        As `verify.scene.scene_content` writes it.
    """
    return measurements(variant_of(variant), restore_scene(content))


def measurements(
    variant: Variant, scene: Scene, further: Further | None = None
) -> list[Measurement]:
    """Measure a scene, and what `further` yields: (quantity, unit, value, reason).

    Whatever a solver raises is a row with its reason.
    """
    solver, level = variant.found(), scene.mesh.count - 1
    rows: list[Row]
    try:
        if refusal := refusal_of(solver, scene):
            raise UnsupportedSceneError(refusal)
        rows = list(_solved(solver, variant, scene, level))
    except Exception as problem:  # a guest may raise anything
        rows = [("solution", "", None, one_line(f"{type(problem).__name__}: {problem}"))]
    if further is not None:
        rows += further(solver, variant, scene, level)
    return [Measurement(*_place(scene), variant.label, *row) for row in rows]


def _place(scene: Scene) -> tuple[str, float | None]:
    return (scene.row.family, scene.row.value) if scene.row else (scene.name, None)


def measured_families(
    study: str,
    measure: Callable[[str, dict[str, Any]], list[Measurement]],
    families: Mapping[str, Sequence[Scene]],
    variants: Sequence[Variant],
    making: Making,
) -> list[Measurement]:
    """Measure the scenes of every family by every variant, side by side, in their order.

    Parameters
    ----------
    study : str
        Its name.
    measure : callable
        Of a variant and the content of a scene; as `measured_scene`.
    families : mapping of str to sequence of Scene
    variants : sequence of Variant
    making : Making

    Notes
    -----
    A part that ran out of time or memory, or died, is a row with its reason.
    """
    parts = [(v, scene) for rows in families.values() for v in variants for scene in rows]
    tasks = [
        Task(f"{scene.name} {variant.label}", measure,
             {"variant": variant.label, "content": scene_content(scene)}, (variant.label,))
        for variant, scene in parts
    ]  # fmt: skip
    found = making.parts(study, tasks, may_fail=True)
    rows = []
    for (variant, scene), own in zip(parts, found, strict=True):
        if isinstance(own, Failure):
            where = *_place(scene), variant.label
            own = [Measurement(*where, "solution", "", None, own.reason)]
        rows += own
    return rows


def measured_solve(scene: Scene, name: str, level: int, solution: Solution) -> SolveRecord:
    """Measure the solution of one level of a scene, held against an exact field if there is one."""
    from reference.exact import exact_of

    exact = exact_of(scene)
    record = SolveRecord(scene.name, name, level, Status.SOLVED, size=solution.size)
    (measured,) = assess_accuracy(scene, [record], {name: {level: solution}}, exact).solves
    return measured


def _solved(solver: Solver, variant: Variant, scene: Scene, level: int) -> Iterator[Row]:
    solution = checked_solution(solver.solve(scene, level, repetitions=1, **variant.parameters))
    measured = measured_solve(scene, variant.solver, level, solution)
    if measured.status is not Status.SOLVED:
        raise NotMeasuredError(measured.reason)
    for metric in measured.metrics:
        if metric.unit == "1" and metric.reference is None:
            yield metric.name, "", metric.value, ""
            if metric.name == "energy_drift":
                yield AT_MOST, "", metric.value + metric.uncertainty, ""
            continue
        yield metric.name, metric.unit, metric.value, ""
        if metric.reference:
            yield f"relative error of {metric.name}", "", error_interval(metric).value, ""
    for check in scene.acceptance:
        stated = measured.metric(check.metric) if isinstance(check, ValueCheck) else None
        if isinstance(check, ValueCheck) and stated is not None and check.equals:
            off = abs(stated.value - check.equals) / abs(check.equals)
            limit = check.relative_tolerance
            yield f"deviation of {check.metric}", "", off, check.source, limit
    for name, why in measured.notes.items():
        if measured.metric(name) is None and name in ("energy_drift", "displacement_l2"):
            yield name, "", None, why
    if not np.isfinite(solution.displacement).all():
        yield "solution", "", None, "not finite"


def missing_solutions(topic: str, own: Sequence[Measurement]) -> Iterator[Finding]:
    """Say in which rows a solver has no solution; a refusal is no failure."""
    failed = [m for m in own if m.value is None and m.quantity == "solution"]
    if failed:
        where = ", ".join(f"{m.size:g}" for m in failed if m.size is not None)
        text = f"No solution{f' at {where}' if where else ''}: {failed[0].reason}."
        refused = all("UnsupportedSceneError" in m.reason for m in failed)
        yield Finding(topic, text, "a solution, or a refusal", None if refused else Verdict.FAIL)


_DRIFT = 1e-2  # of the energy in play: what a spectator would not see
_KEPT = 1e-8
# momenta are in the table: the supports of most scenes change them
_BESIDE = ("energy_slope", "energy_oscillation", "energy_jump", "ledger_mismatch")


def energy_study(
    scenes: Sequence[Scene],
    variants: Sequence[Variant],
    making: Making,
    quick: bool = False,
) -> MeasuredStudy:
    """Run every motion with every solver, and measure the conserved quantities.

    Parameters
    ----------
    scenes : sequence of Scene
        Those that do not move are left out.
    variants : sequence of Variant
    making : Making
    quick : bool
        For the record.

    Raises
    ------
    InputError
        If no scene moves.
    """
    cases: dict[str, list[Scene]] = {}
    for scene in scenes:
        if scene.analysis.kind == "dynamic":
            name = scene.row.family if scene.row else scene.name
            cases.setdefault(name, []).append(scene)
    if not cases:
        raise InputError("no case with a dynamic analysis; see `verify list`")
    every = measured_families("energy", measured_scene, cases, variants, making)
    return MeasuredStudy(findings=list(_findings(every)), quick=quick, measurements=every)


def _findings(measured: Sequence[Measurement]) -> Iterator[Finding]:
    for case in dict.fromkeys(m.family for m in measured):
        for solver in dict.fromkeys(m.solver for m in measured if m.family == case):
            own = [m for m in measured if (m.family, m.solver) == (case, solver)]
            yield from missing_solutions(f"{case}, {solver}", own)
            yield from account_findings(f"{case}, {solver}", own)


def account_findings(topic: str, own: Sequence[Measurement]) -> Iterator[Finding]:
    """Judge what one solver keeps of its energy, and of the values that the case states."""
    drifts = _worst(own, "energy_drift")
    if drifts is not None:
        value, at = drifts
        grade = "is kept to round-off" if value <= _KEPT else "drifts"
        others = [f"{name} {found[0]:.2g}" for name in _BESIDE if (found := _worst(own, name))]
        text = f"The energy {grade}: {value:.3g} of the energy in play{at}"
        text += f" ({', '.join(others)})." if others else "."
        tops = {m.size: m.value or 0.0 for m in own if m.quantity == AT_MOST}
        values = {m.size: m.value or 0.0 for m in own if m.quantity == "energy_drift"}
        most = max([*tops.values(), value])
        least = max(2 * v - tops.get(size, v) for size, v in values.items())
        kept = None if least <= _DRIFT < most else most <= _DRIFT
        text += "" if kept is not None else f" Its interval reaches up to {most:.2g}."
        yield Finding(topic, text, f"at most {_DRIFT:g} over the run", held(kept))
    for name in dict.fromkeys(m.quantity for m in own if m.quantity.startswith("deviation of")):
        found, limit = _worst(own, name), min(m.limit or 0.0 for m in own if m.quantity == name)
        if found is not None:
            value, at = found
            text = f"The {name} from the value that the case states is {value:.2g}{at}."
            expected = f"at most {limit:g}, as the case asks"
            yield Finding(topic, text, expected, held(value <= limit))


def _worst(own: Sequence[Measurement], quantity: str) -> tuple[float, str] | None:
    """Return the largest value of a quantity, and at which value of the parameter."""
    known = [m for m in own if m.quantity == quantity and m.value is not None]
    if not known:
        return None
    worst = max(known, key=lambda m: abs(m.value or 0.0))
    return abs(worst.value or 0.0), "" if worst.size is None else f" at {worst.size:g}"
