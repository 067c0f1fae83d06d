"""Conservation of energy and momentum, in cases that move."""

from collections.abc import Sequence

from verify.assess.energy_account import ACCOUNT
from verify.ranking import Comparison
from verify.result import CaseResult
from verify.study.ranking.finest import item_on_finest
from verify.study.ranking.standing import compared_by_worst


def energy_comparisons(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[Comparison]:
    """Compare what is kept on the finest level of each case; the worst case counts.

    Momenta count only where nothing acts from outside: elsewhere they have to change.
    """
    comparisons = []
    for metric in ACCOUNT:
        items = [
            item_on_finest(result, metric, solvers, result.case)
            for result in results
            if any(s.metric(metric) for s in result.solves if s.solver in solvers)
            and not ("momentum" in metric and _acted_on(result))
        ]
        if (found := compared_by_worst(metric, "finest level", solvers, items)) is not None:
            comparisons.append(found)
    return comparisons


def _acted_on(result: CaseResult) -> bool:
    return bool(result.scene.get("supports") or result.scene.get("loads"))
