"""Verdicts: whether a case keeps what it promises, given what is known about the truth.

Everything measured is an interval. PASS if all of it satisfies the limit, FAIL if none of it
does, UNDECIDED otherwise: the reference is too imprecise to tell. ERROR if a solve that the
check needs is missing, or its comparison failed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite

from verify.judge.checks import applied_checks, verdict_record
from verify.judge.intervals import (
    Interval,
    NotMeasuredError,
    error_interval,
    reference_share,
)
from verify.judge.rates import ROUND_OFF
from verify.result import (
    REFERENCE,
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
_OF_REFERENCE = ("released_to_cut", "released_to_scheme", "released_to_short_waves")


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
    for applied in applied_checks(scene.acceptance, records, judge_only):
        check, found = applied.check, None
        try:
            if not applied.not_judged:
                found = _judged(check, records, rates, rows)
                found = replace(found, reference_share=_reference_share(check, records))
        except NotMeasuredError as problem:
            found = verdict_record(check, Verdict.ERROR, str(problem))
        found = found or verdict_record(check, Verdict.UNDECIDED, applied.not_judged)
        verdicts.append(_marked(scene, found))
    return verdicts + _cut_works(records, judge_only)


def _cut_works(records: Sequence[SolveRecord], judge_only: Sequence[str]) -> list[VerdictRecord]:
    """Judge what the forces at released cuts took against the energy release rate.

    What one element more or less makes is that of a level more or less. Without an exact rate it is
    what the forces, the scheme and the shortest waves of the reference took together.
    """
    found = []
    for solver in dict.fromkeys(record.solver for record in records):
        taken = _taken(records, solver, ("released_to_cut",))
        if taken is None or solver == REFERENCE or (judge_only and solver not in judge_only):
            continue
        finest = max((r for r in records if r.solver == solver), key=lambda r: r.level)
        exact, most, source = finest.metric("released"), None, "the reference"
        if exact is not None:
            most, source = Interval(exact.value, exact.value, exact.value), "the exact field"
        else:
            most = _taken(records, REFERENCE, _OF_REFERENCE)
        verdict, limit = Verdict.UNDECIDED, "at most what the blade releases"
        text = "what the blade releases is not known: no exact rate, and no reference of two levels"
        if most is not None:
            limit = f"at most {most.high:.4g} J/m², by {source}"
            text = "taken by the forces at the cut per area that the blade has swept"
            alone = taken.half_width == inf
            if (taken.value if alone else taken.high) <= most.high:
                verdict = Verdict.PASS
            elif taken.low > most.high:
                verdict = Verdict.FAIL
            if alone:
                text += "; one level does not say how well that is known"
            elif verdict is Verdict.UNDECIDED:
                text += "; the limit lies within what the last level changed"
        low, high = (None, None) if taken.half_width == inf else (taken.low, taken.high)
        found.append(
            VerdictRecord(
                "excess", solver, "released_to_cut", verdict, taken.value, low, high, limit, text
            )
        )
    return found


def _taken(records: Sequence[SolveRecord], solver: str, names: Sequence[str]) -> Interval | None:
    """Sum the metrics of a solver that has the first, give or take what its last level changed."""
    own = sorted((r for r in records if r.solver == solver), key=lambda r: r.level)
    values = [
        sum(metric.value for name in names if (metric := record.metric(name)) is not None)
        for record in own[-2:]
        if record.metric(names[0]) is not None
    ]
    if not values or own[-1].metric(names[0]) is None:
        return None
    width = abs(values[-1] - values[0]) if len(values) > 1 else inf
    if width == inf and solver == REFERENCE:
        return None
    return Interval(values[-1], values[-1] - width, values[-1] + width)


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
            error = _error(_levels(records, check.solver)[-1], check.metric)
            return _decide(check, error, 0.0, check.at_most, "error on the finest level")
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
    low, high = 0.0, check.at_most or 0.0
    if check.within is not None:
        low, high = 1 - check.within, 1 + check.within
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
    centre = 0.5 * (low + high) if check.within is not None else 0.0
    return max(decided, key=lambda v: (order.index(v.verdict), abs((v.observed or 0.0) - centre)))


def _judge_rate(
    check: RateCheck, records: Sequence[SolveRecord], rates: Sequence[Rate]
) -> VerdictRecord:
    for record in _levels(records, check.solver):
        if record.not_compared:  # a rate of the other levels would hide it
            text = f"{record.solver} level {record.level}: {record.not_compared}"
            raise NotMeasuredError(text)
    rate = next((r for r in rates if (r.solver, r.metric) == (check.solver, check.metric)), None)
    if rate is None:
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
    if rate.reason.startswith("slowing") and rate.pairwise[-1] + rate.uncertainty < low:
        least = min(rate.pairwise[-1] - rate.uncertainty, *rate.pairwise)
        at_most = Interval(rate.pairwise[-1], least, rate.pairwise[-1] + rate.uncertainty)
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


def _decide(check: Check, found: Interval, low: float, high: float, text: str) -> VerdictRecord:
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
            f"{text}: reference uncertainty {found.half_width:.1e} is not clearly below the "
            f"error {found.value:.1e} it judges"
        )
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
