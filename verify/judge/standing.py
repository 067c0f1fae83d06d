"""Standing of solvers in one comparison: ranks from intervals, ties where they overlap."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite

from verify.judge.convergence import ROUND_OFF
from verify.judge.intervals import ERROR_METRICS, Interval, NotMeasuredError, error_interval
from verify.result import CaseResult, Comparison, LeftOut, SolveRecord, Standing, Status

_SAME_SIZE = 0.1  # as for checks of ratios: unstructured meshes do not meet a size exactly


@dataclass(frozen=True)
class Item:
    """One thing in which solvers are compared: a number per solver, smaller is better.

    Parameters
    ----------
    case : str
    found : dict of str to Interval
    missing : dict of str to str
        Solvers that have no number, and why.
    """

    case: str
    found: dict[str, Interval]
    missing: dict[str, str] = field(default_factory=dict)


def is_exact(item: Item) -> bool:
    """Whether the least number of an item is round-off, so that there are no ratios to it."""
    return min(found.value for found in item.found.values()) <= ROUND_OFF


def compared_by_mean(
    metric: str,
    view: str,
    solvers: Sequence[str],
    items: Sequence[Item | LeftOut],
) -> Comparison | None:
    """Join items by the geometric mean of ratios to the least number of each.

    The least counts among the solvers that have a number in every item: one that does a single
    case well must not be the measure of all others there. The interval of a ratio is that of the
    solver's own number, since the least one only sets the scale, which is the same for all. An
    item whose least number is round-off has no ratios and is left out, with the numbers
    (`compared_by_worst` is for those). So is one in which the reference cannot tell somebody's
    error from none: a single lower bound of zero would make that of the mean zero, and all ranks
    ties. What was left out before is listed with it.
    """
    counted: list[Item] = []
    left_out = [item for item in items if isinstance(item, LeftOut)]
    for item in [item for item in items if isinstance(item, Item)]:
        left_out += [LeftOut(item.case, solver, why) for solver, why in item.missing.items()]
        if len(item.found) < 2:
            alone = f"{', '.join(item.found)} alone" if item.found else "no solver"
            left_out.append(LeftOut(item.case, "", f"nothing to compare: {alone}"))
        elif is_exact(item):
            left_out.append(LeftOut(item.case, "", _exact_text(item.found)))
        elif why := _undecided(item):
            left_out.append(LeftOut(item.case, "", why))
        else:
            counted.append(item)
    if not counted:
        return Comparison(metric, view, "mean", 0, [], left_out) if left_out else None
    everywhere = [name for name in solvers if all(name in item.found for item in counted)]
    joined = {}
    for solver in solvers:
        ratios = [
            Interval(own.value / least, own.low / least, own.high / least)
            for item in counted
            if (own := item.found.get(solver)) is not None
            and (least := min(item.found[name].value for name in everywhere or item.found))
        ]
        if ratios:
            joined[solver] = (_mean(ratios), len(ratios), "")
    return Comparison(
        metric, view, "mean", len(counted), _standings(solvers, joined, len(counted)), left_out
    )


def compared_by_worst(
    metric: str, view: str, solvers: Sequence[str], items: Sequence[Item]
) -> Comparison | None:
    """Join items by their largest number; numbers at round-off are as good as zero."""
    left_out = [LeftOut(i.case, solver, why) for i in items for solver, why in i.missing.items()]
    counted = [item for item in items if item.found]
    if not counted:
        return None
    joined = {}
    for solver in solvers:
        own = [(item.found[solver], item.case) for item in counted if solver in item.found]
        if own:
            worst, case = max(own, key=lambda pair: pair[0].value)
            joined[solver] = (_above_round_off(worst), len(own), case)
    standings = _standings(solvers, joined, len(counted))
    return Comparison(metric, view, "worst", len(counted), standings, left_out)


def _standings(
    solvers: Sequence[str], joined: Mapping[str, tuple[Interval, int, str]], items: int
) -> list[Standing]:
    whole = {name: found for name, (found, count, _) in joined.items() if count == items}
    ranks = {
        name: 1 + sum(other.high < own.low for other in whole.values())
        for name, own in whole.items()
    }
    standings = []
    for solver in solvers:
        found, count, where = joined.get(solver, (None, 0, ""))
        rank = ranks.get(solver)
        tied = rank is not None and list(ranks.values()).count(rank) > 1
        value, low, high = (found.value, found.low, found.high) if found else (None,) * 3
        standings.append(Standing(solver, rank, tied, value, low, high, count, where))
    last = math.inf
    return sorted(standings, key=lambda s: (s.rank or last, last if s.value is None else s.value))


def _mean(ratios: Sequence[Interval]) -> Interval:
    def mean(numbers: Sequence[float]) -> float:
        if min(numbers) <= 0.0:
            return 0.0
        return math.exp(sum(map(math.log, numbers)) / len(numbers))

    return Interval(*(mean([getattr(r, end) for r in ratios]) for end in ("value", "low", "high")))


def _above_round_off(found: Interval) -> Interval:
    low = found.low if found.value > ROUND_OFF else 0.0
    return Interval(found.value, low, max(found.high, ROUND_OFF))


def _exact_text(found: Mapping[str, Interval]) -> str:
    exact = [name for name, own in found.items() if own.value <= ROUND_OFF]
    rest = [f"{name} {own.value:.2e}" for name, own in found.items() if own.value > ROUND_OFF]
    text = f"exact to round-off: {', '.join(exact)}"
    return f"{text}; not: {', '.join(rest)}" if rest else text


def _undecided(item: Item) -> str:
    """Say of which solvers the reference cannot tell the error from none."""
    said = [
        f"{name} {own.value:.1e} ± {own.half_width:.1e}"
        for name, own in item.found.items()
        if own.low <= 0.0
    ]
    return f"undecided, the uncertainty is not below the value: {', '.join(said)}" if said else ""


def item_on_finest(result: CaseResult, name: str, solvers: Sequence[str]) -> Item:
    """Take a metric of every solver on its finest level."""
    found, missing = {}, {}
    for solver in solvers:
        own = [s for s in result.solves if s.solver == solver]
        if not own:
            missing[solver] = "was not run on this case"
            continue
        last = max(own, key=lambda s: s.level)
        interval = interval_of(last, name)
        if interval is None:
            missing[solver] = _why(last, name)
        else:
            found[solver] = interval
    return Item(label_of(result, name), found, missing)


def item_at_equal_size(result: CaseResult, name: str, solvers: Sequence[str]) -> Item | LeftOut:
    """Take the finest level that all have who have any, if their sizes agree there."""
    finest = item_on_finest(result, name, solvers)
    errors = {
        solver: {
            s.level: (s, error)
            for s in result.solves
            if s.solver == solver and (error := interval_of(s, name)) is not None
        }
        for solver in solvers
    }
    present = {solver: levels for solver, levels in errors.items() if levels}
    common = set.intersection(*(set(levels) for levels in present.values())) if present else set()
    for level in sorted(common, reverse=True):
        if _same([levels[level][0].size for levels in present.values()]):
            missing = {s: why for s, why in finest.missing.items() if s not in present}
            found = {solver: levels[level][1] for solver, levels in present.items()}
            return Item(label_of(result, name), found, missing)
    why = "no level on which all have it, with element sizes that agree within 10 %"
    return LeftOut(label_of(result, name), "", why)


def _same(sizes: Iterable[float | None]) -> bool:
    known = [size or 0.0 for size in sizes]
    return min(known) > 0.0 and max(known) / min(known) - 1 <= _SAME_SIZE


def label_of(result: CaseResult, name: str) -> str:
    """Return what an item is called: its case, and the quantity if it is one."""
    return result.case if name in ERROR_METRICS else f"{result.case}, {name}"


def interval_of(solve: SolveRecord, name: str) -> Interval | None:
    """Interval in which a metric of a solve lies; None if there is no such number."""
    measured = solve.metric(name)
    if solve.status is not Status.SOLVED or measured is None:
        return None
    try:
        found = error_interval(measured)
    except NotMeasuredError:
        return None
    return found if isfinite(found.value) and isfinite(found.high) else None


def _why(solve: SolveRecord, name: str) -> str:
    if solve.status is not Status.SOLVED:
        return f"level {solve.level} {solve.status}: {solve.reason or 'no reason given'}"
    said = solve.notes.get(name) or solve.notes.get("comparison") or "not measured"
    return f"level {solve.level}: {said}"
