"""Who keeps energy and momentum, in cases that move."""

from collections.abc import Sequence
from math import isfinite

from verify.ranking import Comparison
from verify.result import CaseResult, Status
from verify.study.energy_account import ACCOUNT
from verify.study.ranking.standing import Item, compared_by_worst
from verify.verdict import error_interval

__all__ = ["energy_comparisons"]


def energy_comparisons(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[Comparison]:
    """Compare what is kept on the finest level of each case; the worst case counts.

    Momenta count only where nothing acts from outside: elsewhere they have to change.
    """
    comparisons = []
    for metric in ACCOUNT:
        items = [
            _item(result, metric, solvers)
            for result in results
            if any(s.metric(metric) for s in result.solves if s.solver in solvers)
            and not ("momentum" in metric and _acted_on(result))
        ]
        if (found := compared_by_worst(metric, "finest level", solvers, items)) is not None:
            comparisons.append(found)
    return comparisons


def _acted_on(result: CaseResult) -> bool:
    return bool(result.scene.get("supports") or result.scene.get("loads"))


def _item(result: CaseResult, metric: str, solvers: Sequence[str]) -> Item:
    found, missing = {}, {}
    for solver in solvers:
        own = [s for s in result.solves if s.solver == solver]
        if not own:
            missing[solver] = "was not run on this case"
            continue
        last = max(own, key=lambda s: s.level)
        measured = last.metric(metric)
        if last.status is not Status.SOLVED:
            missing[solver] = f"level {last.level} {last.status}: {last.reason}"
        elif measured is None or not isfinite(measured.value):
            missing[solver] = last.notes.get(metric, "not measured")
        else:
            found[solver] = error_interval(measured)
    return Item(result.case, found, missing)
