"""A run held against a baseline, a row per quantity and axis, and against another run.

From a run a baseline takes what it does not know, and own values that are named; independent values
are never moved.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from verify.baseline.record import (
    Baseline,
    CaseBaseline,
    FinishedRun,
    Independent,
    Own,
    Quantity,
    Speed,
    finest,
    metric_of,
    physics_of,
    quantities_of,
    solve_at,
    speed_of,
)
from verify.errors import InputError
from verify.provenance import KERNEL, WIDTHS, changes_of
from verify.result import CaseResult, Metric, Status, Verdict, VerdictRecord, worst
from verify.runner.run import ALL_PASS, ONLY_WARNINGS, SOLVER_FAILED, VERDICT_FAILED
from verify.scene.strict import nearest

# below this an exact reference that is computed anew may differ by its own quadrature
_SAME_REFERENCE = 1e-9


@dataclass(frozen=True)
class Row:
    """One axis of one quantity.

    Attributes
    ----------
    case, quantity : str
    axis : str
        ``own``, ``independent``, ``reference`` (did the reference itself move?), ``speed``,
        ``meaning`` (in place of ``own``: the number means something else than the stored one;
        no FAIL), or ``case`` (the case as a whole).
    verdict : Verdict
        ERROR: it could not be checked.
    now, stored : float or None
    reason : str
    """

    case: str
    quantity: str
    axis: str
    verdict: Verdict
    now: float | None = None
    stored: float | None = None
    reason: str = ""


def check_run(baseline: Baseline, run: FinishedRun, partial: bool = False) -> list[Row]:
    """Compare everything that `baseline` knows with `run`.

    Parameters
    ----------
    baseline : Baseline
    run : FinishedRun
    partial : bool
        Whether cases that the run was not asked for are left out. Else each is a row ERROR:
        what was not looked at has not been found to be right.
    """
    cpu = str(run.provenance.get("cpu", ""))
    rows: list[Row] = []
    for name, case in baseline.cases.items():
        if name not in run.results:
            if not partial:
                rows.append(Row(name, "", "case", Verdict.ERROR, reason="not in this run"))
            continue
        rows += _case_rows(name, case, run.results[name], cpu, run.meaning)
    for name, result in run.results.items():
        known = baseline.cases.get(name)
        new = set(quantities_of(result, {})) - set(known.quantities if known else ())
        if new:
            text = f"{len(new)} quantities are not in the baseline; `save` adds them"
            rows.append(Row(name, "", "case", Verdict.UNDECIDED, reason=text))
    return rows


def _case_rows(
    name: str, case: CaseBaseline, result: CaseResult, cpu: str, meaning: int
) -> Iterator[Row]:
    if physics_of(result) != case.physics:
        text = "its scene is another one now; remove its entry from the file and save it again"
        yield Row(name, "", "case", Verdict.ERROR, reason=text)
        return
    for key, quantity in case.quantities.items():
        metric, why = metric_of(result, key)
        if metric is None:
            yield Row(name, key, "own", Verdict.ERROR, None, quantity.own.value, why)
            continue
        row = own_row(name, key, quantity, metric)
        if changed := changes_between(result, key, quantity.own.meaning, meaning):
            verdict = Verdict.PASS if row.verdict is Verdict.PASS else Verdict.UNDECIDED
            text = "; ".join(part for part in (row.reason, changed, "`update` it by name") if part)
            row = replace(row, axis="meaning", verdict=verdict, reason=text)
        yield row
        if quantity.independent is not None:
            if quantity.independent.tolerance is not None:
                yield independent_row(name, key, quantity.independent, metric)
            yield from _reference_rows(name, key, quantity.independent, metric)
    for key, speed in case.speed.items():
        yield _speed_row(name, key, speed, result, cpu)


_MANY = 100.0  # of its value: beyond, a share says less than the change


def changes_between(result: CaseResult, key: str, old: int, new: int) -> str:
    """Say what changed in the meaning of ``solver/level/metric`` of a case, or nothing."""
    place, _, metric = key.rpartition("/")
    solve = solve_at(result, place)
    changes = changes_of(metric, result.scene, solve, old, new) if solve else ()
    return "; ".join(f"since revision {one.revision} {one.why}" for one in changes)


def own_row(case: str, key: str, quantity: Quantity, metric: Metric) -> Row:
    """Hold a metric against the last own value."""
    own = quantity.own
    change = metric.value - own.value
    allowed = own.tolerance * abs(own.value) + own.absolute
    within = abs(change) <= allowed
    if within:
        text = ""
    elif abs(change) < _MANY * abs(own.value):
        text = f"changed by {change / abs(own.value):+.3g} (relative), allowed {own.tolerance:g}"
    else:
        text = f"changed by {change:+.3g} from {own.value:.3g}, allowed {allowed:.3g}"
    verdict = Verdict.PASS if within else Verdict.FAIL
    return Row(case, key, "own", verdict, metric.value, own.value, text)


def independent_row(case: str, key: str, known: Independent, metric: Metric) -> Row:
    """Hold a metric against the independent value, given how well that is known."""
    assert known.tolerance is not None
    off = abs(metric.value - known.value)
    # an error is as uncertain as the reference it was measured with
    width = known.uncertainty if known.value else metric.uncertainty
    allowed = known.tolerance * (abs(known.value) or 1.0)
    text = f"off by {off:.3g} ± {width:.1g}, allowed {allowed:.3g}; {known.source}"
    verdict = Verdict.FAIL if off - width > allowed else Verdict.UNDECIDED
    if off + width <= allowed:
        verdict, text = Verdict.PASS, ""
    return Row(case, key, "independent", verdict, metric.value, known.value, text)


def _reference_rows(case: str, key: str, known: Independent, metric: Metric) -> Iterator[Row]:
    """Complain if the reference of this run contradicts the stored one; silent otherwise."""
    if metric.reference is None or not known.value:
        return
    apart = abs(metric.reference - known.value)
    if known.source == metric.source:
        allowed = known.uncertainty + metric.uncertainty + _SAME_REFERENCE * abs(known.value)
    else:  # a stated value with its tolerance
        allowed = metric.uncertainty + (known.tolerance or 0.0) * abs(known.value)
    if apart > allowed:
        text = (
            f"the reference of this run ({metric.source}) contradicts the stored one "
            f"({known.source}): {apart:.3g} apart, {allowed:.3g} allowed by their uncertainties"
        )
        yield Row(case, key, "reference", Verdict.FAIL, metric.reference, known.value, text)


def _speed_row(case: str, key: str, stored: Speed, result: CaseResult, cpu: str) -> Row:
    solve = solve_at(result, key)
    if solve is None:
        return Row(case, key, "speed", Verdict.ERROR, None, stored.ratio, "was not run")
    now = speed_of(solve, cpu, {})
    if isinstance(now, str):
        return Row(case, key, "speed", Verdict.UNDECIDED, None, stored.ratio, now)
    if stored.kernel != KERNEL:
        text = (
            f"stored in units of kernel {stored.kernel}, now kernel {KERNEL}: `update` it by name"
        )
        return Row(case, key, "speed", Verdict.UNDECIDED, None, stored.ratio, text)
    factor, width = now.ratio / stored.ratio, now.spread + stored.spread
    low, high = factor * max(0.0, 1 - width), factor * (1 + width)
    text = f"takes {factor:.2f} times as long ({low:.2f}–{high:.2f})"
    if cpu != stored.cpu:
        verdict, text = Verdict.UNDECIDED, f"{text}, on another CPU than '{stored.cpu}'"
    elif high <= stored.slower_at_most:
        verdict, text = Verdict.PASS, ""
    elif low > stored.slower_at_most:
        verdict, text = Verdict.FAIL, f"{text}; allowed {stored.slower_at_most:g}"
    else:
        verdict, text = Verdict.UNDECIDED, f"{text}: too noisy to tell"
    return Row(case, key, "speed", verdict, now.ratio, stored.ratio, text)


def exit_code_of(rows: Sequence[Row], strict: bool = False) -> int:
    """Return 1 after a FAIL, else 3 after an ERROR, else 5 if strict and undecided, else 0."""
    verdicts = {row.verdict for row in rows}
    if Verdict.FAIL in verdicts:
        return VERDICT_FAILED
    if Verdict.ERROR in verdicts:
        return SOLVER_FAILED
    return ONLY_WARNINGS if strict and Verdict.UNDECIDED in verdicts else ALL_PASS


@dataclass(frozen=True)
class VerdictChange:
    """A check whose verdict differs between two runs; None where a run does not have it.

    `direction` is ``better``, ``worse``, ``gone`` or ``new``.
    """

    case: str
    check: str
    old: Verdict | None
    new: Verdict | None
    old_observed: float | None
    new_observed: float | None
    direction: str
    reason: str


def verdict_changes(old: FinishedRun, new: FinishedRun) -> list[VerdictChange]:
    """Return the checks whose verdicts differ, those that became worse first."""
    changes = []
    for case in dict.fromkeys([*old.results, *new.results]):
        before, after = _checks(old.results.get(case)), _checks(new.results.get(case))
        for check in dict.fromkeys([*before, *after]):
            a, b = before.get(check), after.get(check)
            if a is None or b is None or a.verdict is not b.verdict:
                changes.append(_change(case, check, a, b))
    order = ["worse", "gone", "new", "better"]
    return sorted(changes, key=lambda change: order.index(change.direction))


def any_worse(changes: Sequence[VerdictChange]) -> bool:
    """Whether a verdict became worse, or a check that passed is gone."""
    return any(
        change.direction == "worse" or (change.direction == "gone" and change.old is Verdict.PASS)
        for change in changes
    )


def meaning_lines(old: FinishedRun, new: FinishedRun) -> Iterator[str]:
    """Yield a line per change of meaning between two runs, with the numbers that it concerns."""
    found: dict[str, list[str]] = {}
    for case, result in new.results.items():
        for solve in finest(result):
            for metric in solve.metrics:
                key = f"{solve.solver}/{solve.level}/{metric.name}"
                if changed := changes_between(result, key, old.meaning, new.meaning):
                    found.setdefault(changed, []).append(f"{case}:{key}")
    for changed, numbers in found.items():
        more = f" and {len(numbers) - 3} more" if len(numbers) > 3 else ""
        yield f"meaning: {changed} ({', '.join(numbers[:3])}{more})"
    if (old.meaning < WIDTHS[0]) != (new.meaning < WIDTHS[0]):
        yield f"meaning: since revision {WIDTHS[0]} {WIDTHS[1]}"


def _checks(result: CaseResult | None) -> dict[str, VerdictRecord]:
    """Verdicts by check; a check that a case makes twice is numbered."""
    if result is None:
        return {}
    found, times = {}, Counter[str]()
    for record in result.verdicts:
        name = f"{record.check} of {record.metric} ({record.solver})"
        times[name] += 1
        found[name if times[name] == 1 else f"{name} #{times[name]}"] = record
    return found


def _change(
    case: str, check: str, old: VerdictRecord | None, new: VerdictRecord | None
) -> VerdictChange:
    direction = "new" if old is None else "gone"
    if old is not None and new is not None:
        direction = "worse" if worst([old.verdict, new.verdict]) is new.verdict else "better"
    return VerdictChange(
        case=case,
        check=check,
        old=old.verdict if old else None,
        new=new.verdict if new else None,
        old_observed=old.observed if old else None,
        new_observed=new.observed if new else None,
        direction=direction,
        reason=new.reason if new else "not in the new run",
    )


SPEED = "speed"


@dataclass(frozen=True)
class Move:
    """An own value and what the run has for it.

    `state` is ``moved``, ``refused`` (with a reason), or ``differs`` (it was not named).
    """

    case: str
    quantity: str
    old: float
    new: float | None
    state: str
    reason: str = ""


def update_from(
    baseline: Baseline, run: FinishedRun, only: Sequence[str]
) -> tuple[Baseline, list[Move]]:
    """Move the own values named in `only` to the values of `run`.

    Parameters
    ----------
    baseline : Baseline
    run : FinishedRun
    only : sequence of str
        ``case:metric`` (of every solver in the file), ``case:solver/level/metric``,
        ``case:speed`` or ``case:solver/level/speed``. Nothing else moves.

    Returns
    -------
    baseline : Baseline
    moves : list of Move
        Everything that was moved, refused, or differs beyond its tolerance without being named.

    Raises
    ------
    InputError
        If something is named that the baseline does not have.
    """
    named = _named(baseline, only)
    cases, moves = dict(baseline.cases), []
    for name, case in baseline.cases.items():
        wanted = {key for at, key in named if at == name}
        result = run.results.get(name)
        if result is None or physics_of(result) != case.physics:
            why = "not in this run" if result is None else "its scene is another one now"
            moves += [_refused(name, key, case, why) for key in sorted(wanted)]
            continue
        quantities, speed = dict(case.quantities), dict(case.speed)
        for key, quantity in case.quantities.items():
            own, move = _quantity_move(name, key, quantity, result, run, key in wanted)
            quantities[key] = quantity.model_copy(update={"own": own})
            moves += [move] if move else []
        cpu = str(run.provenance.get("cpu", ""))
        for key, entry in case.speed.items():
            if f"{key}/{SPEED}" in wanted:
                speed[key], move = _speed_move(name, key, entry, result, run, cpu)
                moves.append(move)
        cases[name] = CaseBaseline(physics=case.physics, quantities=quantities, speed=speed)
    return Baseline(cases=cases), moves


def _named(baseline: Baseline, only: Sequence[str]) -> set[tuple[str, str]]:
    known = [
        (name, key)
        for name, case in baseline.cases.items()
        for key in [*case.quantities, *(f"{key}/{SPEED}" for key in case.speed)]
    ]
    chosen: set[tuple[str, str]] = set()
    for text in only:
        # solver names may hold a colon (module:Class), cases do not
        case, _, metric = text.partition(":")
        found = {
            (name, key)
            for name, key in known
            if name == case and metric in (key, key.rpartition("/")[2])
        }
        if not found:
            words = {f"{name}:{key}" for name, key in known}
            words |= {f"{name}:{key.rpartition('/')[2]}" for name, key in known}
            hint = nearest(text, words) if words else "; the baseline is empty"
            raise InputError(f"--only {text}: no such value{hint}")
        chosen |= found
    return chosen


def _quantity_move(
    case: str, key: str, quantity: Quantity, result: CaseResult, run: FinishedRun, named: bool
) -> tuple[Own, Move | None]:
    own, (metric, why) = quantity.own, metric_of(result, key)
    if metric is None:
        return own, Move(case, key, own.value, None, "refused", why) if named else None
    if not named:
        within = own_row(case, key, quantity, metric).verdict is Verdict.PASS
        return own, None if within else Move(case, key, own.value, metric.value, "differs")
    known = quantity.independent
    if known is not None and known.tolerance is not None:
        row = independent_row(case, key, known, metric)
        if row.verdict is Verdict.FAIL:
            reason = f"it contradicts the independent value: {row.reason}"
            return own, Move(case, key, own.value, metric.value, "refused", reason)
    moved = own.model_copy(update={"value": float(metric.value), **run.origin})
    return moved, Move(case, key, own.value, metric.value, "moved")


def _speed_move(
    case: str, key: str, entry: Speed, result: CaseResult, run: FinishedRun, cpu: str
) -> tuple[Speed, Move]:
    name = f"{key}/{SPEED}"
    solve = solve_at(result, key)
    if solve is None:
        return entry, Move(case, name, entry.ratio, None, "refused", "was not run")
    now = speed_of(solve, cpu, run.origin)
    if isinstance(now, str):
        return entry, Move(case, name, entry.ratio, None, "refused", now)
    moved = now.model_copy(update={"slower_at_most": entry.slower_at_most})
    return moved, Move(case, name, entry.ratio, now.ratio, "moved")


def _refused(case: str, key: str, entry: CaseBaseline, why: str) -> Move:
    if key in entry.quantities:
        return Move(case, key, entry.quantities[key].own.value, None, "refused", why)
    ratio = entry.speed[key.removesuffix(f"/{SPEED}")].ratio
    return Move(case, key, ratio, None, "refused", why)


def save_run(baseline: Baseline, run: FinishedRun) -> tuple[Baseline, list[str]]:
    """Add the cases, quantities and speeds of `run` that `baseline` does not have.

    The independent axis is filled from the case (a value with its source, or a bound of the error)
    and from the run's reference. Its tolerance is never taken from a measurement.

    Returns
    -------
    baseline : Baseline
    notes : list of str
        What was left out, and why.

    Raises
    ------
    InputError
        If a case of the baseline has another scene now.
    """
    cases, notes = dict(baseline.cases), []
    cpu = str(run.provenance.get("cpu", ""))
    for name, result in run.results.items():
        physics = physics_of(result)
        known = cases.get(name, CaseBaseline(physics=physics))
        if known.physics != physics:
            raise InputError(
                f"'{name}' is another scene than the one in the baseline; remove its entry from "
                "the file, then save"
            )
        speeds = {}
        for solve in finest(result):
            key = f"{solve.solver}/{solve.level}"
            if solve.status is not Status.SOLVED:
                notes.append(f"{name}:{key}: left out, {solve.status}: {solve.reason}")
                continue
            speed = speed_of(solve, cpu, run.origin)
            if isinstance(speed, str):
                notes.append(f"{name}:{key}: no speed, {speed}")
            else:
                speeds[key] = speed
        cases[name] = CaseBaseline(
            physics=physics,
            quantities={**quantities_of(result, run.origin), **known.quantities},
            speed={**speeds, **known.speed},
        )
    return Baseline(cases=cases), notes
