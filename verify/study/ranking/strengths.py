"""Strengths of solvers: in how many cases nobody is better, and the clearest of them."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from verify.assess.intervals import Interval
from verify.assess.rates import ROUND_OFF
from verify.ranking import Strength
from verify.result import CaseResult
from verify.study.ranking.accuracy import item_at_equal_size
from verify.study.ranking.cost import cost_item, why_times_are_no_sample
from verify.study.ranking.standing import Item

_SAME = 1e-6  # relative: two programs of one method differ by their linear solvers
_NEAR = 1.05  # of the best
_ACCURACY = ("displacement_l2", "energy_norm", "jump_l2")
_TIME = "time at equal error"


def strengths(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[Strength]:
    """Compare the solvers of a run case by case.

    Parameters
    ----------
    results : sequence of CaseResult
    solvers : sequence of str

    Returns
    -------
    list of Strength
        By question and solver, of those who have a number in a case that another has too.
    """
    questions: list[tuple[str, Callable[[CaseResult], object]]] = [
        (metric, lambda result, m=metric: item_at_equal_size(result, m, solvers))  # type: ignore[misc]
        for metric in _ACCURACY
    ]
    if not why_times_are_no_sample(results, solvers):
        questions.append((_TIME, lambda result: cost_item(result, "displacement_l2", solvers)))
    found = []
    for question, item_of in questions:
        items = [item for item in map(item_of, results) if isinstance(item, Item)]
        compared = [_widened(item) for item in items if len(item.found) > 1]
        for solver in solvers:
            own = [item for item in compared if solver in item.found]
            if own:
                found.append(_strength(question, solver, own))
    return found


def _widened(item: Item) -> Item:
    """Let numbers be tied that are round-off, or equal but for the linear solvers."""
    half, found = (1.0 + _SAME) ** 0.5, {}
    for name, own in item.found.items():
        least = max(own.value, ROUND_OFF)
        found[name] = Interval(least, min(own.low, least) / half, max(own.high, least) * half)
    return replace(item, found=found)


def _strength(question: str, solver: str, items: Sequence[Item]) -> Strength:
    best = alone = near = 0
    clearest, widest = ("", 0.0, "", 0.0), (0.0, 0.0)
    for item in items:
        own = item.found[solver]
        others = {name: one for name, one in item.found.items() if name != solver}
        near += own.value <= _NEAR * min(one.value for one in item.found.values())
        if any(one.high < own.low for one in others.values()):
            continue
        best += 1
        worse = {name: one.value for name, one in others.items() if one.low > own.high}
        alone += len(worse) == len(others)
        if worse:
            next_one = min(worse, key=lambda name: worse[name])
            # where fewer share the first place the place says more
            gap = len(worse) / len(others), worse[next_one] / own.value
            if gap > widest:
                widest = gap
                clearest = (item.case, own.value, next_one, worse[next_one])
    return Strength(question, solver, len(items), best, alone, near, *clearest)
