"""Accuracy: nearness to the truth at equal element size and on each one's finest level."""

from collections.abc import Iterable, Sequence

from verify.compare.energy_account import ACCOUNT
from verify.judge.intervals import ERROR_METRICS
from verify.judge.standing import (
    Item,
    compared_by_mean,
    compared_by_worst,
    interval_of,
    is_exact,
    item_on_finest,
)
from verify.ranking import Comparison, LeftOut
from verify.result import CaseResult

EQUAL_SIZE, FINEST = "equal size", "finest level"
EXACT = "where a solver is exact"
QUANTITIES = "quantities"  # all quantities of interest of all cases together
_MAIN = ("displacement_l2", "energy_norm", "jump_l2")
_SAME_SIZE = 0.1  # as for checks of ratios: unstructured meshes do not meet a size exactly


def accuracy_comparisons(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[Comparison]:
    """Compare errors: the main norms, those that a case judges, and the quantities of interest.

    Parameters
    ----------
    results : sequence of CaseResult
    solvers : sequence of str
        Those that are ranked.

    Returns
    -------
    list of Comparison
        For each metric one at equal size and one on the finest level. Items in which a solver is
        exact to round-off have no ratios: they are compared by the largest number of each solver
        on its finest level.
    """
    judged = {v.metric for r in results for v in r.verdicts if v.metric in ERROR_METRICS}
    metrics = [*_MAIN, *sorted(judged - {*_MAIN, *ACCOUNT}), QUANTITIES]
    comparisons = []
    for metric in metrics:
        for view, item_of in ((EQUAL_SIZE, item_at_equal_size), (FINEST, _on_finest)):
            items = [
                item_of(result, name, solvers)
                for result in results
                for name in _names(result, metric, solvers)
            ]
            if (found := compared_by_mean(metric, view, solvers, items)) is not None:
                comparisons.append(found)
        # of the view above that came last: on the finest level
        exact = [i for i in items if isinstance(i, Item) and len(i.found) > 1 and is_exact(i)]
        if (found := compared_by_worst(metric, EXACT, solvers, exact)) is not None:
            comparisons.append(found)
    return comparisons


def _names(result: CaseResult, metric: str, solvers: Sequence[str]) -> list[str]:
    """Return what a metric stands for in a case: itself, or the names of the quantities."""
    own = [m for s in result.solves if s.solver in solvers for m in s.metrics]
    if metric == QUANTITIES:
        named = {m.name for m in own if m.name not in ERROR_METRICS and m.reference}
        return sorted(named)
    return [metric] if any(m.name == metric for m in own) else []


def _label(result: CaseResult, name: str) -> str:
    return result.case if name in ERROR_METRICS else f"{result.case}, {name}"


def _on_finest(result: CaseResult, name: str, solvers: Sequence[str]) -> Item:
    return item_on_finest(result, name, solvers, _label(result, name))


def item_at_equal_size(result: CaseResult, name: str, solvers: Sequence[str]) -> Item | LeftOut:
    """Take the finest level that all have who have any, if their sizes agree there."""
    finest = _on_finest(result, name, solvers)
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
            return Item(_label(result, name), found, missing)
    why = "no level on which all have it, with element sizes that agree within 10 %"
    return LeftOut(_label(result, name), "", why)


def _same(sizes: Iterable[float | None]) -> bool:
    known = [size or 0.0 for size in sizes]
    return min(known) > 0.0 and max(known) / min(known) - 1 <= _SAME_SIZE
