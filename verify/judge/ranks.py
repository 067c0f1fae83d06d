"""The ranking of the solvers of a run: one table per question, and what was left out."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from verify.compare.energy_account import ACCOUNT
from verify.judge.intervals import ERROR_METRICS
from verify.judge.profiles import data_profiles, performance_profile
from verify.judge.ranks_by_accuracy import accuracy_comparisons
from verify.judge.ranks_by_cost import cost_comparisons, why_times_are_no_sample
from verify.judge.ranks_by_stability import stability_standings
from verify.judge.standing import compared_by_worst, item_on_finest
from verify.ranking import Comparison, LeftOut, Ranking, ranked_solvers
from verify.result import REFERENCE, CaseResult, Status, Verdict


def rank_solvers(
    results: Sequence[CaseResult], conformance: Mapping[str, Mapping[str, Any]] | None = None
) -> dict[str, Any]:
    """Rank the solvers of a run.

    Parameters
    ----------
    results : sequence of CaseResult
    conformance : mapping of str to mapping, optional
        What ``verify conform`` found, by solver; kept beside the ranks, which it does not move.

    Returns
    -------
    dict
        A `Ranking` as plain data.
    """
    solvers = ranked_solvers(results)
    found = Ranking(
        schema=1,
        cases=[result.case for result in results],
        solvers=solvers,
        conformance={name: dict(found) for name, found in (conformance or {}).items()},
        accuracy=accuracy_comparisons(results, solvers),
        stability=stability_standings(results, solvers),
        energy=energy_comparisons(results, solvers),
        cost=cost_comparisons(results, solvers),
        left_out=_left_out(results),
        contended=_why_times_may_be_off(results, solvers),
        profiles=[performance_profile(results, solvers), *data_profiles(results, solvers)],
    )
    return asdict(found)


def _why_times_may_be_off(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[str]:
    said = why_times_are_no_sample(results, solvers)
    known = {s.notes["timing"] for r in results for s in r.solves if "timing" in s.notes}
    return sorted({*said, *(n for n in known if not any(why.startswith(n) for why in said))})


def _left_out(results: Sequence[CaseResult]) -> list[LeftOut]:
    """List what no ranking counts: solves without an answer, and checks nobody could decide."""
    listed = []
    for result in results:
        for solve in result.solves:
            if solve.status is not Status.SOLVED:
                why = f"level {solve.level} {solve.status}: {solve.reason or 'no reason given'}"
                listed.append(LeftOut(result.case, solve.solver, why))
        if why := _uncompared(result):
            listed.append(LeftOut(result.case, "", why))
        for verdict in result.verdicts:
            if verdict.verdict in (Verdict.UNDECIDED, Verdict.ERROR):
                why = f"{verdict.check} {verdict.metric} {verdict.verdict}: {verdict.reason}"
                listed.append(LeftOut(result.case, verdict.solver, why))
    return listed


def _uncompared(result: CaseResult) -> str:
    """Say why no error was measured in a case, if none was."""
    errors = set(ERROR_METRICS) - set(ACCOUNT)
    solved = [s for s in result.solves if s.status is Status.SOLVED and s.solver != REFERENCE]
    if not solved or any(m.name in errors for s in solved for m in s.metrics):
        return ""
    said = next((s.notes["comparison"] for s in solved if "comparison" in s.notes), "")
    return f"no error is measured: {said or 'no reason given'}"


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
