"""Results of solvers on the finest level that they were asked for, or why there are none."""

from collections.abc import Sequence
from math import isfinite

from verify.assess.intervals import Interval, NotMeasuredError, error_interval
from verify.result import CaseResult, SolveRecord, Status
from verify.study.ranking.standing import Item


def item_on_finest(result: CaseResult, name: str, solvers: Sequence[str], label: str) -> Item:
    """Take a metric of every solver on its finest level; the item is called `label`."""
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
    return Item(label, found, missing)


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
