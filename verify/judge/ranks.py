"""The ranking of the solvers of a run: a table per question, and what was left out."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

from verify.compare.part_account import ACCOUNT
from verify.judge.cost import (
    cost_comparisons,
    data_profiles,
    performance_profile,
    why_times_are_no_sample,
)
from verify.judge.intervals import ERROR_METRICS
from verify.judge.pairs import coverage_of, groups_of, pairs_of
from verify.judge.standing import (
    Item,
    compared_by_mean,
    compared_by_worst,
    is_exact,
    item_at_equal_size,
    item_on_finest,
)
from verify.result import (
    REFERENCE,
    CaseResult,
    Comparison,
    LeftOut,
    Ranking,
    SolveRecord,
    StabilityStanding,
    Status,
    Verdict,
    ranked_solvers,
)

EQUAL_SIZE, FINEST = "equal size", "finest level"
EXACT = "where a solver is exact"
QUANTITIES = "quantities"  # all quantities of interest of all cases together
_MAIN = ("displacement_l2", "energy_norm", "jump_l2")
_ANSWER = ("displacement_l2", "displacement_l2_max")
_BLOWN_UP = 1.0 - 1e-9  # relative error: as far off as a body that does not move, to round-off


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
        pairs=pairs_of(results, solvers),
        groups=groups_of(results, solvers),
        coverage=coverage_of(results, solvers),
        profiles=[performance_profile(results, solvers), *data_profiles(results, solvers)],
    )
    return asdict(found)


def _why_times_may_be_off(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[str]:
    said = [f"{why}: by time all are tied" for why in why_times_are_no_sample(results, solvers)]
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
            item_on_finest(result, metric, solvers)
            for result in results
            if any(s.metric(metric) for s in result.solves if s.solver in solvers)
            and not ("momentum" in metric and _acted_on(result))
        ]
        if (found := compared_by_worst(metric, "finest level", solvers, items)) is not None:
            comparisons.append(found)
    return comparisons


def _acted_on(result: CaseResult) -> bool:
    return bool(result.scene.get("supports") or result.scene.get("loads"))


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
        for view, item_of in ((EQUAL_SIZE, item_at_equal_size), (FINEST, item_on_finest)):
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


def stability_standings(
    results: Sequence[CaseResult], solvers: Sequence[str]
) -> list[StabilityStanding]:
    """Count how the solves of every solver ended; the least lost first."""
    own = {name: [s for r in results for s in r.solves if s.solver == name] for name in solvers}
    lost = {name: _lost(solves) for name, solves in own.items()}
    known = [share for share in lost.values() if share is not None]
    standings = []
    for name, solves in own.items():
        ended = [solve.status for solve in solves]
        counts: dict[str, int] = {}
        for entry in (e for solve in solves for e in solve.regularisations):
            counts[entry.kind] = counts.get(entry.kind, 0) + entry.count
        share = lost[name]
        standings.append(
            StabilityStanding(
                solver=name,
                rank=None if share is None else 1 + sum(other < share for other in known),
                tied=share is not None and known.count(share) > 1,
                asked=len(solves),
                **{status.value: ended.count(status) for status in Status},
                blown_up=sum(map(_blown_up, solves)),
                inside_out=sum(map(_inside_out, solves)),
                lost=share,
                regularisations=counts,
            )
        )
    return sorted(standings, key=lambda s: (s.lost is None, s.lost or 0.0))


def _lost(solves: Sequence[SolveRecord]) -> float | None:
    tried = [solve for solve in solves if solve.status is not Status.REFUSED]
    bad = [s for s in tried if s.status is not Status.SOLVED or _blown_up(s)]
    return len(bad) / len(tried) if tried else None


def _blown_up(solve: SolveRecord) -> bool:
    found = [m for name in _ANSWER if (m := solve.metric(name)) is not None]
    # a body that does not move is off by 1 whatever the reference: its uncertainty may not hide it
    return solve.status is Status.SOLVED and any(
        not isfinite(m.value) or (m.value >= _BLOWN_UP and m.uncertainty < 0.5 * m.value)
        for m in found
    )


def _inside_out(solve: SolveRecord) -> bool:
    """Whether a note such as ``pieces inside out`` holds anything but zero."""
    for name, said in solve.notes.items():
        if name.endswith("inside out"):
            try:
                if float(said) != 0.0:
                    return True
            except ValueError:
                return True
    return False
