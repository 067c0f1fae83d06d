"""Changes of a baseline: what it does not know is added, named own values are moved.

Independent values are never moved.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from verify.baseline.checking import independent_row
from verify.baseline.record import (
    Baseline,
    CaseBaseline,
    FinishedRun,
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
from verify.result import CaseResult, Status, Verdict
from verify.scene.strict import nearest

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
        within = abs(metric.value - own.value) <= own.tolerance * abs(own.value) + own.absolute
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
