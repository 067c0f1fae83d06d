"""How accurate are the solutions of a case? Metrics, rates, the reference, verdicts.

A pure function of the scene and the stored solutions: it solves nothing and writes nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from verify.compare.body import Body, body_of
from verify.compare.cut_line import CutRule
from verify.compare.hooke import Hooke, hooke
from verify.compare.integration import cut_rules, integrate_norm, rules
from verify.compare.sampled import Sampled
from verify.compare.slabs import Rule
from verify.errors import InputError, UnsupportedSceneError
from verify.result import CaseResult, Metric, Rate, SolveRecord, Status
from verify.scene import Scene, scene_hash
from verify.solution import Solution
from verify.study.quantities import Measured, unit_of
from verify.study.rates import observed_rate
from verify.study.reference import (
    ERRORS,
    ExactField,
    Reference,
    conforming_reference,
    exact_reference,
    size_of,
)
from verify.verdict import error_interval, judge

__all__ = ["assess_accuracy"]

REFERENCE = "reference"

# A solver may drop slivers; a mesh that misses more of the body than this is another body.
_COVERED = 0.01


def assess_accuracy(
    scene: Scene,
    records: Sequence[SolveRecord],
    solutions: Mapping[str, Mapping[int, Solution]],
    exact: ExactField | None = None,
) -> CaseResult:
    """Measure all solutions of a case and judge its requirements.

    Parameters
    ----------
    scene : Scene
    records : sequence of SolveRecord
        Every solve of the case, failed ones included; their metrics are filled in.
    solutions : mapping of solver to mapping of level to Solution
        Solutions of the solved records. Those of ``"reference"`` are the reference where no
        exact solution judges.
    exact : object with ``displacement``, ``gradient`` and ``singular_points``, optional
        The exact solution that the scene names.

    Returns
    -------
    CaseResult
        Without pictures and provenance.

    Raises
    ------
    InputError
        If the scene is judged by an exact solution and `exact` is None.
    """
    if scene.judged_by_exact and exact is None:
        raise InputError("the scene is judged by its exact solution, which was not given")
    law = hooke(scene.material)
    reference, missing, body = _reference(scene, solutions, exact, law)
    measured: list[SolveRecord] = list(records)
    for level in sorted({record.level for record in records}):
        rows = [i for i, record in enumerate(records) if record.level == level]
        own = {i: s for i in rows if (s := _solved(records[i], solutions)) is not None}
        if body is None:
            names = [*ERRORS, *(q.name for q in scene.quantities)]
            measured = [_noted(r, dict.fromkeys(names, missing)) for r in measured]
        elif own:
            # the same points for all solvers of a level: their errors are compared
            ruler = _Ruler(body, min(size_of(s) for s in own.values()), reference)
            for i, solution in own.items():
                one = Measured(solution, body, law)
                measured[i] = _measure(scene, records[i], one, reference, missing, ruler)
    rates = _rates(scene, measured)
    record = reference.record if reference else {"kind": "none", "reason": missing}
    return CaseResult(
        case=scene.name,
        title=scene.title,
        requirement=scene.requirement,
        scene_hash=scene_hash(scene),
        scene=scene.model_dump(mode="json", by_alias=True),
        reference=record,
        solves=measured,
        rates=rates,
        verdicts=judge(scene, measured, rates),
    )


def _reference(
    scene: Scene,
    solutions: Mapping[str, Mapping[int, Solution]],
    exact: ExactField | None,
    law: Hooke,
) -> tuple[Reference | None, str, Body | None]:
    """Find the reference, or say why there is none, and the body if it can be compared on."""
    try:
        body = body_of(scene, None if exact is None else np.asarray(exact.singular_points))
    except UnsupportedSceneError as problem:
        return None, str(problem), None
    try:
        if scene.judged_by_exact:
            assert exact is not None
            return exact_reference(scene, exact, body, law), "", body
        levels = solutions.get(REFERENCE, {})
        judged = [s for name, own in solutions.items() if name != REFERENCE for s in own.values()]
        finest = min((size_of(s) for s in judged or levels.values()), default=body.size / 50)
        return conforming_reference(scene, levels, body, law, finest), "", body
    except InputError as problem:
        return None, str(problem), body


class _Ruler:
    """Quadrature for one mesh level, and the reference at its points."""

    def __init__(self, body: Body, size: float, reference: Reference | None) -> None:
        self.families: dict[type, Any] = {Rule: rules(body, size), CutRule: cut_rules(body, size)}
        self.reference = Sampled(reference.field) if reference else None


def _solved(
    record: SolveRecord, solutions: Mapping[str, Mapping[int, Solution]]
) -> Solution | None:
    if record.status is not Status.SOLVED:
        return None
    return solutions.get(record.solver, {}).get(record.level)


def _noted(record: SolveRecord, notes: dict[str, str]) -> SolveRecord:
    return replace(record, notes={**record.notes, **notes})


def _measure(
    scene: Scene,
    record: SolveRecord,
    one: Measured,
    reference: Reference | None,
    missing: str,
    ruler: _Ruler,
) -> SolveRecord:
    """Fill in the metrics of one solve; what cannot be measured gets a note that says why."""
    covered = one.coverage
    if abs(covered - 1) > _COVERED:
        text = f"the cells of the solution cover {covered:.4g} of the body"
        return _noted(record, dict.fromkeys([*ERRORS, *(q.name for q in scene.quantities)], text))
    if abs(covered - 1) > 1e-9:
        record = _noted(record, {"coverage": f"cells cover the body times {covered:.9f}"})
    # the reference does not judge itself: its finest level would have no error
    own = record.solver == REFERENCE and not scene.judged_by_exact
    judge_of = None if own else reference
    metrics = []
    for asked in scene.quantities:
        known, width = judge_of.quantities[asked.name] if judge_of else (None, 0.0)
        source = judge_of.source if judge_of else ""
        unit = unit_of(asked, scene.dimension)
        metrics.append(Metric(asked.name, one.quantity(asked), unit, known, width, source))
    if reference is None:
        names = [*ERRORS, *(q.name for q in scene.quantities)]
        return _noted(replace(record, metrics=metrics), dict.fromkeys(names, missing))
    if own:
        return replace(record, metrics=metrics)
    errors, notes = _errors(one, reference, ruler)
    return _noted(replace(record, metrics=errors + metrics), notes)


def _errors(
    one: Measured, reference: Reference, ruler: _Ruler
) -> tuple[list[Metric], dict[str, str]]:
    metrics, notes = [], {}
    for name, (measure, kind, _) in ERRORS.items():
        if kind is CutRule and not one.body.parts:
            continue

        def norm(rule: Any, measure: Any = measure) -> Any:
            return measure(one.field, ruler.reference, rule, one.law)

        found = integrate_norm(norm, ruler.families[kind])
        value = found.norm.relative
        if not np.isfinite(value):
            notes[name] = f"the reference is zero; the absolute error is {found.norm.absolute:.3e}"
            continue
        known = reference.norms[name] / found.norm.scale if found.norm.scale else 0.0
        # the scale is as uncertain as the reference: (1 + value), to first order
        width = known * (1 + value) + found.integration_error
        metrics.append(Metric(name, value, "1", None, width, reference.source))
    return metrics, notes


def _rates(scene: Scene, records: Sequence[SolveRecord]) -> list[Rate]:
    """Rates of every error, and of every quantity that is not exact on some level."""
    names = [*ERRORS, *(q.name for q in scene.quantities)]
    rates = []
    for solver in dict.fromkeys(record.solver for record in records):
        own = sorted((r for r in records if r.solver == solver), key=lambda r: r.level)
        for name in names:
            rows = [
                (record.size, error_interval(metric))
                for record in own
                if record.size
                and (metric := record.metric(name)) is not None
                and (name in ERRORS or metric.reference)
            ]
            if rows:
                sizes, errors = zip(*rows, strict=True)
                values, widths = [e.value for e in errors], [e.high - e.value for e in errors]
                rates.append(observed_rate(solver, name, sizes, values, widths))
    return rates
