"""Answers of a run to the four questions: accuracy, energy, slivers, cost; each in one sentence.

How large are the displacement errors, does the energy drift, what do slivers do, and what does
accuracy cost? Numbers come from the results alone. An error and a time are divided by the error
and time of conforming elements (`BASELINE`) in the same case, if solved. The error itself
depends on the case more than on the method. The interval of a median holds the spread over cases
and the uncertainty of each.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, NamedTuple

from verify.report.curves import Curve, Point, error_curves
from verify.report.notation import ROUND_OFF, number, solver_title
from verify.result import (
    CRITICAL_STEP,
    REFERENCE,
    CaseResult,
    SolveRecord,
    Status,
    Verdict,
    finest_of,
    times_at_equal_error,
)

BASELINE = "conforming"
_ERROR = "displacement_l2"
_TAKERS = ("a blade", "damping")  # sinks of energy that a case states
_NAMED = 3  # solvers in a sentence
_BEYOND = 0.1  # probability that a median lies outside its interval
_PARAMETER = "epsilon"  # of a family of slivers, in elements


class Ratio(NamedTuple):
    """A number and the interval of what it may be in truth."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Answer:
    """Question, outcome in a sentence, and the case that its panel draws, if it draws one."""

    question: str
    sentence: str
    example: str = ""


@dataclass(frozen=True)
class SliverCurve:
    """A measure of one solver in one family over ε, as a share of that at the largest ε."""

    solver: str
    family: str
    measure: str  # "error" or "critical step"
    places: list[tuple[float, float]]


def answers(results: Sequence[CaseResult]) -> list[Answer]:
    """Return the answers of a run: accuracy, energy, slivers, cost."""
    return [accuracy(results), energy(results), slivers(results), cost(results)]


def accuracy(results: Sequence[CaseResult]) -> Answer:
    """Answer how large displacement errors are, beside conforming elements."""
    question, found = "Accuracy", dict(_ratios(results, _error_ratio))
    if found:
        found = {name: _over_cases(own) for name, own in found.items()}
        said = _compared(found, "has", "displacement error of {} at equal element size")
        alone = all(len(own) == 1 for own in found.values())
        of_what = "of the reference" if alone else "over cases and of their references"
        said += f" The interval is that {of_what}."
        more = _left_out(results, found) + _failing(results, found)
        return Answer(question, said + more, _example(results, found))
    errors = {s: own for s, own in _finest_errors(results).items() if own}
    if not errors:
        known = [p for r in results for c in compared_curves(r) for p in c.points]
        if known and all(p.value <= ROUND_OFF for p in known):
            return Answer(question, "All displacement errors are at round-off.")
        missing = "No displacement error above round-off and above its uncertainty: a case whose "
        return Answer(question, missing + "reference is finer would tell.")
    parts = [_spread(name, own) for name, own in list(errors.items())[:_NAMED]]
    if rest := list(errors.values())[_NAMED:]:
        worst = max(one.high for own in rest for one in own.values())
        parts.append(f"{len(rest)} more at most {number(worst, 2)}")
    first = next(iter(errors.values()))
    example = sorted(first.items(), key=lambda one: one[1].value)[(len(first) - 1) // 2][0]
    return Answer(question, f"Error of the displacement: {'; '.join(parts)}.", example)


_ALL = 1.0  # an interval as wide as all energy that moves tells no change of it


def energy(results: Sequence[CaseResult]) -> Answer:
    """Answer how far the total energy drifts where nothing is to take any.

    A blade takes energy, as the solver says; verdicts on `released_to_cut` judge that. What damping
    takes is known from the outputs alone, as a sum over the spans between them: what the sum misses
    is as large as a drift, and no scheme's.
    """
    told = [(s.solver, d, r.case) for r, s in moving(results) if (d := s.metric("energy_drift"))]
    drifts = [one for one in told if (one[1].uncertainty or 0.0) < _ALL]
    cases = {case for *_, case in drifts}
    worst: dict[str, tuple[Any, str]] = {}
    for name, drift, case in drifts:
        if name not in worst or drift.value > worst[name][0].value:
            worst[name] = drift, case
    others = {f"{what} takes energy": {result.case for result, _ in moving(results, what)}
              for what in _TAKERS}  # fmt: skip
    others["the energy is not known from the outputs"] = {case for *_, case in told} - cases
    said = [f"{len(c)} case{'s' * (len(c) != 1)} in which {what}"
            for what, c in others.items() if c]  # fmt: skip
    left = f" Left out: {', '.join(said)}." if said else ""
    if not worst:
        return Answer("Energy", f"No energy was followed: a case in motion would tell.{left}")
    parts = []
    order = sorted(worst, key=lambda name: name == BASELINE)
    for name in order[:_NAMED]:
        drift, where = worst[name]
        value, most = (number(drift.value + width, 2) for width in (0.0, drift.uncertainty))
        bounds = [f"at most {most}"] * (most != value) + [where] * (len(cases) > 1)
        inside = f" ({', '.join(bounds)})" if bounds else ""
        parts.append(f"{solver_title(name)} {value}{inside}")
    if rest := [d.value + d.uncertainty for d, _ in (worst[name] for name in order[_NAMED:])]:
        parts.append(f"{len(rest)} more at most {number(max(rest), 2)}")
    where = min(cases) if len(cases) == 1 else f"{len(cases)} cases in motion"
    said_of = f"Largest relative change of the total energy in {where}"
    return Answer("Energy", f"{said_of}: {'; '.join(parts)}.{left}")


def slivers(results: Sequence[CaseResult]) -> Answer:
    """Answer what slivers do to the error and to the critical step."""
    curves = sliver_curves(results)
    if not curves:
        missing = "No slivers: a family of cases over [parameters] epsilon would tell."
        return Answer("Slivers", missing)
    parts = []
    order = sorted(dict.fromkeys(c.solver for c in curves), key=lambda name: name == BASELINE)
    shown = {solver_title(name): [name] for name in order[:_NAMED]}
    if rest := order[_NAMED:]:
        shown[f"{len(rest)} more"] = rest
    for title, names in shown.items():
        own = [c for c in curves if c.solver in names]
        errors = [y for c in own if c.measure == "error" for _, y in c.places[1:]]
        steps = [y for c in own if c.measure != "error" for _, y in c.places[1:]]
        said = [f"error at most {number(max(errors), 3)} times"] if errors else []
        said += [f"critical step at least {number(min(steps), 3)} times"] if steps else []
        parts.append(f"{title}: {', '.join(said)}")
    least = min(x for c in curves for x, _ in c.places)
    families = len({c.family for c in curves})
    where = f"{families} famil{'y' if families == 1 else 'ies'}"
    beside = f"As slivers shrink to ε = {number(least, 1)} of an element ({where})"
    return Answer("Slivers", f"{beside}, beside the largest ε: {'; '.join(parts)}.")


def cost(results: Sequence[CaseResult]) -> Answer:
    """Answer what accuracy costs: the time of a cut at equal error."""
    found = dict(_ratios(results, _time_ratio))
    if found:
        found = {name: _over_cases(own) for name, own in found.items()}
        said = _compared(found, "takes", "time of {} for a cut at an equal error")
        return Answer("Cost", f"{said} {_of_times(results)}", _example(results, found))
    timed = [
        (result.case, curve)
        for result in results
        for curve in compared_curves(result)
        if curve.solver != BASELINE and any(_seconds(p) for p in curve.points)
    ]
    if not timed:
        return Answer("Cost", "No time was measured: a solve with an error would tell.")
    case, curve = max(timed, key=lambda one: len(one[1].points))
    last = curve.points[-1]
    said = f"{curve.label}: {number(last.value, 2)} in {number(_seconds(last), 2)} s"
    missing = "no other solver reaches an equal error in the same case, to compare the time with"
    return Answer("Cost", f"{said} ({case}); {missing}.", case)


def _over_cases(own: Mapping[str, Ratio]) -> dict[str, Ratio]:
    """Widen the ends of each ratio so that the ends of the median hold the spread over cases too.

    Repetitions in one run share its load, and the error depends on the case. Between the k-th and
    the k-th last of the cases the median lies with 90 %, whatever the distribution (sign test).
    """
    values, n = sorted(_values(own)), len(own)
    tails = [2 * sum(math.comb(n, i) for i in range(k)) / 2**n for k in range(1, n // 2 + 1)]
    k = max(sum(tail <= _BEYOND for tail in tails), 1)
    low, high = values[k - 1], values[n - k]
    return {case: Ratio(r.value, min(r.low, low), max(r.high, high)) for case, r in own.items()}


def _of_times(results: Sequence[CaseResult]) -> str:
    """Say what the interval of times holds."""
    contended = any(s.notes.get("timing", "").startswith("contended")
                    for r in results for s in r.solves)  # fmt: skip
    beside = " on a machine with other work" if contended else ""
    return f"The interval is that over cases and repetitions of one run{beside}."


def compared_curves(result: CaseResult) -> list[Curve]:
    """Return the displacement error of every solver but the reference, coarse to fine."""
    return [c for c in error_curves(result, _ERROR) if c.solver != REFERENCE]


def moving(
    results: Sequence[CaseResult], taker: str | None = None
) -> Iterator[tuple[CaseResult, SolveRecord]]:
    """Yield the solves, on the finest level of each solver, whose total energy is known.

    Those in which one of `_TAKERS` takes energy, or those in which nothing is to take any.
    """
    for result in results:
        solved = (s for s in result.solves if s.status is Status.SOLVED)
        for solve in finest_of(solved).values():
            followed = solve.solver != REFERENCE and len(solve.account.get("total", [])) > 1
            if followed and solve.energy_taker == taker:
                yield result, solve


def energy_curve(solve: SolveRecord) -> list[tuple[float, float]]:
    """Return (share of the time, relative change of the total energy) of a solve in motion.

    It is scaled so that its largest value is the metric ``energy_drift``.
    """
    times, total = solve.account["time"], solve.account["total"]
    drift = solve.metric("energy_drift")
    change = [abs(value - total[0]) for value in total]
    if drift is None or not max(change) > 0.0:
        return []
    span = times[-1] - times[0] or 1.0
    return [((t - times[0]) / span, c * drift.value / max(change))
            for t, c in zip(times, change, strict=True) if c > 0.0]  # fmt: skip


def sliver_curves(results: Sequence[CaseResult]) -> list[SliverCurve]:
    """Return error and critical step over ε of each solver and family with two ε > 0 at least."""
    places: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    for result in results:
        row = result.row or {}
        size = row.get("value")
        if row.get("parameter") != _PARAMETER or not isinstance(size, int | float) or size <= 0:
            continue
        solved = (s for s in result.solves if s.status is Status.SOLVED)
        for name, solve in finest_of(solved).items():
            error = solve.metric(_ERROR)
            if error is not None and error.value > max(error.uncertainty, ROUND_OFF):
                places.setdefault((name, row["family"], "error"), []).append((size, error.value))
            step = _step(solve)
            if step is not None:
                key = (name, row["family"], "critical step")
                places.setdefault(key, []).append((size, step))
    curves = []
    for (name, family, measure), own in places.items():
        own.sort(reverse=True)
        if len(own) > 1:
            shares = [(x, y / own[0][1]) for x, y in own]
            curves.append(SliverCurve(name, family, measure, shares))
    return curves


def _step(solve: SolveRecord) -> float | None:
    """Return the critical step that is noted, in seconds; None if it is not known."""
    try:
        step = float(solve.notes.get(CRITICAL_STEP, "").removesuffix(" s"))
    except ValueError:
        return None
    return step if 0.0 < step < math.inf else None


def _ratios(
    results: Sequence[CaseResult], compare: Callable[[Curve, Curve], Ratio | None]
) -> Iterator[tuple[str, dict[str, Ratio]]]:
    """Yield each solver that is compared with the baseline, and its ratio in each such case."""
    found: dict[str, dict[str, Ratio]] = {}
    for result in results:
        curves = compared_curves(result)
        beside = next((c for c in curves if c.solver == BASELINE), None)
        for curve in curves:
            if beside is not None and curve is not beside and (r := compare(curve, beside)):
                found.setdefault(curve.label, {})[result.case] = r
    order = sorted(found, key=lambda name: (name != "XFEM", median(_values(found[name]))))
    yield from ((name, found[name]) for name in order)


def _error_ratio(own: Curve, other: Curve) -> Ratio | None:
    """Error over error on the finest level of both, where both are above their uncertainty."""
    theirs = {p.level: p for p in other.points if _resolved(p)}
    shared = [(p, theirs[p.level]) for p in own.points if p.level in theirs and _resolved(p)]
    if not shared:
        return None
    p, q = shared[-1]
    low = (p.value - p.uncertainty) / (q.value + q.uncertainty)
    return Ratio(p.value / q.value, low, (p.value + p.uncertainty) / (q.value - q.uncertainty))


def _time_ratio(own: Curve, other: Curve) -> Ratio | None:
    """Time over time at the smallest error that both reach."""
    times = times_at_equal_error(*(
        [(p.value, (d.median, d.low, d.high)) for p in c.points
         if (d := p.duration) and _resolved(p) and _seconds(p)] for c in (own, other)
    ))  # fmt: skip
    if times is None:
        return None
    (value, low, high), (beside, least, most) = times
    return Ratio(value / beside, low / most, high / least)


def _seconds(point: Point) -> float:
    """Return the median time of a cut, in seconds; 0 if it is not known."""
    time = point.duration
    return time.median if time is not None and time.low > 0.0 else 0.0


def _resolved(point: Point) -> bool:
    return point.value > max(point.uncertainty, ROUND_OFF)


def _finest_errors(results: Sequence[CaseResult]) -> dict[str, dict[str, Ratio]]:
    """Return the errors on the finest level by solver and case, where they are resolved."""
    found: dict[str, dict[str, Ratio]] = {}
    for result in results:
        for curve in compared_curves(result):
            p = curve.points[-1]
            if _resolved(p):
                own = Ratio(p.value, p.value - p.uncertainty, p.value + p.uncertainty)
                found.setdefault(curve.label, {})[result.case] = own
    return found


def _compared(found: Mapping[str, Mapping[str, Ratio]], verb: str, what: str) -> str:
    """Say of each solver the median of its ratios, with its interval and the number of cases."""
    medians = {
        name: _interval(Ratio(*(median(end) for end in zip(*own.values(), strict=True))))
        for name, own in found.items()
    }
    beside = f"times the {what.format(solver_title(BASELINE))}"
    if len(medians) == 1:
        ((name, middle),) = medians.items()
        return f"{name} {verb} {middle} {beside}, {_over(len(found[name]))}."
    parts = [f"{name} {middle} ({len(found[name])})" for name, middle in medians.items()]
    more = ""
    if rest := [one.high for own in list(found.values())[_NAMED:] for one in own.values()]:
        more = f"; {len(parts) - _NAMED} more at most {number(max(rest), 3)} in a case"
    return (
        f"Solvers that {verb.replace('has', 'have').replace('takes', 'take')} so many {beside}, "
        f"median (of cases): {', '.join(parts[:_NAMED])}{more}."
    )


def _failing(results: Sequence[CaseResult], found: Mapping[str, Mapping[str, Ratio]]) -> str:
    """Name the compared solvers that fail a check: errors of theirs may cancel."""
    failed = {
        solver_title(verdict.solver)
        for result in results
        for verdict in result.verdicts
        if verdict.verdict is Verdict.FAIL and not verdict.known
    }
    names = [name for name in found if name in failed]
    return f" Solvers that fail a check: {', '.join(names)}." if names else ""


def _left_out(results: Sequence[CaseResult], found: Mapping[str, Mapping[str, Ratio]]) -> str:
    """Say in how many cases with both errors, not at round-off, no ratio can be told."""
    unresolved = 0
    for result in results:
        curves = {c.solver: c for c in compared_curves(result)}
        told = any(result.case in own for own in found.values())
        if BASELINE in curves and len(curves) > 1 and not told:
            errors = [p.value for c in curves.values() for p in c.points]
            unresolved += max(errors) > ROUND_OFF
    cases = f"{unresolved} more case{'s' * (unresolved != 1)}"
    return f" In {cases} the uncertainty is as large as an error." if unresolved else ""


def _over(count: int) -> str:
    return "in one case" if count == 1 else f"in the median of {count} cases"


def _interval(ratio: Ratio) -> str:
    value, low, high = (number(end, 3) for end in ratio)
    return value if low == high == value else f"{value} ({low}–{high})"


def _spread(name: str, own: Mapping[str, Ratio]) -> str:
    values = sorted(_values(own))
    if len(values) == 1:
        one = next(iter(own.values()))
        return f"{name} {_interval(one)} ({next(iter(own))})"
    ends = f"{number(values[0], 2)} to {number(values[-1], 2)}"
    return f"{name} {number(median(values), 2)}, median of {len(values)} cases ({ends})"


def _example(results: Sequence[CaseResult], found: Mapping[str, Mapping[str, Ratio]]) -> str:
    """Return the case to draw: of those with the most levels, up to three, the one in the middle.

    That is the case whose ratio, of the first solver, is nearest to the median of all cases.
    """
    own = next(iter(found.values()))
    levels = {r.case: min(3, len({s.level for s in r.solves if s.solver == BASELINE}))
              for r in results if r.case in own}  # fmt: skip
    most, middle = max(levels.values()), median(_values(own))
    return min((case for case in own if levels[case] == most),
               key=lambda case: abs(math.log(own[case].value / middle)))  # fmt: skip


def _values(own: Mapping[str, Ratio]) -> list[float]:
    return [ratio.value for ratio in own.values()]
