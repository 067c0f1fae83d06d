"""Pairs of solvers on the scenes that both did: wins, ties and losses, ratios; groups; coverage.

What a third solver does or refuses moves none of these numbers. A scene is a case, or all members
of a sweep together: their median. Scenes at rest and in motion stay apart.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from verify.judge.convergence import ROUND_OFF
from verify.judge.cost import (
    WorkPoint,
    times_at_equal_error,
    why_times_are_no_sample,
    work_points,
)
from verify.judge.intervals import ERROR_METRICS, Interval, interval_of
from verify.result import CaseResult, LeftOut, Pair, SolveRecord, Status

NORMS = ("displacement_l2", "energy_norm", "jump_l2")
QUANTITIES = "quantities"  # of interest: those of a scene together
TIME = "time"  # that a cut costs anew, at an equal error of the displacement
METRICS = (*NORMS, QUANTITIES, TIME)
KINDS = ("rest", "motion")
_EQUAL = 1e-6  # numbers of a pair, relative; of one discretisation, relative to the field
_TELLING = 100 * _EQUAL  # errors from which on an agreement to that is no chance
_SAME_SIZE = 0.1  # as for checks of ratios: unstructured meshes do not meet a size exactly
_FEW = 10  # scenes below which a range has no percentiles
_SHARED = 3  # scenes that show that two programs are one discretisation

type _Levels = dict[int, tuple[float, Interval]]  # element size and number
type _Item = Mapping[str, Any]  # by solver: numbers by level, or times; a pair is taken from them
type _Both = tuple[Interval, Interval]


class _Outcome(NamedTuple):
    """Of one solver beside another: 1 won, 0 tied, -1 lost; log of the ratio, if there is one."""

    won: int
    ratio: float | None


def pairs_of(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[Pair]:
    """Compare every two solvers, by metric and kind of scene; each pair in both directions.

    A scene is won where one interval lies wholly below the other. It is a tie where they overlap,
    where both are exact to round-off, and where both numbers agree to 1e-6. Of several items (the
    quantities of a case, the members of a sweep) the median outcome and ratio count.

    Parameters
    ----------
    results : sequence of CaseResult
    solvers : sequence of str
        Those that are compared.

    Returns
    -------
    list of Pair
        Without those that have no scene in common.
    """
    found = []
    for kind in KINDS:
        for metric in METRICS:
            both = _at_equal_error if metric == TIME else _at_equal_size
            scenes = [
                [item for member in members for item in _items(member, metric, solvers)]
                for members in scenes_of(results, kind)
            ]
            for solver, rival in combinations(solvers, 2):
                compared = (_joined(items, both, solver, rival) for items in scenes)
                outcomes = [outcome for outcome in compared if outcome is not None]
                if outcomes:
                    found.append(_pair(metric, kind, solver, rival, outcomes))
                    found.append(_pair(metric, kind, rival, solver, list(map(_turned, outcomes))))
    return found


def groups_of(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[list[str]]:
    """Find solvers that are one discretisation: their errors agree to 1e-6 wherever both are.

    Errors are relative to the field, and so is the 1e-6: loads may be integrated by other rules. In
    three scenes at least an error has to be above 1e-4: small ones agree whatever made them. Of
    the members of a sweep the median counts: round-off parts programs at the smallest slivers. A
    solver joins the first group of which it agrees with every member.

    Returns
    -------
    list of list of str
        Groups of two or more, in the order of `solvers`.
    """
    scenes = [members for kind in KINDS for members in scenes_of(results, kind)]
    items = [
        [[item for member in members for item in _items(member, name, solvers)] for name in NORMS]
        for members in scenes
    ]
    groups: list[list[str]] = []
    for solver in solvers:
        for group in groups:
            if all(_are_one(items, solver, other) for other in group):
                group.append(solver)
                break
        else:
            groups.append([solver])
    return [group for group in groups if len(group) > 1]


def coverage_of(
    results: Sequence[CaseResult], solvers: Sequence[str]
) -> dict[str, dict[str, list[int]]]:
    """Count the scenes that each solver answered, and those that it was asked.

    A case is answered where a number of its answer could be measured on some level; a sweep where
    more than half of its members are.

    Returns
    -------
    dict
        By solver and kind of scene: ``[answered, asked]``.
    """
    counted = {name: {kind: [0, 0] for kind in KINDS} for name in solvers}
    for kind in KINDS:
        for members in scenes_of(results, kind):
            for name in solvers:
                own = [[s for s in member.solves if s.solver == name] for member in members]
                asked = [solves for solves in own if solves]
                answered = sum(any(map(_answered, solves)) for solves in asked)
                counted[name][kind][0] += 2 * answered > len(asked)
                counted[name][kind][1] += bool(asked)
    return counted


def not_told(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[LeftOut]:
    """List the errors on finest levels that the reference cannot tell from none: in no ratio."""
    found = []
    for result in results:
        for metric in (*NORMS, QUANTITIES):
            for name, levels in _named_items(result, metric, solvers):
                finest = {own: numbers[max(numbers)][1] for own, numbers in levels.items()}
                untold = [
                    f"{own} {number.value:.1e} ± {number.half_width:.1e}"
                    for own, number in finest.items()
                    if number.low <= 0.0 and number.value > ROUND_OFF
                ]
                if untold:
                    why = f"{name} not told from none, in no ratio: {', '.join(untold)}"
                    found.append(LeftOut(result.case, "", why))
    return found


def scenes_of(results: Sequence[CaseResult], kind: str) -> list[list[CaseResult]]:
    """Group the cases of a kind by scene: each by itself, but members of a sweep together."""
    scenes: dict[str, list[CaseResult]] = {}
    for result in results:
        moving = (result.scene.get("analysis") or {}).get("kind") == "dynamic"
        if kind == ("motion" if moving else "rest"):
            name = result.case if result.row is None else f"sweep {result.row['family']}"
            scenes.setdefault(name, []).append(result)
    return list(scenes.values())


def _answered(solve: SolveRecord) -> bool:
    return solve.status is Status.SOLVED and bool(solve.metrics)


def _items(result: CaseResult, metric: str, solvers: Sequence[str]) -> list[_Item]:
    """Return what a metric stands for in a case, by solver: numbers by level, or times."""
    if metric == TIME:
        return [{name: _timed(result, name) for name in solvers}]
    return [levels for _, levels in _named_items(result, metric, solvers)]


def _named_items(
    result: CaseResult, metric: str, solvers: Sequence[str]
) -> Iterator[tuple[str, dict[str, _Levels]]]:
    own = [solve for solve in result.solves if solve.solver in solvers]
    names = [metric]
    if metric == QUANTITIES:
        measured = dict.fromkeys(m.name for solve in own for m in solve.metrics)
        names = [name for name in measured if name not in ERROR_METRICS]
    for name in names:
        found: dict[str, _Levels] = {}
        for solve in own:
            if (number := interval_of(solve, name)) is not None:
                found.setdefault(solve.solver, {})[solve.level] = solve.size or 0.0, number
        yield name, found


def _timed(result: CaseResult, solver: str) -> tuple[list[WorkPoint], bool]:
    """Take what a solver's levels cost, and whether its times are a sample."""
    own = [s for s in result.solves if s.solver == solver]
    return work_points(own, NORMS[0]), not why_times_are_no_sample([result], [solver])


def _at_equal_size(one: _Levels, other: _Levels) -> _Both | None:
    """Take the numbers on the finest level of both whose element sizes agree."""
    for level in sorted(set(one) & set(other), reverse=True):
        (size, mine), (beside, theirs) = one[level], other[level]
        if min(size, beside) > 0.0 and abs(math.log(size / beside)) <= math.log1p(_SAME_SIZE):
            return mine, theirs
    return None


def _at_equal_error(
    one: tuple[list[WorkPoint], bool], other: tuple[list[WorkPoint], bool]
) -> _Both | None:
    """Take the times at an equal error; they tie where repetitions are no sample."""
    times = times_at_equal_error(one[0], other[0])
    if times is None or (one[1] and other[1]):
        return times
    first, second = (time.value for time in times)
    low, high = min(first, second), max(first, second)
    return Interval(first, low, high), Interval(second, low, high)


def _joined(
    items: Sequence[_Item], both: Callable[[Any, Any], _Both | None], solver: str, rival: str
) -> _Outcome | None:
    """Compare two solvers in a scene; None if they have no item in common."""
    met = [_outcome(*numbers) for numbers in _met(items, both, solver, rival)]
    if not met:
        return None
    ratios = [outcome.ratio for outcome in met if outcome.ratio is not None]
    return _Outcome(int(median(one.won for one in met)), median(ratios) if ratios else None)


def _met(
    items: Sequence[_Item], both: Callable[[Any, Any], _Both | None], solver: str, rival: str
) -> list[_Both]:
    common = (item for item in items if solver in item and rival in item)
    found = (both(item[solver], item[rival]) for item in common)
    return [numbers for numbers in found if numbers is not None]


def _outcome(mine: Interval, theirs: Interval) -> _Outcome:
    exact = [number.value <= ROUND_OFF for number in (mine, theirs)]
    won = (mine.high < theirs.low) - (theirs.high < mine.low)
    if all(exact) or _agree(mine, theirs):
        won = 0
    # of an error that the reference cannot tell from none there is no ratio either
    told = not any(exact) and min(mine.low, theirs.low) > 0.0
    return _Outcome(won, math.log(mine.value / theirs.value) if told else None)


def _agree(mine: Interval, theirs: Interval) -> bool:
    return abs(mine.value - theirs.value) <= _EQUAL * max(mine.value, theirs.value)


def _are_one(scenes: Sequence[Sequence[Sequence[_Item]]], solver: str, rival: str) -> bool:
    shared = 0
    for norms in scenes:
        common = [met for items in norms if (met := _met(items, _at_equal_size, solver, rival))]
        if any(median(abs(x.value - y.value) for x, y in met) > _EQUAL for met in common):
            return False
        shared += any(median(x.value for x, _ in met) > _TELLING for met in common)
    return shared >= _SHARED


def _turned(outcome: _Outcome) -> _Outcome:
    return _Outcome(-outcome.won, None if outcome.ratio is None else -outcome.ratio)


def _pair(metric: str, kind: str, solver: str, rival: str, outcomes: Sequence[_Outcome]) -> Pair:
    won = [outcome.won for outcome in outcomes]
    logs = [outcome.ratio for outcome in outcomes if outcome.ratio is not None]
    middle = low = high = None
    if logs:
        ends = (0.05, 0.95) if len(logs) >= _FEW else (0.0, 1.0)
        middle, low, high = (math.exp(v) for v in np.quantile(logs, [0.5, *ends]))
    return Pair(metric, kind, solver, rival, won.count(1), won.count(0), won.count(-1),
                middle, low, high, len(logs))  # fmt: skip
