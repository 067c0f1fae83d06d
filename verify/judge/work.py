"""Work against precision: the time that a wanted error takes, and who is on the Pareto front."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from verify.judge.intervals import error_interval
from verify.result import SolveRecord, Status

# Phases that a solver pays once, however often the cut grows: its mesh does not know the cut. A
# conforming mesh is made anew, and so it is for a solver that is not known here.
ONCE: Mapping[str, tuple[str, ...]] = dict.fromkeys(
    (
        "xfem", "uncut", "subdivision", "snapping", "snapping_subdivision", "removal",
        "removal_refined", "virtual_node", "virtual_node_arbitrary", "mass_spring",
    ),
    ("meshing",),
)  # fmt: skip


@dataclass(frozen=True)
class WorkPoint:
    """One solve: what it cost and how far off it is.

    Parameters
    ----------
    solver : str
    level : int
    unknowns : int
    error, low, high : float
        Relative error and the interval in which it lies, given the reference's uncertainty.
    seconds, fastest, slowest : float
        Wall time of the phases that each cut costs anew: median, least and most of the
        repetitions.
    once : float
        Wall time of the phases that are paid once, s.
    phases : dict of str to float
        Median of each phase, s.
    memory : float
        Peak of the solving process, bytes.
    """

    solver: str
    level: int
    unknowns: int
    error: float
    low: float
    high: float
    seconds: float
    fastest: float
    slowest: float
    once: float
    phases: dict[str, float]
    memory: float


def work_points(records: Sequence[SolveRecord], metric: str) -> list[WorkPoint]:
    """Take the work and the precision of every solve that has both; coarse to fine."""
    points = []
    for record in sorted(records, key=lambda r: (r.solver, r.level)):
        measured = record.metric(metric)
        if record.status is not Status.SOLVED or measured is None or not record.timings:
            continue
        once = ONCE.get(record.solver, ())
        error = error_interval(measured)
        paid = {name: times for name, times in record.timings.items() if name not in once}
        totals = [sum(times) for times in zip(*paid.values(), strict=False)]
        if not totals:
            continue
        points.append(
            WorkPoint(
                solver=record.solver,
                level=record.level,
                unknowns=record.unknowns or 0,
                error=error.value,
                low=error.low,
                high=error.high,
                seconds=median(totals),
                fastest=min(totals),
                slowest=max(totals),
                once=sum(median(record.timings[name]) for name in once if name in record.timings),
                phases={name: median(times) for name, times in record.timings.items()},
                memory=record.peak_memory or 0.0,
            )
        )
    return points


def time_at(points: Sequence[WorkPoint], error: float) -> tuple[float, float, float] | None:
    """Return the time that `error` takes: median, least, most (s).

    Interpolated between the levels, log against log; None if the levels of `points` (of one
    solver) do not reach the error, and where they all stay below it, the time of the coarsest.
    """
    ordered = [p for p in sorted(points, key=lambda p: p.level) if p.error > 0]
    if not ordered or min(p.error for p in ordered) > error * (1 + 1e-9):
        return None
    if ordered[0].error <= error:
        first = ordered[0]
        return first.seconds, first.fastest, first.slowest
    for a, b in pairwise(ordered):
        if b.error <= error * (1 + 1e-9):
            share = math.log(a.error / error) / math.log(a.error / b.error)
            share = min(share, 1.0)
            one, two, three = (
                math.exp((1 - share) * math.log(s) + share * math.log(t))
                for s, t in (
                    (a.seconds, b.seconds), (a.fastest, b.fastest), (a.slowest, b.slowest),
                )
            )  # fmt: skip
            return one, two, three
    return None


def pareto_front(points: Sequence[WorkPoint]) -> list[WorkPoint]:
    """Return the points that no other beats in both time and error, fast to slow.

    A point whose error cannot be told from a faster one's (their intervals overlap) stays.
    """
    return [
        p
        for p in sorted(points, key=lambda p: p.seconds)
        if not any(q.slowest < p.fastest and q.high < p.low for q in points if q is not p)
    ]
