"""Accuracy of the solutions of a case: metrics, rates, the reference.

A pure function of the scene and the stored solutions: it solves nothing and writes nothing.
"""

import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Protocol

import numpy as np

from verify.compare.blade import blade_forces, released_metrics
from verify.compare.body import AnyBody, body_of
from verify.compare.errors import (
    COARSER,
    ERROR_NAMES,
    ERRORS,
    FINEST,
    ErrorNorm,
    History,
    MeasuredNorm,
    Rules,
    base_of,
    compared_times,
    error_history,
    spread_of,
)
from verify.compare.hooke import Law, law_of
from verify.compare.locate import ROUND_OFF, SolutionField
from verify.compare.motion import SolutionMotion
from verify.compare.motion_account import motion_account
from verify.compare.part_account import (
    ACCOUNT,
    account_metrics,
    ledger_notices,
    motion_history,
    part_metrics,
    part_records,
)
from verify.compare.simplices import cells_of, share_inside_out, straight_or_raise
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.checks import result_of
from verify.judge.contact import contact_metrics, exact_contact
from verify.judge.convergence import observed_rate, shifted_ends
from verify.judge.cut_errors import MIXED, are_mixed, measured_cut, with_cut, with_other_errors
from verify.judge.intervals import error_interval, sufficiency
from verify.judge.notices import (
    INSIDE_OUT,
    absurd_strain,
    doubtful_errors,
    inside_out_notices,
    locking_notices,
    ringing_factors,
    unavailable_quantities,
)
from verify.judge.quantities import Measured, unit_of
from verify.judge.reference import (
    OTHER,
    ExactField,
    Reference,
    compared_size,
    conforming_reference,
    exact_reference,
)
from verify.judge.resultants import resultants_over_time
from verify.printable import one_line
from verify.result import (
    COMPARISON_FAILED,
    REFERENCE,
    CaseResult,
    Metric,
    Rate,
    ReferenceRecord,
    SolveRecord,
    Status,
)
from verify.scene import BoundCheck, Scene
from verify.solution import Solution

# A solver may drop slivers; a mesh that misses more of the body than this is another body.
_COVERED = 0.01
_LOOKED_AT = 20_000  # points of a body, about: a hole of that share has two hundred
_ON_SURFACE = 0.01  # of the size of a membrane: so far apart two triangulations of it may be
_SAME_TIME = 1e-6  # of the duration
# Integration errors that do not count: as shares of what the reference leaves open, of errors that
# are judged, and of those that are only shown.
_COUNTS, _JUDGED, _SHOWN = 0.2, 0.02, 0.05
_CHANCE = 0.005  # of an error: two rules may agree by chance, and less is not claimed of them


class Kept(Protocol):
    """Measured solves of a comparison that may be stopped."""

    def measured(self, record: SolveRecord) -> SolveRecord | None:
        """Return a solve as it was measured before, or None."""
        ...

    def keep(self, record: SolveRecord) -> None:
        """Keep a solve that was measured."""
        ...


def assess_accuracy(
    scene: Scene,
    records: Sequence[SolveRecord],
    solutions: Mapping[str, Mapping[int, Solution]],
    exact: ExactField | None = None,
    announce: Callable[[SolveRecord], None] = lambda record: None,
    kept: Kept | None = None,
) -> CaseResult:
    """Measure all solutions of a case.

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
    announce : callable
        Is told of each solve before it is measured.
    kept : Kept, optional
        Solves that were measured before a comparison was stopped; those measured now are added.

    Returns
    -------
    CaseResult
        Without verdicts, pictures and provenance.

    Raises
    ------
    InputError
        If the scene is judged by an exact solution and `exact` is None.
    """
    if scene.judged_by_exact and exact is None:
        raise InputError("the scene is judged by its exact solution, which was not given")
    law = law_of(scene)
    body, missing = _body(scene, exact)
    measured = [_noted(record, _named(scene, missing)) for record in records]
    reference: Reference | None = None
    if body is not None:
        rules_for = cache(partial(Rules, body))
        measured, solutions = _fit(scene, records, solutions)
        reference, missing = _reference(scene, records, solutions, exact, body, law, rules_for)
        held = _HeldAgainst(reference, missing, exact, rules_for, announce, kept)
        for level in sorted({record.level for record in records}):
            own = {i: s for i, r in enumerate(measured)
                   if r.level == level and (s := _solved(r, solutions)) is not None}  # fmt: skip
            if own:
                _measure_level(scene, measured, own, body, law, held)
    rates = _rates(scene, measured)
    record = reference.record if reference else ReferenceRecord("none", reason=missing)
    if record.kind == "conforming":
        levels = len(record.levels or ())
        record = replace(record, **sufficiency(scene, measured, REFERENCE, levels))
    judged = [record for record in measured if record.solver != REFERENCE]
    notices = [
        *unavailable_quantities(scene, measured),
        *ledger_notices(judged),
        *doubtful_errors(scene, judged),
        *inside_out_notices(judged),
        *locking_notices(scene, {n: s for n, s in solutions.items() if s and n != REFERENCE}),
        *(absurd_strain(scene, measured, solutions, law, body.measure) if body else []),
        *ringing_factors(scene, solutions.get(REFERENCE, {})),
    ]
    return result_of(scene, record, measured, rates=rates, notices=notices)


@dataclass(frozen=True)
class _HeldAgainst:
    """What all solves of a case are held against, who is told, and what was measured before."""

    reference: Reference | None
    missing: str  # why there is no reference
    exact: ExactField | None
    rules_for: Callable[[float], Rules]
    announce: Callable[[SolveRecord], None]
    kept: Kept | None


def _measure_level(
    scene: Scene, measured: list[SolveRecord], own: Mapping[int, Solution], body: AnyBody,
    law: Law, held: _HeldAgainst,
) -> None:  # fmt: skip
    """Measure the solves of a level, by their places among all, as far as that is to be done.

    At the same points for all of them: their errors are compared.
    """
    reference, finest = held.reference, min(compared_size(one, body) for one in own.values())
    rules = held.rules_for(finest)
    if reference and rules is not reference.rules:
        held = replace(held, reference=replace(reference, motion=reference.motion.afresh()))
    for i, solution in own.items():
        record = measured[i]
        if held.kept and (before := held.kept.measured(record)) is not None:
            measured[i] = before
            continue
        held.announce(record)
        try:
            here = Measured(solution, body, law, scene, measured_cut(solution, body, rules))
            measured[i] = _measure(record, here, held, rules)
            if held.kept:
                held.kept.keep(measured[i])
        except Exception as problem:  # a fault of the comparison costs this solve alone
            traceback.print_exception(problem)  # for the log
            why = one_line(f"{type(problem).__name__}: {problem}")
            measured[i] = not_compared(scene, record, why)


def _body(scene: Scene, exact: ExactField | None) -> tuple[AnyBody | None, str]:
    """Return the body if it can be compared on, else why it cannot."""
    try:
        return body_of(scene, None if exact is None else np.asarray(exact.singular_points)), ""
    except UnsupportedSceneError as problem:
        return None, str(problem)


def _reference(
    scene: Scene,
    records: Sequence[SolveRecord],
    solutions: Mapping[str, Mapping[int, Solution]],
    exact: ExactField | None,
    body: AnyBody,
    law: Law,
    rules_for: Callable[[float], Rules],
) -> tuple[Reference | None, str]:
    """Find the reference, or say why there is none."""
    try:
        if scene.judged_by_exact:
            assert exact is not None
            return exact_reference(scene, exact, body, law), ""
        levels = solutions.get(REFERENCE, {})
        judged = [s for name, own in solutions.items() if name != REFERENCE for s in own.values()]
        sizes = (compared_size(s, body) for s in judged or levels.values())
        finest = min(sizes, default=body.size / 50)
        others = solutions.get(OTHER)
        return conforming_reference(scene, levels, body, law, rules_for(finest), others), ""
    except InputError as problem:
        for one in records:
            if one.solver == REFERENCE and one.reason:
                cause = f"level {one.level} of the reference: {one.reason}; "
                refused = one.status is Status.REFUSED  # another size would not help
                return None, f"{cause}{'it needs at least 3 levels' if refused else problem}"
        return None, str(problem)


def _fit(
    scene: Scene,
    records: Sequence[SolveRecord],
    solutions: Mapping[str, Mapping[int, Solution]],
) -> tuple[list[SolveRecord], Mapping[str, Mapping[int, Solution]]]:
    """Leave out solutions that no comparison can be made of; their solves are failed ones."""
    kept, fit = list(records), {name: dict(own) for name, own in solutions.items()}
    for i, record in enumerate(kept):
        solution = _solved(record, solutions)
        if solution is not None and (defect := _unfit(scene, solution)):
            del fit[record.solver][record.level]
            reason = f"its solution cannot be compared: {defect}"
            kept[i] = replace(record, status=Status.FAILED, reason=reason)
    return kept, {name: own for name, own in fit.items() if own}


def _named(scene: Scene, reason: str) -> dict[str, str]:
    """Say of everything that the case asks about why it was not measured."""
    asked = [c.metric for c in scene.acceptance] + [q.name for q in scene.quantities]
    return dict.fromkeys(["comparison", *asked], reason)


def not_compared(scene: Scene, record: SolveRecord, why: str) -> SolveRecord:
    """Return the record of a solve whose comparison failed: solved, and without any metric."""
    return replace(_noted(record, _named(scene, f"{COMPARISON_FAILED}: {why}")), metrics=[])


def _unfit(scene: Scene, solution: Solution) -> str:
    """Say why no comparison can be made of a solution, or nothing: a fault of its solver."""
    given, wanted = (
        f"cells of dimension {one.cell_dimension} in space of dimension {one.dimension}"
        for one in (solution, scene)
    )
    if given != wanted:
        return f"{given}; expected {wanted}"
    if cells_of(solution).degenerate.all():
        return "all its cells are without volume"
    if solution.order == 2:
        try:
            straight_or_raise(solution.points, solution.cells)
        except InputError as problem:
            return str(problem)
    return ""


def _solved(
    record: SolveRecord, solutions: Mapping[str, Mapping[int, Solution]]
) -> Solution | None:
    if record.status is not Status.SOLVED:
        return None
    return solutions.get(record.solver, {}).get(record.level)


def _noted(record: SolveRecord, notes: dict[str, str]) -> SolveRecord:
    return replace(record, notes={**record.notes, **notes})


def _measure(record: SolveRecord, one: Measured, held: _HeldAgainst, rules: Rules) -> SolveRecord:
    """Fill in the metrics of one solve; what cannot be measured gets a note that says why."""
    scene, reference = one.scene, held.reference
    record, other = with_cut(record, one, rules)
    if defect := _defect(scene, one, rules):
        return _noted(record, _named(scene, defect))
    covered = one.coverage
    if abs(covered - 1) > 1e-9:
        record = _noted(record, {"coverage": f"cells cover the body times {covered:.9f}"})
    if (off := one.motion.off_surface) > ROUND_OFF * one.body.size:
        record = _noted(record, {"surface": f"up to {off:.3g} m off the surface of the scene"})
    if scene.analysis.kinematics != "linear" and (share := share_inside_out(one.solution)):
        record = _noted(record, {INSIDE_OUT: f"{share:.2g} of the volume"})
    # the reference does not judge itself: its finest level would have no error
    own = record.solver == REFERENCE and not scene.judged_by_exact
    metrics, notes = _quantities(scene, one, None if own else reference)
    if scene.contact.closed:
        kept, why = _contact(one, None if own else reference, rules, held.exact)
        metrics, notes = metrics + kept, notes | why
    if scene.analysis.kind == "dynamic":
        account = motion_account(scene, one.solution, one.law)
        parts = part_records(scene, one.solution, account)
        truth = held.exact if scene.judged_by_exact else None
        size = compared_size(one.solution, one.body)
        for kept, why in (
            account_metrics(scene, account),
            part_metrics(parts, account),
            released_metrics(scene, one.solution, size, one.law, account, truth),
        ):
            metrics, notes = metrics + kept, notes | why
        if account.lighter:
            notes["parts"] = f"{account.lighter} lighter parts are not listed"
        history = motion_history(account)
        if history:
            history |= blade_forces(scene, account)
            history |= resultants_over_time(one.weak_form, scene.quantities)
        record = replace(record, account=history, parts=parts)
    if reference is None:
        without = _named(scene, held.missing)
        notes = {name: why for name, why in without.items() if name not in ACCOUNT} | notes
    elif not own:
        errors, why, record = _errors(one, reference, rules, record, other)
        metrics, notes = errors + metrics, notes | why
    return _noted(replace(record, metrics=metrics), notes)


def _defect(scene: Scene, one: Measured, rules: Rules) -> str:
    """Say why a solution is of another body or of another time than the scene."""
    covered, times = one.coverage, one.solution.times
    if abs(covered - 1) > _COVERED:
        return f"the cells of the solution cover {covered:.4g} of the body"
    if one.motion.off_surface > _ON_SURFACE * one.body.size:
        return f"the solution lies up to {one.motion.off_surface:.3g} m off the surface of the body"
    if (outside := one.outside) > _COVERED:
        return f"{outside:.4g} of the volume of the solution lies outside the body"
    rule, off = rules.one("body", COARSER[-1]), _ON_SURFACE * one.body.size
    some = slice(None, None, 1 + len(rule.points) // _LOOKED_AT)
    missing = SolutionField(one.solution).missing(rule.points[some], rule.weights[some], off)
    if missing > _COVERED:
        return f"{missing:.4g} of the body is in no cell of the solution; as much is there twice"
    duration = scene.analysis.duration
    if duration is not None and abs(times[-1] - duration) > _SAME_TIME * duration:
        return f"the solution ends at {times[-1]:.6g} s; the scene at {duration:.6g} s"
    return ""


def _quantities(
    scene: Scene, one: Measured, reference: Reference | None
) -> tuple[list[Metric], dict[str, str]]:
    metrics, notes = [], {}
    for asked in scene.quantities:
        try:
            value = one.quantity(asked)
        except (UnsupportedSceneError, InputError) as problem:
            notes[asked.name] = str(problem)
            continue
        known, width = (
            reference.quantities.get(asked.name, (None, 0.0)) if reference else (None, 0.0)
        )
        source = reference.source if reference else ""
        unit = unit_of(asked, scene.dimension)
        metrics.append(Metric(asked.name, value, unit, known, width, source))
    return metrics, notes


def _contact(
    one: Measured, reference: Reference | None, rules: Rules, exact: ExactField | None
) -> tuple[list[Metric], dict[str, str]]:
    """Measure the contact of the faces of cuts."""
    rule, truth = rules.on_cuts(), None
    if rule is None:
        return [], {"contact_pressure": "no cut lies inside the body"}
    if reference is not None:
        truth = reference.contact
        if one.scene.judged_by_exact:
            last = float(one.solution.times[-1])
            truth = exact_contact(exact, one.law, rule, last, reference.source)
    size = compared_size(one.solution, one.body)
    turns = one.scene.analysis.kinematics != "linear"
    return contact_metrics(one.solution, one.motion, rule, truth, size, turns)


def _errors(
    one: Measured,
    reference: Reference,
    rules: Rules,
    record: SolveRecord,
    other: SolutionMotion | None,
) -> tuple[list[Metric], dict[str, str], SolveRecord]:
    """Measure the errors by the coarser rules, then by the finest what these leave too open."""
    times = compared_times(one.scene, one.solution)
    measure = partial(error_history, one.motion, reference.motion, times, rules, one.law)
    try:
        history = measure(COARSER)
        if again := _too_open(one.scene, history, reference, one.body.dimension):
            history = history.after(measure(FINEST, again))
    except InputError as problem:  # the reference does not reach that far in time
        return [], _named(one.scene, str(problem)), record
    metrics, notes = [], _time_note(history, reference)
    for name, norms in history.reported().items():
        found = _integrated(name, norms, one.body.dimension)
        value = found.norm.relative
        if not np.isfinite(value):
            notes[name] = f"the reference is zero; the absolute error is {found.norm.absolute:.3e}"
            continue
        if name not in reference.norms:
            notes[name] = "the reference's own error in this norm is not known"
            continue
        known = _known_to(name, found.norm, reference)
        width = known + found.integration_error
        of = "the integration over cells" if found.integration_error > known else ""
        metrics.append(Metric(name, value, "1", None, width, reference.source, of))
    record = with_other_errors(record, other, reference.motion, times, rules, one.law)
    return metrics, notes, replace(record, series=history.series())


def _integrated(name: str, norms: Sequence[ErrorNorm], dimension: int) -> MeasuredNorm:
    """Return an error with its integration error; by two rules a maximum at points is a guess."""
    found = spread_of(norms, dimension)
    if len(norms) == len(COARSER):
        least = (_SHOWN if ERRORS[base_of(name)].largest else _CHANCE) * found.norm.relative
        found = replace(found, integration_error=max(found.integration_error, least))
    return found


def _known_to(name: str, norm: ErrorNorm, reference: Reference) -> float:
    """Half-width of a relative error by that of the reference alone."""
    known = reference.norms[name] / norm.scale if norm.scale else 0.0
    # the scale is as uncertain as the reference: (1 + value), to first order
    return known * (1 + norm.relative)


def _too_open(scene: Scene, history: History, reference: Reference, dimension: int) -> list[str]:
    """Errors that the rules so far leave open: in an interval of any account, or in a verdict.

    The integration error counts if it is more than a fifth of what the reference leaves open and
    more than a small share of the error, or if a limit lies within. With one all of its place are
    measured again: they have the same points.
    """
    places = set()
    for name, norms in history.reported().items():
        found = _integrated(name, norms, dimension)
        value, off = found.norm.relative, found.integration_error
        if not np.isfinite(value) or name not in reference.norms:
            continue
        known = _known_to(name, found.norm, reference)
        checks = [check for check in scene.acceptance if check.metric == name]
        limits = [check.at_most for check in checks if isinstance(check, BoundCheck)]
        if off > max(_COUNTS * known, (_JUDGED if checks else _SHOWN) * value) or any(
            abs(limit - value) <= known + off for limit in limits
        ):
            places.add(ERRORS[base_of(name)].place)
    return [name for name in history.norms if ERRORS[name].place in places]


def _time_note(history: History, reference: Reference) -> dict[str, str]:
    times = [time for time in history.times if time is not None]
    between = sum(not reference.motion.known_at(time) for time in times)
    if not between:
        return {}
    return {
        "times": f"the reference is interpolated linearly at {between} of {len(times)} output times"
    }


def _rates(scene: Scene, records: Sequence[SolveRecord]) -> list[Rate]:
    """Rates of every error, and of every quantity that is not exact on some level."""
    fields = {q.name for q in scene.quantities if q.kind in ("displacement", "opening", "stress")}
    names = [*ERROR_NAMES, *(q.name for q in scene.quantities)]
    rates = []
    for solver in dict.fromkeys(record.solver for record in records):
        own = sorted((r for r in records if r.solver == solver), key=lambda r: r.level)
        for name in names:
            rows = [
                (record.size, error_interval(metric))
                for record in own
                if record.size
                and (metric := record.metric(name)) is not None
                and (name in ERROR_NAMES or metric.reference)
            ]
            if rows:
                sizes, errors = zip(*rows, strict=True)
                values, widths = [e.value for e in errors], [e.high - e.value for e in errors]
                rate = observed_rate(solver, name, sizes, values, widths)
                mixed = name in {*ERROR_NAMES, *fields} and are_mixed(own)
                reason = (MIXED if mixed else "") or shifted_ends(own)
                rates.append(replace(rate, order=None, reason=reason) if reason else rate)
    return rates
