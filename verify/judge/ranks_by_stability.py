"""Robustness: solves that failed or blew up, refusals, regularisations."""

from collections.abc import Sequence
from math import isfinite

from verify.ranking import StabilityStanding
from verify.result import CaseResult, SolveRecord, Status

_ANSWER = ("displacement_l2", "displacement_l2_max")
_BLOWN_UP = 1.0 - 1e-9  # relative error: as far off as a body that does not move, to round-off


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
