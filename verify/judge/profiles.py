"""Performance profiles (Dolan and Moré 2002) and data profiles (Moré and Wild 2009) of solvers."""

from collections.abc import Sequence
from dataclasses import replace

from verify.judge.ranks_by_accuracy import item_at_equal_size
from verify.judge.rates import ROUND_OFF
from verify.judge.standing import Item
from verify.judge.work import work_points
from verify.ranking import Profile
from verify.result import CaseResult

_METRIC = "displacement_l2"
_FAR = 100.0  # times the least error: of no use, however much more it is
_ERRORS = (0.1, 0.01)  # what a simulator needs, and what a verification does


def performance_profile(results: Sequence[CaseResult], solvers: Sequence[str]) -> Profile:
    """Ratios of each solver's displacement error to the least one, at equal element size.

    An error that is round-off counts as `ROUND_OFF`, so that exact solvers tie.
    """
    items = [item_at_equal_size(result, _METRIC, solvers) for result in results]
    compared = [item for item in items if isinstance(item, Item) and len(item.found) > 1]
    steps: dict[str, list[float]] = {name: [] for name in solvers}
    for item in compared:
        least = max(min(own.value for own in item.found.values()), ROUND_OFF)
        for name, own in item.found.items():
            steps[name].append(max(own.value, ROUND_OFF) / least)
    quantity = "error over the least error, at equal element size"
    return replace(_profile(quantity, len(compared), steps), most=_FAR)


def data_profiles(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[Profile]:
    """Least seconds in which each solver has brought each case below an error, on any level."""
    found = []
    for error in _ERRORS:
        steps: dict[str, list[float]] = {name: [] for name in solvers}
        for result in results:
            points = [p for p in work_points(result.solves, _METRIC) if p.solver in solvers]
            good = [p for p in points if p.error <= error]
            for name in {p.solver for p in good}:
                steps[name].append(min(p.seconds for p in good if p.solver == name))
        found.append(_profile(f"seconds to a relative error of {error:g}", len(results), steps))
    return found


def _profile(quantity: str, items: int, steps: dict[str, list[float]]) -> Profile:
    return Profile(quantity, items, {name: sorted(own) for name, own in steps.items()})
