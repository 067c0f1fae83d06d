"""The ranking of the solvers of a run: pairs, coverage, robustness, energy, and the omissions."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import inf, isfinite
from typing import Any

from verify.compare.part_account import ACCOUNT, OF_ENERGY
from verify.judge.convergence import ROUND_OFF
from verify.judge.cost import why_times_are_no_sample
from verify.judge.intervals import ERROR_METRICS, Interval, number_on_finest
from verify.judge.notices import INSIDE_OUT
from verify.judge.pairs import coverage_of, groups_of, not_told, pairs_of
from verify.result import (
    REFERENCE,
    CaseResult,
    Comparison,
    LeftOut,
    Ranking,
    SolveRecord,
    StabilityStanding,
    Standing,
    Status,
    Verdict,
    ranked_solvers,
)

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
        schema=2,
        cases=[result.case for result in results],
        solvers=solvers,
        conformance={name: dict(found) for name, found in (conformance or {}).items()},
        pairs=pairs_of(results, solvers),
        groups=groups_of(results, solvers),
        coverage=coverage_of(results, solvers),
        stability=stability_standings(results, solvers),
        energy=energy_comparisons(results, solvers),
        left_out=[*_left_out(results), *not_told(results, solvers)],
        contended=_why_times_may_be_off(results, solvers),
    )
    return asdict(found)


def _why_times_may_be_off(results: Sequence[CaseResult], solvers: Sequence[str]) -> list[str]:
    said = [f"{why}: times tie" for why in why_times_are_no_sample(results, solvers)]
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

    Momenta count only where nothing acts from outside, and changes of the energy only where neither
    a blade nor damping takes any: elsewhere they have to change. Numbers at round-off are as good
    as zero.
    """
    comparisons = []
    for metric in ACCOUNT:
        cases = [
            result
            for result in results
            if any(s.metric(metric) for s in result.solves if s.solver in solvers)
            and not ("momentum" in metric and _acted_on(result))
            and not (metric in OF_ENERGY and any(s.energy_taker for s in result.solves))
        ]
        if (found := _by_worst(metric, solvers, cases)) is not None:
            comparisons.append(found)
    return comparisons


def _by_worst(
    metric: str, solvers: Sequence[str], cases: Sequence[CaseResult]
) -> Comparison | None:
    left_out: list[LeftOut] = []
    found: dict[str, list[tuple[Interval, str]]] = {}
    for result in cases:
        for solver in solvers:
            number = number_on_finest(result, metric, solver)
            if isinstance(number, str):
                left_out.append(LeftOut(result.case, solver, number))
            else:
                found.setdefault(solver, []).append((number, result.case))
    if not found:
        return None
    items = len({case for own in found.values() for _, case in own})
    return Comparison(metric, items, _standings(solvers, found, items), left_out)


def _standings(
    solvers: Sequence[str], found: Mapping[str, Sequence[tuple[Interval, str]]], items: int
) -> list[Standing]:
    worst = {name: max(own, key=lambda pair: pair[0].value) for name, own in found.items()}
    spans = {name: _above_round_off(number) for name, (number, _) in worst.items()}
    whole = {name: span for name, span in spans.items() if len(found[name]) == items}
    ranks = {
        name: 1 + sum(other.high < own.low for other in whole.values())
        for name, own in whole.items()
    }
    standings = []
    for solver in solvers:
        rank, span = ranks.get(solver), spans.get(solver)
        tied = rank is not None and list(ranks.values()).count(rank) > 1
        value, low, high = (span.value, span.low, span.high) if span else (None, None, None)
        count, where = len(found.get(solver, [])), worst[solver][1] if span else ""
        standings.append(Standing(solver, rank, tied, value, low, high, count, where))
    return sorted(standings, key=lambda s: (s.rank or inf, inf if s.value is None else s.value))


def _above_round_off(found: Interval) -> Interval:
    low = found.low if found.value > ROUND_OFF else 0.0
    return Interval(found.value, low, max(found.high, ROUND_OFF))


def _acted_on(result: CaseResult) -> bool:
    return bool(result.scene.get("supports") or result.scene.get("loads"))


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
                inside_out=sum(INSIDE_OUT in solve.notes for solve in solves),
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
