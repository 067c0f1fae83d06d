"""Verdicts: whether a case keeps what it promises, given what is known about the truth.

Everything measured is an interval. PASS if all of it satisfies the limit, FAIL if none of it
does, UNDECIDED otherwise: the reference is too imprecise to tell. ERROR if a solve that the
check needs is missing, or its comparison failed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite

from verify.judge.checks import applied_checks, verdict_record
from verify.judge.convergence import ROUND_OFF
from verify.judge.intervals import (
    Interval,
    NotMeasuredError,
    error_interval,
    reference_share,
)
from verify.result import (
    REFERENCE,
    WITHIN,
    CaseResult,
    Metric,
    Rate,
    SolveRecord,
    Status,
    Verdict,
    VerdictRecord,
    finest_of,
)
from verify.scene import BoundCheck, RateCheck, RatioCheck, Scene, ValueCheck

Check = BoundCheck | RateCheck | RatioCheck | ValueCheck
Rows = Mapping[float, CaseResult]

# "equal mesh size" of two solvers: unstructured meshes do not meet a size exactly
_SAME_SIZE = 0.1
# of the energy that a blade releases, what is found again in a reference
_TO_CUT, _TO_SCHEME, _WAVES = (f"released_to_{name}" for name in ("cut", "scheme", "short_waves"))


def judge(
    scene: Scene,
    records: Sequence[SolveRecord],
    rates: Sequence[Rate],
    judge_only: Sequence[str] = (),
    rows: Rows | None = None,
) -> list[VerdictRecord]:
    """Judge every acceptance check of `scene` on what was measured, for each solver by itself.

    Parameters
    ----------
    scene : Scene
    records : sequence of SolveRecord
        All solves of the case, with their metrics.
    rates : sequence of Rate
    judge_only : sequence of str
        Solvers that are judged; empty: all that were asked and do not refuse the case.
    rows : mapping of float to CaseResult, optional
        Other rows of its family, by the value of the parameter. Without them a check against
        another row is not decided.

    Returns
    -------
    list of VerdictRecord
        One per check and solver, in the order of the scene, then of the solvers in `records`. Then
        whether forces at a cut have taken more than a blade releases, of each solver that has such.
    """
    verdicts = []
    coarser = next((r.notes[WITHIN] for r in records if WITHIN in r.notes), "")
    for applied in applied_checks(scene.acceptance, records, judge_only):
        check, found = applied.check, None
        try:
            if not applied.not_judged:
                found = _judged(check, records, rates, rows)
                found = replace(found, reference_share=_reference_share(check, records))
                if coarser and found.verdict is Verdict.UNDECIDED and found.reference_share:
                    found = replace(found, reason=f"a reference of {coarser}; {found.reason}")
        except NotMeasuredError as problem:
            verdict = Verdict.UNDECIDED if _left_out(check, records) else Verdict.ERROR
            found = verdict_record(check, verdict, str(problem))
        found = found or verdict_record(check, Verdict.UNDECIDED, applied.not_judged)
        verdicts.append(found)
    return [_marked(scene, one) for one in verdicts + _cut_works(records, judge_only)]


def _cut_works(records: Sequence[SolveRecord], judge_only: Sequence[str]) -> list[VerdictRecord]:
    """Judge what the forces at released cuts took against the energy release rate.

    What one element more or less makes is that of a level more or less. Without an exact rate it is
    what the forces, the scheme and the shortest waves of the reference took together; where the
    waves are not known, more than the rest is UNDECIDED.
    """
    judged = [
        solver
        for solver in dict.fromkeys(record.solver for record in records)
        if solver != REFERENCE and (not judge_only or solver in judge_only)
    ]
    found = []
    for solver in judged:
        own = [record for record in records if record.solver == solver]
        if not any(record.metric(_TO_CUT) for record in own):
            continue
        try:
            found.append(_cut_work(_levels(records, solver), records))
        except NotMeasuredError as problem:
            found.append(_excess(solver, Verdict.ERROR, None, "", str(problem)))
    return found


def _cut_work(own: Sequence[SolveRecord], records: Sequence[SolveRecord]) -> VerdictRecord:
    """Judge one solver, by its levels from coarse to fine."""
    solver, taken = own[-1].solver, _taken(own, (_TO_CUT,))
    exact, why, source = own[-1].metric("released"), "", "the reference"
    most: Interval | None = None
    if exact is not None:
        most, source = Interval(exact.value, exact.value, exact.value), "the exact field"
    else:
        try:
            reference = _levels(records, REFERENCE)
            waves = all(record.metric(_WAVES) for record in reference[-2:])
            names = (_TO_CUT, _TO_SCHEME, _WAVES) if waves else (_TO_CUT, _TO_SCHEME)
            most = _taken(reference, names)
            why = "" if waves else f"; without its short waves: {reference[-1].notes.get(_WAVES)}"
        except NotMeasuredError as problem:
            why = f": {problem}"
    if most is None or not isfinite(most.half_width):
        text = "what the blade releases is not known: no exact rate, no reference of two levels"
        return _excess(solver, Verdict.UNDECIDED, taken, "at most what is released", text + why)
    limit = f"at most {most.value:.4g} ± {most.half_width:.1g} J/m², by {source}"
    text = f"taken by the forces at the cut per area that the blade has swept{why}"
    if taken.high <= most.low:
        return _excess(solver, Verdict.PASS, taken, limit, text)
    if taken.low > most.high and not why:
        return _excess(solver, Verdict.FAIL, taken, limit, text)
    if not isfinite(taken.half_width):
        text += "; one level does not say how well that is known"
    return _excess(solver, Verdict.UNDECIDED, taken, limit, text)


def _excess(
    solver: str, verdict: Verdict, taken: Interval | None, limit: str, reason: str
) -> VerdictRecord:
    low, high, value = None, None, None
    if taken is not None:
        value = taken.value
        if isfinite(taken.half_width):
            low, high = taken.low, taken.high
    return VerdictRecord("excess", solver, _TO_CUT, verdict, value, low, high, limit, reason)


def _taken(levels: Sequence[SolveRecord], names: Sequence[str]) -> Interval:
    """Sum metrics on the finest level, give or take what that changed and they are not known to."""
    *before, value = (sum(_metric(record, name).value for name in names) for record in levels[-2:])
    width = abs(value - before[0]) if before else inf
    width += sum(_metric(levels[-1], name).uncertainty for name in names)
    return Interval(value, value - width, value + width)


def with_verdicts(
    scene: Scene, result: CaseResult, judge_only: Sequence[str] = (), rows: Rows | None = None
) -> CaseResult:
    """Return what was measured of a case with its verdicts; see `judge`."""
    return replace(result, verdicts=judge(scene, result.solves, result.rates, judge_only, rows))


def _judged(
    check: Check, records: Sequence[SolveRecord], rates: Sequence[Rate], rows: Rows | None
) -> VerdictRecord:
    match check:
        case RateCheck():
            return _judge_rate(check, records, rates)
        case BoundCheck():
            finest = _levels(records, check.solver)[-1]
            error, of = _error(finest, check.metric), _metric(finest, check.metric).width_from
            return _decide(check, error, 0.0, check.at_most, "error on the finest level", of)
        case ValueCheck():
            return _judge_value(check, records)
        case RatioCheck(row=None):
            return _judge_ratio(check, records, records, check.to)
        case RatioCheck(row=float(row)):
            if rows is not None and row in rows:
                return _judge_ratio(check, records, rows[row].solves, check.solver)
            text = "the row that it is compared with is judged after it"
            if rows is not None:
                text = f"the row {row:g} is not part of this run"
            return verdict_record(check, Verdict.UNDECIDED, text)
    raise TypeError(f"{check!r} is no acceptance check")


def _left_out(check: Check, records: Sequence[SolveRecord]) -> bool:
    """Whether all that a check misses may be levels of the reference that were asked to be out."""
    out = [record for record in records if record.status is not Status.SOLVED]
    own = any(record.solver == check.solver for record in out)
    return not own and any(
        record.solver == REFERENCE and record.status is Status.REFUSED for record in out
    )


def _marked(scene: Scene, found: VerdictRecord) -> VerdictRecord:
    """Enter the reason if the case lists this as a known finding; say if it is none any more."""
    for known in scene.known_findings:
        named = (known.check, known.metric, known.solver)
        if named != (found.check, found.metric, found.solver):
            continue
        if found.verdict is Verdict.FAIL:
            return replace(found, known=known.reason)
        if found.verdict is Verdict.PASS:
            text = "it passes, and is listed as a known finding: the entry can go"
            return replace(found, reason=f"{found.reason}; {text}")
    return found


def _judge_value(check: ValueCheck, records: Sequence[SolveRecord]) -> VerdictRecord:
    value = _metric(_levels(records, check.solver)[-1], check.metric).value
    allowed = check.relative_tolerance * abs(check.equals)
    known = Interval(value, value, value)
    off = abs(value - check.equals) / abs(check.equals) if check.equals else abs(value)
    text = f"off by {off:.2e} (relative); stated by: {check.source}"
    return _decide(check, known, check.equals - allowed, check.equals + allowed, text)


def _judge_ratio(
    check: RatioCheck,
    records: Sequence[SolveRecord],
    others: Sequence[SolveRecord],
    to: str | None,
) -> VerdictRecord:
    """Judge an error over that of the solver `to`, level by level."""
    ours, theirs = _levels(records, check.solver), _levels(others, to)
    if [r.level for r in ours] != [r.level for r in theirs]:
        raise NotMeasuredError(f"{check.solver} and {to} were not solved on the same levels")
    low, high, best = 0.0, check.at_most or 0.0, 0.0
    if check.within is not None:
        low, high, best = 1 - check.within, 1 + check.within, 1.0
    found = []
    for one, other in zip(ours, theirs, strict=True):
        a = _error(one, check.metric)
        b = _error(other, check.metric)
        if one.size and other.size and abs(one.size / other.size - 1) > _SAME_SIZE:
            text = f"level {one.level}: mesh sizes {one.size:.3g} and {other.size:.3g} m differ"
            return verdict_record(check, Verdict.UNDECIDED, text)
        if max(a.value, b.value) <= ROUND_OFF:
            text = f"level {one.level}: both errors ({a.value:.1e}, {b.value:.1e}) are round-off"
            return verdict_record(check, Verdict.UNDECIDED, text)
        if b.low <= 0.0:
            text = (
                f"level {one.level}: the uncertainty {b.half_width:.1e} is not below the error "
                f"{b.value:.1e} of {to}"
            )
            return verdict_record(check, Verdict.UNDECIDED, text)
        found.append((one.level, Interval(a.value / b.value, a.low / b.high, a.high / b.low)))
    all_levels = ", ".join(f"{ratio.value:.4g}" for _, ratio in found)
    decided = [
        _decide(check, ratio, low, high, f"worst at level {level}; by level {all_levels}")
        for level, ratio in found
    ]
    order = [Verdict.PASS, Verdict.UNDECIDED, Verdict.FAIL]
    return max(decided, key=lambda v: (order.index(v.verdict), abs((v.observed or 0.0) - best)))


def _judge_rate(
    check: RateCheck, records: Sequence[SolveRecord], rates: Sequence[Rate]
) -> VerdictRecord:
    for record in _levels(records, check.solver):
        if record.not_compared:  # a rate of the other levels would hide it
            text = f"{record.solver} level {record.level}: {record.not_compared}"
            raise NotMeasuredError(text)
    rate = next((r for r in rates if (r.solver, r.metric) == (check.solver, check.metric)), None)
    if rate is None:
        _metric(_levels(records, check.solver)[-1], check.metric)  # says why there is none
        raise NotMeasuredError(f"no rate of {check.metric} for {check.solver}")
    low, high = -float("inf"), float("inf")
    if check.at_least is not None:
        low = check.at_least
    else:
        assert check.equals is not None
        assert check.within is not None
        low, high = check.equals - check.within, check.equals + check.within
    if rate.order is not None:
        found = Interval(rate.order, rate.order - rate.uncertainty, rate.order + rate.uncertainty)
        slopes = ", ".join(f"{slope:.3f}" for slope in rate.pairwise)
        return _decide(check, found, low, high, f"slopes {slopes}")
    if rate.reason.startswith("diverging") and max(rate.pairwise) < low:
        worst = Interval(rate.pairwise[-1], min(rate.pairwise), max(rate.pairwise))
        return verdict_record(check, Verdict.FAIL, rate.reason, worst)
    if rate.reason.startswith("slowing") and (last := rate.pairwise[-1]) + rate.uncertainty < low:
        at_most = Interval(last, last - rate.uncertainty, last + rate.uncertainty)
        return verdict_record(check, Verdict.FAIL, rate.reason, at_most)
    return verdict_record(check, Verdict.UNDECIDED, rate.reason)


def _reference_share(check: Check, records: Sequence[SolveRecord]) -> float | None:
    """Return the largest share of the reference in an error that a check compares, if it does."""
    if isinstance(check, ValueCheck):
        return None
    solvers = {check.solver, check.to if isinstance(check, RatioCheck) else None}
    metrics = [s.metric(check.metric) for s in finest_of(records).values() if s.solver in solvers]
    shares = [reference_share(metric) for metric in metrics if metric is not None]
    return max((share for share in shares if share is not None), default=None)


def _decide(
    check: Check, found: Interval, low: float, high: float, text: str, of: str = ""
) -> VerdictRecord:
    """Judge an interval; `of` says what its half-width is from, if not from a reference."""
    if not isfinite(found.value):
        return verdict_record(check, Verdict.FAIL, f"{text}: not finite")
    if low <= found.low and found.high <= high:
        return verdict_record(check, Verdict.PASS, text, found)
    if found.high < low or found.low > high:
        return verdict_record(check, Verdict.FAIL, text, found)
    reason = (
        f"{text}: the uncertainty {found.half_width:.1e} is too large to tell {found.value:.4g} "
        "from the limit"
    )
    if isinstance(check, BoundCheck) and found.half_width > 0.1 * found.value:
        reason = (
            f"{text}: {'' if of else 'reference '}uncertainty {found.half_width:.1e} is not "
            f"clearly below the error {found.value:.1e} it judges"
        )
    if of:
        reason += f"; it is from {of}"
    return verdict_record(check, Verdict.UNDECIDED, reason, found)


def _levels(records: Sequence[SolveRecord], solver: str | None) -> list[SolveRecord]:
    """All solves of a solver, coarse to fine; every one must have finished."""
    own = sorted((r for r in records if r.solver == solver), key=lambda r: r.level)
    if not own:
        raise NotMeasuredError(f"'{solver}' was not run")
    for record in own:
        if record.status is not Status.SOLVED:
            raise NotMeasuredError(
                f"{solver} level {record.level} {record.status}: {record.reason}"
            )
    return own


def _metric(record: SolveRecord, name: str) -> Metric:
    metric = record.metric(name)
    if metric is None:
        why = record.notes.get(name, "it was not measured")
        raise NotMeasuredError(f"{record.solver} level {record.level} has no {name}: {why}")
    return metric


def _error(record: SolveRecord, name: str) -> Interval:
    metric = _metric(record, name)
    try:
        return error_interval(metric)
    except NotMeasuredError as problem:
        why = f": {record.notes[name]}" if name in record.notes else ""
        raise NotMeasuredError(f"{problem}{why}") from None
